"""Noise by its statistics: never by its pixels."""

import numpy as np
import pytest
from scipy import stats

from omnisim.core.random_numbers import key_of, normal, pcg4d, uniform
from omnisim.rendering.camera.degradations import Noise
from omnisim.rendering.camera.degradations.effect import Shot
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.rendering.camera.degradations.noise import poisson
from tests.rendering.camera.degradations.images import flat_image, on_gpu

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


def test_noise_differs_by_key_and_frame(context):
    noise, image = Noise(), flat_image([0.4], 64, 64)
    same = _noisy(context, noise, image, 3), _noisy(context, noise, image, 3)
    np.testing.assert_array_equal(*same)
    for other in (
        _noisy(context, noise, image, 4),
        _noisy(context, noise, image, 3, key_of("noise", 1)),
    ):
        assert np.mean(other == same[0]) < 0.05
    assert key_of("noise", 1) != key_of("noise", "1") != key_of("noise", 1, "")
