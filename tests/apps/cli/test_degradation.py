"""Presets, seeds and motion on the command line."""

import numpy as np
import pytest

from omnisim.core.files.image_files import read_image

RENDER = ("render", "rings", "--size", 60)


@pytest.mark.usefixtures("needs_opengl")
def test_render_with_a_preset_a_seed_and_a_motion(omnisim, tmp_path):
    def pixels(*options):
        status, _, err = omnisim(*RENDER, "-o", "a.png", *options)
        assert status == 0, err
        return read_image(tmp_path / "a.png")

    ideal, metadata = pixels("--preset", "ideal")
    plain, _ = pixels()
    np.testing.assert_array_equal(ideal, plain)
    assert "degradation" not in metadata
    noisy, metadata = pixels("--preset", "dragonfly2")
    assert metadata["degradation"]["sub_frames"] == 1
    assert metadata["degradation"]["noise"] == {"seed": 0, "frame_number": 0}
    assert np.mean(noisy != pixels("--preset", "dragonfly2", "--seed", 1)[0]) > 0.1
    moving, metadata = pixels("--preset", "dragonfly2", "--speed", 2, "--turn-rate", 300)
    assert metadata["degradation"]["sub_frames"] > 1
    assert np.mean(noisy != moving) > 0.1


@pytest.mark.usefixtures("needs_opengl")
def test_motion_without_exposure_time_is_noted(omnisim, tmp_path):
    status, _, err = omnisim(*RENDER, "-o", "a.png", "--speed", 1)
    assert status == 0
    assert "exposure is instantaneous: motion has no effect" in err


def test_invalid_motions_are_refused(omnisim, tmp_path):
    for option, most in (("--speed", "10000"), ("--turn-rate", "57295")):
        for value in ("nan", "inf", "-1e+06"):
            status, _, err = omnisim(*RENDER, "-o", "a.png", f"{option}={value}")
            limits = f" from -{most} to {most}, such as {option} "
            assert (status, limits in err, f", got {value}\n" in err) == (2, True, True)


def test_unknown_presets_are_one_line(omnisim, tmp_path):
    for command in (RENDER, ("drive", "soccer", "--robot", "p2at", "--path", "lap")):
        status, _, err = omnisim(*command, "-o", "a.png", "--preset", "web-cam")
        assert status == 1
        assert err.strip().splitlines() == [
            "error: preset 'web-cam': unknown preset; did you mean 'webcam'?"
        ]
        assert not list(tmp_path.iterdir())


def test_sensor_check_lists_enabled_degradations(omnisim, tmp_path):
    (tmp_path / "s.toml").write_text("[degradation.noise]\nread_noise_e = 9\n")
    status, out, _ = omnisim("sensor", "--check", "s.toml")
    assert status == 0
    assert "noise" in out
    assert "read_noise_e = 9.0" in out


@pytest.mark.usefixtures("needs_opengl")
def test_an_exposure_replaces_the_camera_s(omnisim, tmp_path):
    def taken(*options):
        status, _, err = omnisim(*RENDER, "-o", "a.exr", *options)
        assert status == 0, err
        image, metadata = read_image(tmp_path / "a.exr")
        return image[..., :3], metadata

    plain, _ = taken()
    brighter, metadata = taken("--exposure-ev", "1")
    np.testing.assert_allclose(brighter, 2.0 * plain, rtol=2e-3)  # half floats
    assert metadata["degradation"]["exposure"] == {"ev": 1.0, "metered_ev": 1.0}
    metered, metadata = taken("--exposure-ev", "auto")
    seen = plain.any(axis=-1)
    assert np.median(metered[seen] @ (0.2126, 0.7152, 0.0722)) == pytest.approx(0.18, rel=2e-3)
    _, metadata = taken("--exposure-ev=-1.5", "--preset", "webcam")
    assert metadata["degradation"]["exposure"]["ev"] == -1.5  # no longer automatic
    assert metadata["degradation"]["parameters"]["exposure"]["time_constant_s"] == 0.4
