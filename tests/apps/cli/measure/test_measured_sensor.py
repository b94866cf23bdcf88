"""A sensor file with all that can be measured: images by both back ends, and the live page."""

import numpy as np
import pytest

from omnisim.apps.live.camera_document import CameraDocument
from omnisim.core.files.image_files import read_image
from omnisim.rendering.camera.degradations.noise import random_pattern, write_pattern

MEASURED = """
[lens]
model = "kannala_brandt"
width_px = 64
height_px = 48
focal_lengths_px = [20.5, 20.6]
principal_point_px = [32.2, 23.4]
coefficients = [0.012, -0.008, 0.002, -0.0005]
theta_max_deg = 95.0
[degradation.point_spread]
widths_px = [[4.0, 0.5, 0.5], [24.0, 0.7, 0.6]]
[degradation.chromatic_aberration]
red_offsets_px = [0.1, 0.05]
blue_offsets_px = [-0.1, -0.05]
[degradation.vignetting]
coefficients = [-0.3, 0.1, -0.05, 0.02]
[degradation.shutter]
exposure_s = 0.004
readout_s = 0.016
[degradation.noise]
full_well_e = 12000.0
gain_e_per_dn = 3.1
read_noise_e = 6.5
dark_current_e_per_s = 900.0
black_level_dn = 40.0
bit_depth = 12
pattern = "camera-pattern.exr"
[degradation.encoding]
gamma = 2.2
"""


@pytest.fixture
def sensor(tmp_path):
    write_pattern(tmp_path / "camera-pattern.exr", random_pattern(64, 48, 0.02, 5.0, 1))
    path = tmp_path / "camera.toml"
    path.write_text(MEASURED)
    return path


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["cube", "rays"])
def test_it_takes_images(ran, sensor, backend):
    options = ("--sensor", sensor, "--backend", backend, "--turn-rate", 60, "-o", "a.png")
    ran("render", "courtyard", *options)
    assert read_image(sensor.with_name("a.png"))[0].std() > 10.0


def test_it_is_shown_on_the_live_page(sensor):
    document = CameraDocument.of_sensor_file(sensor)
    camera = document.camera()
    assert camera.degradation.noise.pattern is not None
    assert np.isclose(camera.degradation.shutter.readout_s, 0.016)
    changed = document.with_value("sensor.degradation.shutter.readout_s", 0.02)
    assert np.isclose(changed.camera().degradation.shutter.readout_s, 0.02)
