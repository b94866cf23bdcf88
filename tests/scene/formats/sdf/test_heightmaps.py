"""Terrains of images."""

import numpy as np
import pytest
from PIL import Image

from omnisim.core.errors import SceneError
from tests.scene.formats.sdf.worlds import load, model, sdf, visual
from tests.scene.world_corners import points_of

# a ramp along x, and a corner at the smallest x and the largest y
LEVELS = np.array([[255, 102, 204], [0, 102, 204], [0, 102, 204]], np.uint8)
SIZE = "<size>4 2 10</size>"


def terrain(tmp_path, rest=SIZE, levels=LEVELS):
    Image.fromarray(levels).save(tmp_path / "map.png")
    text = f"<heightmap><uri>map.png</uri>{rest}</heightmap>"
    return load(tmp_path, sdf(model("m", visual(text))))


@pytest.mark.parametrize("levels", [LEVELS, LEVELS.astype(np.uint16) * 257])
def test_levels_are_heights_and_the_first_row_is_at_the_largest_y(tmp_path, levels):
    points = points_of(terrain(tmp_path, f"{SIZE}<pos>1 0 2</pos>", levels)).reshape(3, 3, 3)
    assert points[:, :, 0] == pytest.approx(np.tile((-1.0, 1.0, 3.0), (3, 1)))
    assert points[:, :, 1] == pytest.approx(np.tile((-1.0, 0.0, 1.0), (3, 1)).T)
    assert points[:, :, 2] == pytest.approx(np.flipud(LEVELS) / 25.5 + 2.0, abs=1e-5)


def test_its_front_is_above_and_the_brightest_pixel_has_the_height(tmp_path):
    scene = terrain(tmp_path, levels=np.array([[0, 50], [0, 100]], np.uint8))
    assert points_of(scene)[:, 2].max() == pytest.approx(10.0)
    mesh = scene.meshes[0]
    a, b, c = mesh.positions[mesh.triangles].swapaxes(0, 1)
    assert (np.cross(b - a, c - a)[:, 2] > 0.0).all()
    assert (mesh.normals[:, 2] > 0.0).all()


def layer(color, size):
    return f"<texture><diffuse>{color}.png</diffuse><size>{size}</size></texture>"


def test_textures_change_with_the_height(tmp_path):
    for name, color in (("red", (255, 0, 0)), ("blue", (0, 0, 255))):
        Image.new("RGB", (4, 4), color).save(tmp_path / f"{name}.png")
    blend = "<blend><min_height>3</min_height><fade_dist>2</fade_dist></blend>"
    ramp = np.tile(np.linspace(0, 255, 64).astype(np.uint8), (64, 1))
    scene = terrain(tmp_path, f"{SIZE}{layer('red', 1)}{layer('blue', 2)}{blend}", ramp)
    row = scene.materials[0].texture.pixels[100]
    share = np.linspace(0, 1, len(row))
    assert (row[share < 0.28] == (255, 0, 0, 255)).all()
    assert (row[share > 0.52] == (0, 0, 255, 255)).all()
    assert int(row[int(0.4 * len(row)), 0]) == pytest.approx(127, abs=8)


def test_a_terrain_without_width_is_refused(tmp_path):
    for name in ("red", "blue"):
        Image.new("RGB", (4, 4)).save(tmp_path / f"{name}.png")
    with pytest.raises(SceneError, match="expected a width and depth > 0"):
        terrain(tmp_path, f"<size>0 2 10</size>{layer('red', 1)}{layer('blue', 2)}")


def test_one_texture_is_repeated(tmp_path):
    Image.new("RGB", (4, 4)).save(tmp_path / "red.png")
    scene = terrain(tmp_path, f"{SIZE}{layer('red', 0.5)}")
    assert np.ptp(scene.meshes[0].texture_coordinates, axis=0) == pytest.approx((8.0, 4.0))


def test_a_large_map_is_thinned_out(tmp_path):
    scene = terrain(tmp_path, levels=np.zeros((9, 2049), np.uint8))
    assert scene.triangle_count == 2 * 8 * 512


def test_an_elevation_model_is_noted(tmp_path):
    Image.fromarray(np.ones((4, 4), np.float32)).save(tmp_path / "dem.tif")
    text = "<heightmap><uri>dem.tif</uri></heightmap>"
    with pytest.raises(SceneError, match=r"heightmap dem\.tif is not drawn: no gray image"):
        load(tmp_path, sdf(model("m", visual(text))))
