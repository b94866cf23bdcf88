"""`omnisim measure timing`: the shutter of a simulated camera."""

import json

import pytest

from omnisim.apps.cli.measure.measured_files import round_to_sigma
from omnisim.core.files.image_files import write_numbers
from omnisim.rendering.camera.omnicamera import OmniCamera
from tests.measurement.timing.test_flicker import lit_frames

NOISE = {"name": "read_noise_e", "value": 7.0, "sigma": 0.1, "unit": "e-", "basis": "a test"}


def test_values_have_the_digits_of_their_standard_deviation():
    assert round_to_sigma(3.14159, 0.02) == 3.142
    assert round_to_sigma(31415.9, 200.0) == 31420.0
    assert round_to_sigma(3.14159265, 0.0) == 3.14159


@pytest.fixture
def timing(tmp_path):
    """Command that measures simulated frames under a flickering lamp."""
    (tmp_path / "frames").mkdir()
    for number, frame in enumerate(lit_frames(0.0301, 0.004)):
        write_numbers(tmp_path / "frames" / f"{number}.png", frame)
    return ("measure", "timing", "frames", "--flicker", 100, "-o", "camera.toml")


def test_readout_and_exposure_are_written(ran, timing, tmp_path):
    out, err = ran(*timing, "--modulation", 0.4)
    shutter = OmniCamera.from_file(tmp_path / "camera.toml").degradation.shutter
    assert shutter.readout_s == pytest.approx(0.0301, rel=0.01)
    assert shutter.exposure_s == pytest.approx(0.004, rel=0.03)
    assert "readout_direction not measured" in err
    assert "line_s" in out


def test_parts_add_to_one_sensor_file_and_report(ran, refused, timing, tmp_path):
    report = {"noise": {"quantities": [NOISE], "not_measured": []}}
    (tmp_path / "camera.json").write_text(json.dumps(report))
    (tmp_path / "camera.toml").write_text("[degradation.noise]\nread_noise_e = 7.0\n")
    ran(*timing, "--sensor", "camera.toml")
    degradation = OmniCamera.from_file(tmp_path / "camera.toml").degradation
    assert degradation.noise.read_noise_e == 7.0
    assert degradation.shutter.readout_s == pytest.approx(0.0301, rel=0.01)
    assert "# noise: read_noise_e = 7 ± 0.1 e-" in (tmp_path / "camera.toml").read_text()
    assert set(json.loads((tmp_path / "camera.json").read_text())) == {"noise", "timing"}
    (tmp_path / "camera.json").write_text("[1]")
    line = refused(*timing, "--sensor", "camera.toml")
    assert "camera.json: expected a report of `omnisim measure`" in line
