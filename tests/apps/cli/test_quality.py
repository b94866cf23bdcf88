"""`--quality` of `omnisim render` and `omnisim drive`."""

import json

import numpy as np
import pytest

from omnisim.core.files.image_files import read_image
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.camera.quality import QUALITIES

RENDER = ("render", "rings", "--size", 60)
DRIVE = (
    "drive", "soccer", "--robot", "superscout", "--path", "lap_clockwise", "--size", 32, "--step",
    2, "--turn-step", 90, "-o", "run",
)  # fmt: skip


@pytest.mark.usefixtures("needs_opengl")
def test_render_with_a_quality(omnisim, tmp_path):
    def pixels(*options):
        status, _, err = omnisim(*RENDER, "-o", "a.png", *options)
        assert status == 0, err
        return read_image(tmp_path / "a.png")[0]

    plain, fast = pixels(), pixels("--quality", "fast")
    np.testing.assert_array_equal(pixels("--quality", "default"), plain)
    assert (fast != plain).any()
    (tmp_path / "fast.toml").write_text('[camera]\nquality = "fast"\n')
    np.testing.assert_array_equal(pixels("--sensor", "fast.toml"), fast)
    # the option overrules the file
    np.testing.assert_array_equal(pixels("--sensor", "fast.toml", "--quality", "default"), plain)


@pytest.mark.parametrize("command", [(*RENDER, "-o", "a.png"), DRIVE])
def test_unknown_quality_is_one_line(omnisim, tmp_path, command):
    status, out, error = omnisim(*command, "--quality", "fats")
    assert (status, out) == (2, "")
    assert error == (
        "error: --quality: expected one of fast, default, fine, got fats; did you mean 'fast'?\n"
    )
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("needs_opengl")
def test_a_run_keeps_its_quality(omnisim, tmp_path):
    assert omnisim(*DRIVE, "--quality", "fast")[0] == 0
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    assert manifest["sensors"]["omnicam"]["quality"] == QUALITIES["fast"]._asdict()
    used = OmniCamera.from_file(tmp_path / "run" / "omnicam" / "sensor.toml")
    assert (used.supersampling, used.texels_per_pixel) == QUALITIES["fast"]
    (tmp_path / "run" / "omnicam" / "000001.png").unlink()
    status, _, error = omnisim(*DRIVE)
    assert status == 1
    assert (
        "manifest.json: sensors.omnicam.quality.supersampling was 2, is 3: another run is" in error
    )
    assert not (tmp_path / "run" / "omnicam" / "000001.png").exists()
