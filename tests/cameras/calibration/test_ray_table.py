"""Ray tables: written, read back, and broken."""

import numpy as np
import pytest

from omnisim.cameras import pixel_grid
from omnisim.cameras.calibration.ray_table import read_ray_table, write_ray_table
from omnisim.core.errors import OutputError
from omnisim.core.files.image_files import read_channels, write_channels
from tests.camera_examples import CAMERA_EXAMPLES

FLOAT = np.finfo(np.float32).eps


@pytest.mark.parametrize("name", ["hyperbolic-paper", "unified-kitti-360", "equirectangular-odd"])
def test_table_is_the_camera(tmp_path, name):
    camera = CAMERA_EXAMPLES[name]
    write_ray_table(tmp_path / "rays.exr", camera, {"scene": "a"})
    table = read_ray_table(tmp_path / "rays.exr")
    rays = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px))
    np.testing.assert_array_equal(table.valid, rays.valid)
    assert np.abs(table.directions - rays.directions).max() <= FLOAT
    assert not table.origins_m.any()
    assert table.metadata["camera"] == camera.parameters()
    assert table.metadata["scene"] == "a"
    attributes = read_channels(tmp_path / "rays.exr").attributes
    assert attributes["omnisim:frame"].startswith("optical: x right, y down")


def test_what_is_no_ray_table_is_named(tmp_path):
    path = tmp_path / "a.exr"
    write_channels(path, {"Z": np.ones((3, 4))})
    with pytest.raises(OutputError, match=r"a\.exr: .* a channel direction\.X, got Z"):
        read_ray_table(path)
    names = [f"{name}.{axis}" for name in ("direction", "origin") for axis in "XYZ"]
    write_channels(path, {name: np.full((3, 4), 0.9) for name in (*names, "valid")})
    with pytest.raises(OutputError, match="unit vectors where valid is 1, got an error of"):
        read_ray_table(path)
    with pytest.raises(OutputError, match=r"expected a name that ends in \.exr"):
        write_ray_table(tmp_path / "a.png", CAMERA_EXAMPLES["perspective"])
