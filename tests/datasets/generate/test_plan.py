"""Plans: faults in one line each, naming file, key and value."""

from pathlib import Path

import pytest
import trimesh

from omnisim.core.errors import OmnisimError, PlanError
from omnisim.datasets.generate.plan import read_plan
from omnisim.datasets.generate.prepared_plan import PreparedPlan
from tests.datasets.plans import write_plan


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[viewpoints]\nhight_m = 1", "viewpoints.hight_m: unknown key; did you mean 'height_m'?"),
        ("[viewpoints]\nheight_m = [-0.1, 1.0]", "height_m: expected heights above 0, got -0.1"),
        ('[viewpoints]\nwhere = "sky"', "viewpoints.where"),
        ('[viewpoints]\nwhere = "around"', "nodes: expected names of objects with where = "),
        ('[viewpoints]\nwhere = "poses"', 'file: expected with where = "poses"'),
        ('[[objects]]\nfile = "a.glb"\ncount = [2, 1]', "count: expected [least, most], got"),
        ("[reject]\nattempts = 0", "reject.attempts: expected a number ≥ 1, got 0"),
        ('[[cameras]]\nsensor = "a"\noptics = "b"', "expected one of sensor, calibration"),
        ('[[cameras]]\nmirrored = true', "mirrored: requires calibration"),
        ("[[cameras]]", "cameras: name = 'paper': expected each name once"),
        ('[[scenes]]\nfile = "a/room.glb"\n[[scenes]]\nfile = "b/room.glb"',
         "scenes: name = 'room': expected a different name for each file"),
    ],
)  # fmt: skip
def test_faults_of_the_plan(tmp_path, text, message):
    with pytest.raises(PlanError) as caught:
        read_plan(write_plan(tmp_path, text))
    assert message in str(caught.value)
    assert str(tmp_path / "plan.toml") in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"channels": ["range", "flow"]}, "flow: expected channels of single images"),
        ({"channels": ["rang"]}, "did you mean 'range'"),
        ({"shards": 0}, "shards: expected a number ≥ 1, got 0"),
        ({"seed": -1}, "seed: expected a number ≥ 0, got -1"),
        ({"image_format": "gif"}, "image_format"),
        ({"min_area_px": 9}, "min_area_px: requires the channel instance"),
        ({"min_visible": 0.5}, "min_visible: requires the channel instance"),
        ({"channels": ["instance"], "min_visible": 2.0}, "min_visible: expected a number ≤ 1"),
        ({"channels": ["instance"], "min_area_px": 0}, "min_area_px: expected a number ≥ 1"),
    ],
)
def test_faults_of_its_keys(tmp_path, keys, message):
    with pytest.raises(PlanError) as caught:
        read_plan(write_plan(tmp_path, **keys))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[viewpoints]\nwhere = "path"\npaths = ["lapp"]',
         "viewpoints.paths: 'lapp' in soccer: did you mean"),
        ('[viewpoints]\nwhere = "around"\nnodes = ["cow*"]',
         "viewpoints.nodes = ['cow*']: no such object"),
        ('[viewpoints]\nwhere = "poses"\nfile = "no.tum"', "no.tum: cannot be read"),
        ("[viewpoints]\nradius_m = 50.0", "no free floor"),
        ('[[objects]]\nfile = "no.glb"', "no.glb"),
        ('[[vary.recolor]]\nnodes = ["cow"]', "vary.recolor.nodes = ['cow']: no such object"),
        ('[[cameras]]\nname = "b"\ncalibration = "no.yaml"', "no.yaml: cannot be read"),
        ('[[cameras]]\nname = "b"\npreset = "worst"', "preset 'worst'"),
    ],
)  # fmt: skip
def test_faults_of_its_files(tmp_path, text, message):
    prepared = PreparedPlan.read(write_plan(tmp_path, text, scene="soccer"))
    with pytest.raises(OmnisimError) as caught:
        prepared.check()
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_classes_of_several_numbers_are_noted(tmp_path):
    text = '[[scenes]]\nfile = "courtyard"'
    plan = write_plan(tmp_path, text, scene="soccer", channels=["semantic"])
    (notice,) = PreparedPlan.read(plan).notices()
    assert "in another scene: give all scenes the same labels = FILE" in notice
    text = plan.read_text()
    for scene in ("soccer", "courtyard"):
        text = text.replace(f'"{scene}"', f'"{scene}"\nlabels = "l.toml"')
    plan.write_text(text)
    (tmp_path / "l.toml").write_text('[[labels]]\nname = "all"\nnodes = ["*"]\n')
    assert PreparedPlan.read(plan).notices() == []


def test_the_fingerprint_is_of_what_images_depend_on(tmp_path):
    def fingerprint(text="", **keys):
        return PreparedPlan.read(write_plan(tmp_path, text, **keys)).fingerprint

    first = fingerprint()
    assert fingerprint(shards=100, license="mit", title="other") == first
    assert fingerprint('[viewpoints]\nwhere = "free"\nradius_m = 0.25') == first  # the defaults
    others = {
        fingerprint(seed=1), fingerprint(camera='preset = "webcam"'),
        fingerprint(scene="courtyard"),
        fingerprint("[vary]\npitch_deg = 1.0"), fingerprint(images_per_shard=4),
    }  # fmt: skip
    assert len({first, *others}) == 6


def test_the_fingerprint_is_the_same_from_every_folder(tmp_path, monkeypatch):
    trimesh.creation.box((4.0, 4.0, 0.1)).export(tmp_path / "floor.glb")
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "box.glb")
    plan = write_plan(tmp_path, '[[objects]]\nfile = "box.glb"', scene="floor.glb")
    first = PreparedPlan.read(plan)
    monkeypatch.chdir(tmp_path)
    for path in (Path("plan.toml"), Path("..", tmp_path.name, "plan.toml")):
        assert PreparedPlan.read(path).fingerprint == first.fingerprint
    assert first.scene(0).name == "floor"
