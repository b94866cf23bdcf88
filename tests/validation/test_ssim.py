"""Structural similarity of images."""

import numpy as np
import pytest

from omnisim.validation.image_differences import ssim

ALL = np.ones((48, 48), dtype=bool)


def image(seed=1):
    return np.random.default_rng(seed).random((48, 48, 3))


def test_equal_images_are_alike():
    assert ssim(image(), image(), ALL) == pytest.approx(1.0)


def test_noise_and_other_images_are_less_alike():
    one = image()
    noisy = np.clip(one + 0.05 * np.random.default_rng(2).standard_normal(one.shape), 0.0, 1.0)
    assert 0.8 < ssim(one, noisy, ALL) < 0.999
    assert ssim(one, image(3), ALL) < 0.2


def test_flat_images_have_the_closed_form():
    """Even images differ in their levels alone."""
    from omnisim.core.srgb import srgb_from_linear

    first, second = 0.2, 0.5
    a, b = (float(srgb_from_linear(np.array(one))) for one in (first, second))
    expected = (2 * a * b + 1e-4) / (a * a + b * b + 1e-4)
    found = ssim(np.full((48, 48, 3), first), np.full((48, 48, 3), second), ALL)
    assert found == pytest.approx(expected, rel=1e-6)
