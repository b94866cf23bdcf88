"""`omnisim render --calibration` and `--rays`: files and errors."""

import json
from pathlib import Path

import numpy as np
import pytest

from omnisim.cameras import pixel_grid
from omnisim.cameras.calibration import find_pose, load_calibration
from omnisim.cameras.calibration.ray_table import read_ray_table
from omnisim.core.files.image_files import read_image

SENSOR = """
[lens]
model = "equidistant"
width_px = 64
height_px = 48
focal_length_px = 18.0
principal_point_px = [31.5, 23.5]
theta_max_deg = 80
[lens.mounting]
position_m = [0.2, 0.0, 0.9]
pitch_deg = -10
"""


@pytest.mark.usefixtures("needs_opengl")
def test_render_writes_calibration_and_rays(ran, tmp_path):
    (tmp_path / "s.toml").write_text(SENSOR)
    out, _ = ran(
        "render", "courtyard", "-o", "a.png", "--sensor", "s.toml", "--yaw", 30,
        "--rays", "rays.exr", "--calibration", "calib.json",
    )  # fmt: skip
    assert "rays.exr: the ray of each pixel" in out
    _, metadata = read_image(tmp_path / "a.png")
    said = load_calibration(Path("calib.json")).cameras[0]
    assert said.camera.parameters() == metadata["camera"]
    world_from_optical = find_pose(said.poses, "world", "camera")
    np.testing.assert_allclose(world_from_optical, metadata["world_from_optical"], atol=1e-12)
    table = read_ray_table(Path("rays.exr"))
    rays = said.camera.ray_from_pixel(pixel_grid(64, 48))
    np.testing.assert_array_equal(table.valid, rays.valid)
    np.testing.assert_allclose(table.directions, rays.directions, atol=1e-7)
    assert table.metadata["world_from_optical"] == metadata["world_from_optical"]
    json.loads((tmp_path / "calib.json").read_text())
