"""`omnisim scene`: what a scene holds, against the scene itself."""

import json

import numpy as np
import pytest
import trimesh
from PIL import Image

from omnisim.apps.cli.console import Output, out
from omnisim.apps.cli.worlds import scene
from omnisim.scene import builtin_scenes, load_scene
from tests.slow import slow_but


@pytest.mark.parametrize("name", slow_but(builtin_scenes(), "compass", "soccer", long=["mapping"]))
def test_the_document_agrees_with_the_scene(quiet, name):
    document, loaded = json.loads(quiet("scene", name, "--json")), load_scene(name)
    np.testing.assert_allclose(document["bounds_m"], loaded.bounds_m())
    instances = document["instances"]
    assert [instance["name"] for instance in instances] == list(loaded.instance_names)
    assert sum(instance["triangles"] for instance in instances) == loaded.triangle_count
    assert sum(instance["parts"] for instance in instances) == len(loaded.instances)
    assert sum(one["instances"] for one in document["classes"]) == len(instances)
    corners = np.array([(instance["min_m"], instance["max_m"]) for instance in instances])
    np.testing.assert_allclose(corners[:, 0].min(axis=0), loaded.bounds_m()[0])
    np.testing.assert_allclose(corners[:, 1].max(axis=0), loaded.bounds_m()[1])
    assert len(document["starts"]) == 1 + len(loaded.starts)
    assert len(document["paths"]) == len(loaded.paths)
    lamps = 0 if document["light"].startswith("none") else len(loaded.lighting.lights)
    assert len(document["lights"]) == lamps
    assert document["notices"] == list(loaded.notices)


def test_the_table_names_what_is_there(omnisim, quiet):
    out = quiet("scene", "soccer")
    for words in ("237", "30,835 triangles", "kick_off", "lap: 6 waypoints", "none: baked"):
        assert words in out
    assert "beacon_left_blue" in out  # a landmark
    assert "and 217 smaller ones: --all" in out
    assert len(omnisim("scene", "soccer", "--all")[1].splitlines()) > 237
    document = json.loads(quiet("scene", "soccer", "--json"))  # which has no lamps
    assert document["light"] == "none: baked light of emissive surfaces"
    assert document["lights"] == []
    assert "even light" in repr(load_scene("soccer", baked="none"))
    assert "reflects by" not in quiet("scene", "rings")


@pytest.fixture(scope="module")
def described():
    """Document of the scene `arcade`, made once."""
    return scene.describe(load_scene("arcade"))


@pytest.fixture
def arcade(described, monkeypatch):
    monkeypatch.setattr(scene, "describe", lambda _: described)
    return described


def test_instances_state_by_what_they_reflect(omnisim, arcade):
    found = [kind for instance in arcade["instances"] for kind in instance["reflections"]]
    assert set(found) == {"mirror", "pane", "probe", "sky"}
    assert "reflects by" in omnisim("scene", "arcade")[1]


@pytest.mark.usefixtures("arcade")
@pytest.mark.parametrize(("columns", "details"), [(100, True), (80, False)])
def test_the_table_fits_a_terminal(columns, details, omnisim, monkeypatch):
    monkeypatch.setattr(Output, "is_terminal", True)
    monkeypatch.setattr(out.console, "_width", columns)
    lines = omnisim("scene", "arcade", "--all")[1].splitlines()
    header = next(number for number, line in enumerate(lines) if "reflects by" in line)
    assert max(len(line) for line in lines[header:]) <= columns
    assert ("textures" in lines[header]) is details
    assert any(line.startswith("chrome_ball_05") and line.endswith("probe") for line in lines)


def test_bounds_of_a_small_scene_have_digits(omnisim, tmp_path):
    trimesh.creation.box((0.02, 0.01, 0.001)).export(tmp_path / "small.stl")
    out = omnisim("scene", tmp_path / "small.stl")[1]
    assert "(-0.0100, -0.0050, -0.0005) to (0.0100, 0.0050, 0.0005) m" in out


@pytest.mark.parametrize(("y_m", "is_outside"), [(0.0, False), (-2500.0, True)])
def test_starts_outside_and_large_sizes_are_legible(omnisim, tmp_path, y_m, is_outside):
    trimesh.creation.box((6000, 4000, 2500.4)).export(tmp_path / "large.stl")
    start = f"[start]\nposition_m = [0.0, {y_m}, 1.0]\n"
    (tmp_path / "scene.toml").write_text(f'file = "large.stl"\n{start}')
    out = omnisim("scene", tmp_path / "scene.toml")[1]
    assert "6000×4000×2500" in out
    assert ("no floor, outside the bounds" in out) is is_outside
    assert ("outside the bounds" in out) is is_outside


def test_floors_are_where_the_flat_surfaces_are(omnisim, tmp_path):
    """Two slabs, of 16 and 4 m², whose undersides and sides are no floors."""
    scene = trimesh.Scene()
    for side, top in ((4.0, 0.0), (2.0, 1.5)):
        slab = trimesh.creation.box((side, side, 0.2))
        slab.apply_translation((0.0, 0.0, top - 0.1))
        scene.add_geometry(slab)
    scene.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0)))  # y up
    scene.export(tmp_path / "slabs.glb")
    floors = json.loads(omnisim("scene", tmp_path / "slabs.glb", "--json")[1])["floors"]
    assert [floor["height_m"] for floor in floors] == [0.0, 1.5]
    np.testing.assert_allclose([floor["area_m2"] for floor in floors], [16.0, 4.0], rtol=1e-5)


def test_the_plot_is_written(ran, tmp_path):
    pytest.importorskip("matplotlib")
    out, _ = ran("scene", "compass", "--plot", tmp_path / "map.png")
    assert f"{tmp_path / 'map.png'}: the scene from above" in out
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")


def test_textures_are_counted_once_with_all_maps(omnisim, tmp_path):
    rng = np.random.default_rng(0)
    images = [Image.fromarray(rng.integers(0, 256, (8, 8, 3), np.uint8)) for _ in range(2)]
    material = trimesh.visual.material.PBRMaterial(
        "look", baseColorTexture=images[0], metallicRoughnessTexture=images[1]
    )
    box = trimesh.creation.box()
    box.visual = trimesh.visual.TextureVisuals(np.zeros((8, 2)), material)
    (tmp_path / "a.glb").write_bytes(trimesh.Scene([box]).export(file_type="glb"))
    document = json.loads(omnisim("scene", tmp_path / "a.glb", "--json")[1])
    assert document == json.loads(omnisim("scene", "show", tmp_path / "a.glb", "--json")[1])
    assert document == json.loads(omnisim("scene", "--json", tmp_path / "a.glb")[1])
    assert (document["textures"], document["texture_bytes"]) == (2, 2 * 8 * 8 * 4)
    assert document["instances"][0]["textures_px"] == [[8, 8], [8, 8]]
    assert "2 textures 0.0 MB" in omnisim("scene", tmp_path / "a.glb")[1]
