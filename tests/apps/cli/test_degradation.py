"""Presets, seeds, motion, exposure and quality on the command line."""

import json

import numpy as np
import pytest

from omnisim.core.files.image_files import read_image
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.camera.quality import QUALITIES

RENDER = ("render", "rings", "--size", 40)
DRIVE = (
    "drive", "soccer", "--robot", "superscout", "--path", "lap_clockwise", "--size", 24, "--step",
    3, "--turn-step", 90, "-o", "run",
)  # fmt: skip


@pytest.fixture
def render(ran, tmp_path, needs_opengl):
    """Renders an image with options; returns its pixels and metadata."""

    def run(*options, output="a.png"):
        ran(*RENDER, "-o", output, *options)
        return read_image(tmp_path / output)

    return run


def test_render_with_a_preset_a_seed_and_a_motion(render):
    ideal, metadata = render("--preset", "ideal")
    np.testing.assert_array_equal(ideal, render()[0])
    assert "degradation" not in metadata
    noisy, metadata = render("--preset", "dragonfly2")
    assert metadata["degradation"]["sub_frames"] == 1
    assert metadata["degradation"]["noise"] == {"seed": 0, "frame_number": 0}
    assert np.mean(noisy != render("--preset", "dragonfly2", "--seed", 1)[0]) > 0.1
    moving, metadata = render("--preset", "dragonfly2", "--speed", 2, "--turn-rate", 300)
    assert metadata["degradation"]["sub_frames"] > 1
    assert np.mean(noisy != moving) > 0.1


def test_motion_without_exposure_time_is_noted(ran, needs_opengl):
    _, error = ran(*RENDER, "-o", "a.png", "--speed", 1)
    assert "exposure is instantaneous: motion has no effect" in error


@pytest.mark.parametrize("command", [RENDER, DRIVE[:-2]])
def test_unknown_presets_and_qualities_are_one_line(omnisim, refused, command):
    line = refused(*command, "-o", "a.png", "--preset", "web-cam")
    assert line == "preset 'web-cam': unknown preset; did you mean 'webcam'?"
    assert omnisim(*command, "-o", "a.png", "--quality", "fats") == (
        2, "",
        "error: --quality: expected one of fast, default, fine, got fats; did you mean 'fast'?\n",
    )  # fmt: skip


def test_an_exposure_replaces_the_camera_s(render):
    plain = render(output="a.exr")[0][..., :3]
    brighter, metadata = render("--exposure-ev", "1", output="a.exr")
    np.testing.assert_allclose(brighter[..., :3], 2.0 * plain, rtol=2e-3)  # half floats
    assert metadata["degradation"]["exposure"] == {"ev": 1.0, "metered_ev": 1.0}
    metered, _ = render("--exposure-ev", "auto", output="a.exr")
    seen = metered[..., :3][plain.any(axis=-1)]
    assert np.median(seen @ (0.2126, 0.7152, 0.0722)) == pytest.approx(0.18, rel=2e-3)
    _, metadata = render("--exposure-ev=-1.5", "--preset", "webcam", output="a.exr")
    assert metadata["degradation"]["exposure"]["ev"] == -1.5  # no longer automatic
    assert metadata["degradation"]["parameters"]["exposure"]["time_constant_s"] == 0.4


def test_the_quality_of_the_option_overrules_that_of_the_file(render, tmp_path):
    plain, fast = render()[0], render("--quality", "fast")[0]
    assert (fast != plain).any()
    (tmp_path / "fast.toml").write_text('[camera]\nquality = "fast"\n')
    np.testing.assert_array_equal(render("--sensor", "fast.toml")[0], fast)
    same = render("--sensor", "fast.toml", "--quality", "default")[0]
    np.testing.assert_array_equal(same, plain)


def test_a_run_keeps_its_quality(ran, refused, tmp_path, needs_opengl):
    ran(*DRIVE, "--quality", "fast")
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    assert manifest["sensors"]["omnicam"]["quality"] == QUALITIES["fast"]._asdict()
    used = OmniCamera.from_file(tmp_path / "run" / "omnicam" / "sensor.toml")
    assert (used.supersampling, used.texels_per_pixel) == QUALITIES["fast"]
    (tmp_path / "run" / "omnicam" / "000001.png").unlink()
    line = refused(*DRIVE)
    assert (
        "manifest.json: sensors.omnicam.quality.supersampling was 2, is 3: another run is" in line
    )
