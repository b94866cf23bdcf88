"""Search of models, and what is said of those that are missing."""

import pytest

from omnisim.core.errors import SceneError
from omnisim.scene import load_scene
from tests.scene.formats.sdf.worlds import BOX, load, model, sdf, visual, world, write_model

CHAIR = model("chair", visual(BOX))
INCLUDE = "<include><uri>{}</uri></include>"


@pytest.fixture(autouse=True)
def _no_environment(monkeypatch, tmp_path):
    for name in ("GZ_SIM_RESOURCE_PATH", "GAZEBO_MODEL_PATH", "SDF_PATH"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))


@pytest.mark.parametrize(
    "uri", ["model://chair", "model://chair/model.sdf", "chair", "file://chair/model.sdf"]
)
def test_a_model_is_found_by_the_option(tmp_path, uri):
    write_model(tmp_path / "elsewhere" / "deep", "chair", CHAIR)
    place = tmp_path / "world" / "a" / "b" / "c"
    place.mkdir(parents=True)
    scene = load(place, world(INCLUDE.format(uri)), resources=[tmp_path / "elsewhere" / "deep"])
    assert scene.instance_names == ("chair/link/visual",)


@pytest.mark.parametrize("variable", ["GZ_SIM_RESOURCE_PATH", "GAZEBO_MODEL_PATH", "SDF_PATH"])
def test_a_model_is_found_by_the_environment(tmp_path, monkeypatch, variable):
    write_model(tmp_path / "elsewhere" / "deep", "chair", CHAIR)
    monkeypatch.setenv(variable, f"/nowhere:{tmp_path / 'elsewhere' / 'deep'}")
    assert load(tmp_path, world(INCLUDE.format("model://chair"))).instances


@pytest.mark.parametrize("place", ["models", "worlds/models", ".", "home/.gazebo/models"])
def test_a_model_is_found_around_the_world_and_at_home(tmp_path, place):
    write_model(tmp_path / place, "chair", CHAIR)
    (tmp_path / "worlds").mkdir(exist_ok=True)
    assert load(tmp_path / "worlds", world(INCLUDE.format("model://chair"))).instances


def test_the_option_comes_before_the_neighbors(tmp_path):
    write_model(tmp_path / "models", "chair", CHAIR)
    write_model(tmp_path / "mine", "chair", model("own", visual(BOX)))
    text = world(INCLUDE.format("model://chair"))
    assert load(tmp_path, text).instance_names == ("chair/link/visual",)
    scene = load(tmp_path, text, resources=[tmp_path / "mine"])
    assert scene.instance_names == ("own/link/visual",)


def test_the_latest_version_of_a_models_config_is_read(tmp_path):
    write_model(
        tmp_path / "models",
        "chair",
        CHAIR,
        "<model><sdf version='1.5'>model.sdf</sdf><sdf version='1.10'>new.sdf</sdf></model>",
    )
    (tmp_path / "models" / "chair" / "new.sdf").write_text(sdf(model("new", visual(BOX))))
    scene = load(tmp_path, world(INCLUDE.format("model://chair")))
    assert scene.instance_names == ("new/link/visual",)


def test_xml_is_read_as_leniently_as_gazebo_does(tmp_path):
    config = "\n<?xml version='1.0'?><!-- -- a -- --><model>R&D &lt;</model>"
    write_model(tmp_path / "models", "chair", CHAIR, config)
    plugin = "<plugin name='a'><gz:priority>1</gz:priority></plugin>"
    assert load(tmp_path, world(INCLUDE.format("model://chair") + plugin)).instances


FUEL = "https://fuel.gazebosim.org/1.0/OpenRobotics/models/My Chair"


def test_a_model_of_fuel_is_found_where_gazebo_has_downloaded_it(tmp_path):
    cache = "home/.gz/fuel/fuel.gazebosim.org/openrobotics/models/my chair"
    for version, name in ((2, "two"), (10, "ten")):
        write_model(tmp_path / cache, str(version), model(name, visual(BOX)))
    for uri, name in ((FUEL, "ten"), (f"{FUEL}/2", "two"), (FUEL.replace(" ", "%20"), "ten")):
        scene = load(tmp_path, world(INCLUDE.format(uri)))
        assert scene.instance_names == (f"{name}/link/visual",)


def test_missing_models_are_counted_in_one_notice(tmp_path):
    includes = INCLUDE.format("model://sofa") * 3
    includes += INCLUDE.format(f"{FUEL}/1") + INCLUDE.format(f"{FUEL}/2")
    mesh = visual("<mesh><uri>model://sofa/sofa.dae</uri></mesh>")
    scene = load(tmp_path, world(includes + CHAIR + model("m", mesh)))
    assert scene.instance_names == ("chair/link/visual",)
    assert scene.notices == (
        "test.world: 4 objects not found, and not drawn: model://sofa × 3, "
        "model://sofa/sofa.dae: pass the folder of their models as --resources",
        "test.world: 2 objects not downloaded, and not drawn: OpenRobotics/My Chair × 2: "
        "`gz fuel download -u ADDRESS` downloads them",
    )


@pytest.mark.parametrize(
    "uris",
    [
        ("model://sun", "model://ground_plane"),
        (FUEL.replace("My Chair", "Sun"), FUEL.replace("My Chair", "Ground Plane")),
    ],
)
def test_ground_and_sun_are_drawn_where_gazebo_is_not_installed(tmp_path, uris):
    scene = load(tmp_path, world("".join(map(INCLUDE.format, uris))))
    assert scene.instance_names == ("ground_plane/link/visual",)
    assert len(scene.lighting.lights) == 1
    assert len(scene.notices) == 2


def test_models_that_include_each_other_are_refused(tmp_path):
    for name, other in (("a", "b"), ("b", "a")):
        inner = f"<model name='{name}'>{INCLUDE.format(f'model://{other}')}</model>"
        write_model(tmp_path / "models", name, inner)
    with pytest.raises(SceneError, match="expected at most 24 levels of nested models"):
        load(tmp_path, world(INCLUDE.format("model://a")))


def test_a_model_with_a_fault_is_named_with_its_file(tmp_path):
    write_model(tmp_path / "models", "chair", model("chair", visual("<box><size>1</size></box>")))
    with pytest.raises(SceneError) as info:
        load(tmp_path, world(INCLUDE.format("model://chair")))
    assert "models/chair/model.sdf: model[chair]/link[link]/visual[visual]/" in str(info.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><sdf>&b;</sdf>", "expected XML without entities"),
        ("<sdf>" + "<a>" * 200 + "</a>" * 200 + "</sdf>", "expected at most 128 levels of nested"),
        ("<sdf><world>", "not XML in line 1, column 13: no element found"),
        ("<robot/>", "expected <sdf>, got <robot>"),
        ("<sdf version='1.9'/>", "expected a <world>, <model> or <light>, got none"),
        (world(""), "has no triangles to draw"),
        (world(INCLUDE.format("model://x")), "has no triangles to draw; 1 object not found, and"),
        (world("<include/>"), "world[default]/include: expected a <uri>, got 'none'"),
    ],
)
def test_a_file_that_is_no_world_is_refused(tmp_path, text, message):
    with pytest.raises(SceneError) as info:
        load(tmp_path, text)
    assert message in str(info.value)
    assert str(info.value).startswith(f"{tmp_path / 'test.world'}: ")


def test_what_hangs_on_a_missing_model_is_left_out_with_it(tmp_path):
    frame = "<frame name='plate' attached_to='table::top'/>"
    ball = model("ball", visual(BOX), "<pose relative_to='plate'>0 0 0.1 0 0 0</pose>")
    lamp = "<light name='a' type='point'><pose relative_to='table'/></light>"
    table = INCLUDE.format("model://table")
    scene = load(tmp_path, world(table + frame + ball + lamp + CHAIR))
    assert scene.instance_names == ("chair/link/visual",)
    effect = "test.world: left out, as their poses are relative to models that are left out"
    assert scene.notices[1:] == (f"{effect} (1 model)", f"{effect} (1 light)")


def test_a_models_folder_is_a_scene(tmp_path):
    write_model(tmp_path, "chair", CHAIR)
    assert load_scene(tmp_path / "chair").instance_names == ("chair/link/visual",)
    with pytest.raises(SceneError, match=r"got a folder without a scene\.toml or model\.config"):
        load_scene(tmp_path)
