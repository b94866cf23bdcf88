"""The scenes that ship: they load, are what their scripts build, and show what they promise."""

import importlib
import re

import numpy as np
import pytest
import trimesh

from omnisim.scene import builtin_scenes, load_scene
from tests.same_shapes import assert_same_shapes
from tests.scene.builder_hashes import SCENES, is_recorded
from tests.scene.world_corners import corners_of, material_of
from tests.slow import slow_but


@pytest.mark.parametrize("name", builtin_scenes())
def test_builtin_scenes_load_without_notices(name):
    scene = load_scene(name)
    assert scene.triangle_count > 0
    assert scene.notices == ()
    low, high = scene.bounds_m()
    assert np.all(low <= scene.start.position_m)
    assert np.all(scene.start.position_m <= high)


@pytest.mark.parametrize("name", slow_but(builtin_scenes(), "rings", "compass", "soccer"))
def test_committed_file_is_what_a_changed_builder_builds(name, tmp_path, monkeypatch):
    if not is_recorded(name):
        test_committed_file_is_what_the_builder_builds(name, tmp_path, monkeypatch)


@pytest.mark.parametrize("name", slow_but(builtin_scenes(), long=["arcade", "mapping"]))
def test_committed_file_is_what_the_builder_builds(name, tmp_path, monkeypatch):
    pytest.importorskip("scenes", reason="the scripts are not installed")
    script = importlib.import_module(f"scenes.{name}.build")
    monkeypatch.setattr(script, "OUTPUT", tmp_path / script.OUTPUT.name)
    script.main()
    built, committed = load_scene(script.OUTPUT), load_scene(name)
    assert_same_shapes(built, committed)
    for mine, theirs in zip(built.materials, committed.materials, strict=True):
        for key in ("name", "base_color", "unlit"):
            assert getattr(mine, key) == getattr(theirs, key)
        assert (mine.texture is None) == (theirs.texture is None)
        if mine.texture is not None:
            # versions of Pillow round a JPEG or the edge of a stroke differently
            off = np.abs(mine.texture.pixels.astype(int) - theirs.texture.pixels)
            assert off.mean() < 0.5


def inward(corners, viewpoint):
    """Cosine between each triangle's front and the way to the viewpoint."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    ways = viewpoint - corners.mean(axis=1)
    lengths = np.linalg.norm(normals, axis=1) * np.linalg.norm(ways, axis=1)
    return np.einsum("ij,ij->i", normals, ways) / lengths


def test_rings_are_at_the_stated_angles():
    scene, spans_deg = load_scene("rings"), {}
    for node in scene.instance_names:
        offsets = corners_of(scene, node) - (0, 0, 2)
        # twice the vertices' rounding to 0.01 mm
        np.testing.assert_allclose(np.linalg.norm(offsets, axis=2), 2.0, rtol=0, atol=2e-5)
        x, y, z = np.moveaxis(offsets, -1, 0)
        theta_deg = np.degrees(np.arctan2(np.hypot(x, y), -z))
        ends = np.stack((theta_deg.min(axis=1), theta_deg.max(axis=1)), axis=1)
        assert np.abs(ends - np.round(ends, 1)).max() < 5e-4  # the same rounding at 2 m
        spans_deg[node] = {tuple(span) for span in np.round(ends, 1).tolist()}
    lines = {(round(t - 0.3, 1), round(t + 0.3, 1)) for t in range(5, 180, 5)}
    assert spans_deg["horizon"] == {(89.7, 90.3)}
    assert spans_deg["lines"] == lines - spans_deg["horizon"]
    ends = [0.0, *sorted(end for line in lines for end in line), 180.0]
    assert spans_deg["sphere"] == set(zip(ends[::2], ends[1::2], strict=True))


def test_rings_are_closed_and_face_their_center():
    scene = load_scene("rings")
    np.testing.assert_array_equal(scene.start.position_m, (0, 0, 2))
    corners = corners_of(scene)
    assert inward(corners, scene.start.position_m).min() > 0.99
    sphere = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3))
    sphere.merge_vertices(digits_vertex=12)  # neighbors are equal, bit by bit
    assert sphere.is_watertight
    assert sphere.is_winding_consistent
    assert sphere.euler_number == 2  # one sphere, and no more
    assert all(scene.materials[mesh.material].unlit for mesh in scene.meshes)
    colors = {"sphere": (1, 1, 1), "lines": (0, 0, 0), "horizon": (0.8, 13 / 255, 13 / 255)}
    for name, color in colors.items():
        np.testing.assert_allclose(material_of(scene, name).base_color[:3], color)


EAST, NORTH, UP = np.eye(3)
# where the side's middle is, the way to the right of its word and up from it
COMPASS = {
    "north": (3 * NORTH + 1.5 * UP, EAST, UP),
    "east": (3 * EAST + 1.5 * UP, -NORTH, UP),
    "south": (-3 * NORTH + 1.5 * UP, -EAST, UP),
    "west": (-3 * EAST + 1.5 * UP, NORTH, UP),
    "up": (3 * UP, -EAST, NORTH),
    "down": (0 * UP, EAST, NORTH),
}


def test_sides_of_the_compass_match_their_names():
    scene = load_scene("compass")
    assert set(scene.instance_names) == COMPASS.keys()
    for instance in scene.instances:
        middle, right, up = COMPASS[instance.name]
        points, mesh = corners_of(scene, instance.name), scene.meshes[instance.mesh]
        assert inward(points, scene.start.position_m).min() > 0
        u, v = np.moveaxis(mesh.texture_coordinates[mesh.triangles], -1, 0)
        height = 3.0 if up is UP else 6.0
        expected = middle + 6 * (u - 0.5)[..., None] * right - height * (v - 0.5)[..., None] * up
        np.testing.assert_allclose(points, expected, atol=1e-6)


def test_colors_of_the_compass_are_those_in_its_readme():
    scene = load_scene("compass")
    readme = (SCENES / "compass" / "README.md").read_text(encoding="utf-8")
    for instance in scene.instances:
        material = material_of(scene, instance.name)
        assert material.unlit
        assert material.base_color == (1.0, 1.0, 1.0, 1.0)
        row = re.search(rf"^\| `{instance.name}` .*\| (.*) \| (.*) \|$", readme, re.MULTILINE)
        ground = np.array(row[1].split(", "), dtype=int)
        image = material.texture.pixels
        # in the first field of the grid, 0.25 m from two edges; and the border
        np.testing.assert_array_equal(image[75, 75, :3], ground)
        np.testing.assert_array_equal(image[4, 4, :3], (255, 255, 255))
        linear = np.array(row[2].split(", "), dtype=float)
        decoded = np.where(
            ground > 10, ((ground / 255 + 0.055) / 1.055) ** 2.4, ground / 255 / 12.92
        )
        np.testing.assert_allclose(linear, decoded, atol=5e-5)  # four decimals
