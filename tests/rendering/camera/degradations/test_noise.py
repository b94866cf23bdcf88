"""Noise by its statistics, and fixed patterns: files, statistics, and the GPU's."""

import numpy as np
import pytest
from scipy import stats

from omnisim.core.errors import SensorFileError
from omnisim.core.files.image_files import write_channels
from omnisim.core.random_numbers import key_of, normal, pcg4d, uniform
from omnisim.rendering.camera.degradations import Noise
from omnisim.rendering.camera.degradations.effect import Shot
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.rendering.camera.degradations.noise import (
    poisson,
    random_pattern,
    read_pattern,
    resampled,
    write_pattern,
)
from omnisim.rendering.camera.omnicamera import OmniCamera
from tests.rendering.camera.degradations.images import GEOMETRY, flat_image, on_gpu, random_image

KEY = key_of("noise", 0)


def _hashes(count, key=KEY):
    return pcg4d(np.arange(count), 0, 0, key)


def _noisy(context, noise, image, frame=0, key=KEY):
    geometry = ImageGeometry(image.shape[1], image.shape[0], (0.0, 0.0))
    steps = noise.steps(geometry, Shot(exposure_s=0.01, noise_key=key))
    return on_gpu(context, [image], sensor=steps, uniforms={"u_frame": frame})[..., :3]


def test_photon_transfer_curve_has_the_specified_gain(context):
    """Variance against mean, in steps of the converter: slope 1/gain, and read noise at no light.

    Each of 14 flat fields has 49 152 independent values, so its variance is known to 0.64 %
    (√(2/n)), the slope of the weighted line to 0.2 % and the read noise to 0.4 %: 2 % is five
    standard deviations.
    """
    noise = Noise(
        full_well_e=30_000.0,
        gain_e_per_dn=2.5,
        read_noise_e=12.0,
        dark_current_e_per_s=0.0,
        black_level_dn=100.0,
        bit_depth=12,
    )
    levels = np.concatenate(((0.0,), np.geomspace(0.005, 0.8, 13)))
    drawn = _noisy(context, noise, flat_image(levels)) * noise.white_e / noise.gain
    fields = drawn.reshape(len(levels), -1).astype(np.float64)
    mean, variance = fields.mean(axis=1), fields.var(axis=1)
    slope, intercept = np.polyfit(mean, variance, 1, w=1.0 / variance)
    assert slope == pytest.approx(1.0 / noise.gain, rel=0.02)
    # rounding to whole steps adds a twelfth
    read_noise_e = np.sqrt(intercept - 1.0 / 12.0) * noise.gain
    assert read_noise_e == pytest.approx(noise.read_noise_e, rel=0.02)
    residual = variance / (slope * mean + intercept) - 1.0
    assert np.abs(residual).max() < 4.5 * np.sqrt(2.0 / fields.shape[1])  # a line, nothing else
    mean_e = mean * noise.gain
    expected_e = levels * noise.white_e
    deviations = np.sqrt((expected_e + 12.0**2 + 2.5**2 / 12.0) / fields.shape[1])
    assert np.all(np.abs(mean_e - expected_e) < 4.5 * deviations)


def test_bright_light_saturates_and_dark_current_is_subtracted(context):
    noise = Noise(
        full_well_e=1000.0,
        read_noise_e=0.0,
        dark_current_e_per_s=5000.0,
        black_level_dn=0.0,
        bit_depth=8,
    )
    drawn = _noisy(context, noise, flat_image([0.0, 0.5, 40.0]))
    dark, middle, white = drawn.reshape(3, -1)
    assert np.unique(white).size == 1
    assert white[0] == pytest.approx(1.0 - 50.0 / 1000.0)  # 5000 e⁻/s for 0.01 s
    assert dark.mean() == pytest.approx(0.0, abs=4.5 * np.sqrt(50.0 + 1.3) / 1000.0 / 200.0)
    assert middle.mean() == pytest.approx(0.5, abs=4.5 * np.sqrt(550.0 + 1.3) / 1000.0 / 200.0)


@pytest.mark.parametrize("mean", [0.05, 0.7, 4.0, 31.9])
def test_small_means_are_poisson_exactly(mean):
    """Chi-square over all numbers that are expected at least 10 times; p = 1e-4 each."""
    count = 200_000
    hashes = _hashes(count)
    drawn = poisson(np.full(count, mean, np.float32), hashes[0], hashes[1]).astype(int)
    numbers = np.arange(0, 200)
    expected = count * stats.poisson.pmf(numbers, mean)
    first, last = np.flatnonzero(expected >= 10)[[0, -1]]
    seen = np.bincount(np.clip(drawn, first, last), minlength=last + 1)[first:]
    wanted = expected[first : last + 1].copy()
    wanted[0] = count * stats.poisson.cdf(first, mean)
    wanted[-1] = count * stats.poisson.sf(last - 1, mean)
    assert stats.chisquare(seen, wanted * seen.sum() / wanted.sum()).pvalue > 1e-4
    assert drawn.max() < 100  # no stray from the sum's end


@pytest.mark.parametrize("mean", [32.0, 100.0])
def test_large_means_are_poisson_within_the_bound(mean):
    count = 300_000
    hashes = _hashes(count)
    drawn = np.sort(poisson(np.full(count, mean, np.float32), hashes[0], hashes[1]))
    numbers = np.arange(max(0, int(mean - 6 * mean**0.5)), int(mean + 6 * mean**0.5))
    share = np.searchsorted(drawn, numbers, side="right") / count
    away = np.abs(share - stats.poisson.cdf(numbers, mean)).max()
    # what noise.py states, and what chance adds once in a thousand times (Kolmogorov)
    assert away < 4.1e-4 * 32.0 / mean + 1.95 / np.sqrt(count)


def test_random_numbers_are_uniform_and_normal():
    hashes = _hashes(400_000)
    for part in hashes:
        assert stats.kstest(uniform(part), "uniform").pvalue > 1e-4
    assert 0.0 < uniform(np.uint32(0)) < uniform(np.uint32(2**32 - 1)) < 1.0
    assert stats.kstest(normal(hashes[0], hashes[1]), "norm").pvalue > 1e-4


def test_noise_has_no_pattern(context):
    """Between neighbors, colors and frames nothing is correlated, and no frequency stands out."""
    noise = Noise(
        full_well_e=20_000.0,
        read_noise_e=5.0,
        dark_current_e_per_s=0.0,
        black_level_dn=50.0,
        bit_depth=14,
    )
    frames = [
        _noisy(context, noise, flat_image([0.4], 256, 256), frame).astype(np.float64)
        for frame in range(2)
    ]
    first, second = (frame - frame.mean(axis=(0, 1)) for frame in frames)
    first, second = first / first.std(axis=(0, 1)), second / second.std(axis=(0, 1))
    most = 4.5 / 256.0  # standard deviations of a correlation of 256² pairs
    for right, down in [(1, 0), (0, 1), (1, 1), (2, 0), (0, 2), (4, 0), (0, 8), (16, 16), (64, 0)]:
        moved = np.roll(first, (down, right), axis=(0, 1))
        assert np.abs(np.mean(first * moved, axis=(0, 1))).max() < most
    assert np.abs(np.mean(first * second, axis=(0, 1))).max() < most
    assert abs(np.mean(first[..., 0] * first[..., 1])) < most
    assert abs(np.mean(first[..., 0] * first[..., 2])) < most
    power = np.abs(np.fft.fft2(first[..., 1])) ** 2 / 256.0**2
    # exponentially distributed; half of 65 536 are independent: this much once in 10 000 images
    assert power.max() < np.log(0.5 * 256.0**2) - np.log(1e-4)


SHOT = Shot(exposure_s=0.02, noise_key=key_of("noise", 3), frame_number=7)


def _pattern_file(tmp_path):
    rng = np.random.default_rng(5)
    shape = GEOMETRY.height_px, GEOMETRY.width_px
    pattern = np.stack((rng.normal(0, 0.1, shape), rng.normal(0, 30.0, shape)), axis=-1)
    write_pattern(tmp_path / "pattern.exr", pattern.astype(np.float32))
    return tmp_path / "pattern.exr"


@pytest.mark.parametrize("is_measured", [False, True])
def test_the_gpu_equals_the_reference(context, tmp_path, is_measured):
    """Up to ties of rounding, as in `test_noise_equals_its_reference_but_for_ties`."""
    pattern = (
        {"pattern": str(_pattern_file(tmp_path))} if is_measured else {"prnu": 0.1, "dsnu_e": 30.0}
    )
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
    path = _pattern_file(tmp_path)
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
    path = _pattern_file(tmp_path)
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
