"""Visible shares of objects, against each object drawn alone by OpenGL; limits of boxes."""

import json
import tarfile

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

from omnisim import OmniCamera, Scene, Stage, WorldState
from omnisim.apps.cli.app import app
from omnisim.core.errors import PlanError
from omnisim.core.poses import pose
from omnisim.datasets.generate.sample_renderer import StageRays, VisibleShares
from tests.datasets.plans import write_plan

pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")
pytestmark = pytest.mark.usefixtures("needs_opengl")

CAMERA = OmniCamera().resized(160).with_quality("fast")
HEIGHT_M = 0.6
KEYS = {"channels": ["range", "instance"], "shards": 1, "images_per_shard": 2}
# a row of balls, each before the next one, and a wall behind them
BALLS = {f"ball_{n}": (1.0 + 0.8 * n, 0.5 * n, 0.3) for n in range(3)}


def _omnisim(*words):
    return CliRunner().invoke(app, [str(word) for word in words])


def _ball(name, radius_m=0.35):
    ball = trimesh.creation.icosphere(3, radius_m)
    return Scene.from_arrays(name, ball.vertices, ball.faces)


@pytest.fixture(scope="module")
def scene():
    wall = trimesh.creation.box((0.1, 4.0, 2.0), pose((4.0, 0.0, 1.0)))
    scene = Scene.from_arrays("wall", wall.vertices, wall.faces)
    for name, place in BALLS.items():
        scene = scene.added(name, _ball(name), pose(place))
    return scene


def test_shares_are_those_of_each_object_alone(scene):
    names = ["wall", *BALLS]
    with (
        Stage(scene, dynamic_objects={"moving": _ball("moving", 0.2)}) as stage,
        stage.open(CAMERA) as renderer,
    ):
        base = renderer.camera.base_pose((0.0, 0.0, HEIGHT_M))
        near = WorldState({renderer.vehicle: base, "moving": pose((3.0, -1.0, 0.3))})
        gone = WorldState({renderer.vehicle: base, "moving": pose((0.0, 0.0, -1e4))})
        whole = renderer.render(near, also=("instance",))
        shares = VisibleShares(renderer.camera).find(
            stage, StageRays().of(stage), whole, near, renderer.vehicle
        )
        alone_px = {}
        for name in names:
            stage.scene = scene
            for other in names:
                if other != name:
                    stage.scene = stage.scene.removed(other)
            alone_px[name] = _seen_px(renderer.render(gone, also=("instance",)), name)
        stage.scene = stage.scene.removed(names[-1])
        alone_px["moving"] = _seen_px(renderer.render(near, also=("instance",)), "moving")
    ids = {instance.name: instance.id for instance in whole.labels.instances}
    found = {name: shares[ids[name]] for name in alone_px}
    for name, count in alone_px.items():
        visible = int((whole.channels["instance"] == ids[name]).sum())
        # of a pixel at the silhouette, float32 and float64 may differ
        assert found[name] == pytest.approx(visible / count, abs=2.0 / count), name
    assert found["ball_0"] == 1.0
    assert all(0.1 < found[name] < 0.95 for name in ("wall", "ball_1", "ball_2", "moving"))


def _seen_px(frame, name):
    (number,) = (instance.id for instance in frame.labels.instances if instance.name == name)
    return int(np.sum(frame.channels["instance"] == number))


def _boxes(out):
    """Annotations of all samples, by the sample's number and the instance."""
    found = {}
    for path in sorted(out.glob("*.tar")):
        with tarfile.open(path) as tar:
            for member in tar:
                if member.name.endswith(".coco.json"):
                    for one in json.load(tar.extractfile(member))["annotations"]:
                        found[member.name[:9], one["instance_id"]] = one
    return found


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Data sets of the same images: without limits, and with all shares recorded."""
    made = {}
    for name, limits in (("none", {}), ("shares", {"min_visible": 0.0})):
        folder = tmp_path_factory.mktemp(name)
        plan = write_plan(folder, scene="courtyard", **KEYS, **limits)
        done = _omnisim("generate", plan, "-o", folder / "out")
        assert done.exit_code == 0, done.output
        made[name] = folder / "out"
    return made


def test_shares_are_recorded_and_leave_nothing_out(recorded):
    plain, shares = _boxes(recorded["none"]), _boxes(recorded["shares"])
    assert all(0.0 <= share.pop("visible_share") <= 1.0 for share in shares.values())
    assert shares == plain


def test_conversion_and_plan_leave_out_the_same_objects(recorded, tmp_path):
    least_px, least = 4, 0.7
    shares = _boxes(recorded["shares"])
    wanted = sorted(
        (share["instance_id"], share["area"])
        for share in shares.values()
        if share["area"] >= least_px and share["visible_share"] >= least
    )
    assert 0 < len(wanted) < sum(share["area"] >= least_px for share in shares.values())
    limits = {"min_visible": least, "min_area_px": least_px}
    plan = write_plan(tmp_path, scene="courtyard", **KEYS, **limits)
    assert _omnisim("generate", plan, "-o", tmp_path / "out").exit_code == 0
    kept = sorted((box["instance_id"], box["area"]) for box in _boxes(tmp_path / "out").values())
    assert kept == wanted
    done = _omnisim(
        "dataset", "convert", recorded["shares"], "-o", tmp_path / "coco",
        "--min-area-px", least_px, "--min-visible", least,
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    content = json.loads((tmp_path / "coco" / "annotations.json").read_text())
    assert sorted((one["instance_id"], one["area"]) for one in content["annotations"]) == wanted


def test_unknown_shares_are_refused(recorded, tmp_path):
    words = "dataset", "convert", recorded["none"], "-o", tmp_path / "coco", "--min-visible", 0.5
    done = _omnisim(*words)
    assert isinstance(done.exception, PlanError)
    assert "--min-visible: expected a data set with the visible shares" in str(done.exception)
    assert list(tmp_path.iterdir()) == []
