"""`omnisim measure timing`: the shutter of a simulated camera."""

import pytest

from omnisim.core.files.image_files import write_numbers
from omnisim.rendering.camera.omnicamera import OmniCamera
from tests.measurement.timing.test_flicker import lit_frames


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
