"""`omnisim measure timing`: the shutter of a simulated camera."""

import json

import pytest

from omnisim.core.files.image_files import write_numbers
from omnisim.rendering.camera.omnicamera import OmniCamera
from tests.measurement.timing.test_flicker import lit_frames

NOISE = {"name": "read_noise_e", "value": 7.0, "sigma": 0.1, "unit": "e-", "basis": "a test"}


def test_readout_and_exposure_are_written(omnisim, tmp_path):
    (tmp_path / "frames").mkdir()
    for number, frame in enumerate(lit_frames(0.0301, 0.004)):
        write_numbers(tmp_path / "frames" / f"{number}.png", frame)
    options = ("--flicker", 100, "--modulation", 0.4, "-o", "camera.toml")
    status, out, err = omnisim("measure", "timing", tmp_path / "frames", *options)
    assert status == 0, err
    shutter = OmniCamera.from_file(tmp_path / "camera.toml").degradation.shutter
    assert shutter.readout_s == pytest.approx(0.0301, rel=0.01)
    assert shutter.exposure_s == pytest.approx(0.004, rel=0.03)
    assert "readout_direction not measured" in err
    assert "line_s" in out


def test_parts_add_to_one_sensor_file_and_report(omnisim, tmp_path):
    (tmp_path / "frames").mkdir()
    for number, frame in enumerate(lit_frames(0.0301, 0.004)):
        write_numbers(tmp_path / "frames" / f"{number}.png", frame)
    report = {"noise": {"quantities": [NOISE], "not_measured": []}}
    (tmp_path / "camera.json").write_text(json.dumps(report))
    (tmp_path / "camera.toml").write_text("[degradation.noise]\nread_noise_e = 7.0\n")
    options = ("--flicker", 100, "--sensor", "camera.toml", "-o", "camera.toml")
    status, _, err = omnisim("measure", "timing", tmp_path / "frames", *options)
    assert status == 0, err
    degradation = OmniCamera.from_file(tmp_path / "camera.toml").degradation
    assert degradation.noise.read_noise_e == 7.0
    assert degradation.shutter.readout_s == pytest.approx(0.0301, rel=0.01)
    assert "# noise: read_noise_e = 7 ± 0.1 e-" in (tmp_path / "camera.toml").read_text()
    assert set(json.loads((tmp_path / "camera.json").read_text())) == {"noise", "timing"}
    (tmp_path / "camera.json").write_text("[1]")
    status, _, err = omnisim("measure", "timing", tmp_path / "frames", *options)
    assert status == 1
    assert "camera.json: expected a report of `omnisim measure`" in err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "timing: expected either --flicker HZ or --board BOARD"),
        (
            ["--flicker", 100, "--board", "8x6:30mm"],
            "timing: expected either --flicker HZ or --board BOARD",
        ),
        (["--board", "8x6:30mm"], "--board: expected --sensor with the measured camera model"),
        (["--board", "8x6:30mm", "--sensor", "c.toml"], "--board: expected --frame-rate HZ"),
    ],
)
def test_options_that_contradict_each_other_are_refused(omnisim, tmp_path, arguments, message):
    (tmp_path / "c.toml").write_text("")
    status, _, error = omnisim("measure", "timing", "frames", *arguments, "-o", "camera.toml")
    assert (status, error) == (1, f"error: {message}\n")
