"""Fixed pattern: its files, its statistics, and the GPU's against the reference."""

import numpy as np
import pytest

from omnisim.core.errors import SensorFileError
from omnisim.core.files.image_files import write_channels
from omnisim.core.random_numbers import key_of
from omnisim.rendering.camera.degradations import Noise
from omnisim.rendering.camera.degradations.effect import Shot
from omnisim.rendering.camera.degradations.noise import (
    random_pattern,
    read_pattern,
    resampled,
    write_pattern,
)
from omnisim.rendering.camera.omnicamera import OmniCamera
from tests.rendering.camera.degradations.images import GEOMETRY, on_gpu, random_image

SHOT = Shot(exposure_s=0.02, noise_key=key_of("noise", 3), frame_number=7)


def _pattern(tmp_path):
    rng = np.random.default_rng(5)
    shape = GEOMETRY.height_px, GEOMETRY.width_px
    pattern = np.stack((rng.normal(0, 0.1, shape), rng.normal(0, 30.0, shape)), axis=-1)
    write_pattern(tmp_path / "pattern.exr", pattern.astype(np.float32))
    return tmp_path / "pattern.exr"


@pytest.mark.parametrize("is_measured", [False, True])
def test_the_gpu_equals_the_reference(context, tmp_path, is_measured):
    """Up to ties of rounding, as in `test_noise_equals_its_reference_but_for_ties`."""
    pattern = {"pattern": str(_pattern(tmp_path))} if is_measured else {"prnu": 0.1, "dsnu_e": 30.0}
    noise = Noise(full_well_e=5000.0, read_noise_e=2.0, black_level_dn=100.0, **pattern)
    image = random_image()
    drawn = on_gpu(context, [image], sensor=noise.steps(GEOMETRY, SHOT), uniforms={"u_frame": 7})
    expected = noise.apply(image, GEOMETRY, SHOT)
    step = noise.gain / noise.white_e
    assert np.abs(drawn - expected).max() <= (1.0 + 1.0 / noise.gain) * step + 1e-5
    assert np.mean(np.abs(drawn - expected) > 1e-5) < 0.002
    plain = Noise(full_well_e=5000.0, read_noise_e=2.0, black_level_dn=100.0)
    assert np.abs(plain.apply(image, GEOMETRY, SHOT) - expected).max() > 0.01


def test_a_measured_pattern_is_each_pixels(tmp_path):
    """Without other noise, a pixel's value is its light times its gain, plus its dark signal."""
    path = _pattern(tmp_path)
    pattern = read_pattern(path)
    noise = Noise(
        full_well_e=1e6, gain_e_per_dn=1.0, read_noise_e=0.0, black_level_dn=200.0, bit_depth=16,
        pattern=str(path),
    )  # fmt: skip
    image = np.ones((GEOMETRY.height_px, GEOMETRY.width_px, 4), dtype=np.float32)
    image[..., :3] = 0.5
    frames = [
        noise.apply(image, GEOMETRY, Shot(noise_key=SHOT.noise_key, frame_number=number))[..., 0]
        for number in range(20)
    ]
    mean_e = np.mean(frames, axis=0) * noise.white_e
    light_e = 0.5 * noise.white_e
    expected_e = light_e * (1.0 + pattern[..., 0]) + pattern[..., 1]
    sigma_e = np.sqrt(light_e * 1.5 / 20.0)  # shot noise of the mean of 20 frames
    assert np.abs(mean_e - expected_e).max() < 6.0 * sigma_e


def test_a_random_pattern_has_its_standard_deviations():
    pattern = random_pattern(400, 300, 0.01, 5.0, 3)
    sigma = 1.0 / np.sqrt(2.0 * 400 * 300)  # of a standard deviation, relative
    for channel, true in ((0, 0.01), (1, 5.0)):
        assert pattern[..., channel].std() == pytest.approx(true, rel=5.0 * sigma)
        assert abs(pattern[..., channel].mean()) < 5.0 * true / np.sqrt(400 * 300)
    assert abs(np.corrcoef(pattern.reshape(-1, 2).T)[0, 1]) < 5.0 / np.sqrt(400 * 300)
    other = random_pattern(400, 300, 0.01, 5.0, 4)
    assert not np.array_equal(pattern, other)


def test_another_size_takes_the_nearest_pixels():
    pattern = np.arange(24.0, dtype=np.float32).reshape(3, 4, 2)
    assert resampled(pattern, 4, 3) is pattern
    np.testing.assert_array_equal(resampled(pattern, 8, 6)[::2, ::2], pattern)
    np.testing.assert_array_equal(resampled(pattern, 2, 1), pattern[1:2, 1::2])


def test_a_file_is_found_beside_the_sensor_file(tmp_path):
    path = _pattern(tmp_path)
    (tmp_path / "sensor.toml").write_text("[degradation.noise]\npattern = 'pattern.exr'\n")
    sensor = OmniCamera.from_file(tmp_path / "sensor.toml")
    assert sensor.degradation.noise.pattern == str(path)
    (tmp_path / "again.toml").write_text(sensor.to_toml())
    assert OmniCamera.from_file(tmp_path / "again.toml").degradation == sensor.degradation


@pytest.mark.parametrize(
    ("channels", "message"),
    [
        ({"prnu": np.zeros((2, 2))}, "expected the channels prnu and dsnu_e, got prnu"),
        ({"prnu": np.full((2, 2), np.nan), "dsnu_e": np.zeros((2, 2))}, "expected finite numbers"),
        ({"prnu": np.full((2, 2), -1.5), "dsnu_e": np.zeros((2, 2))}, "prnu of at least -1"),
    ],
)
def test_other_files_are_refused(tmp_path, channels, message):
    write_channels(tmp_path / "pattern.exr", channels)
    with pytest.raises(SensorFileError, match=message):
        read_pattern(tmp_path / "pattern.exr")


def test_damaged_files_are_refused(tmp_path):
    (tmp_path / "broken.exr").write_bytes(b"no EXR")
    with pytest.raises(SensorFileError, match=r"broken\.exr: cannot be read"):
        Noise(pattern=str(tmp_path / "broken.exr"))  # before anything is rendered
