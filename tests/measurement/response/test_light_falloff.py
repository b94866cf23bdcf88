"""Vignetting from flat fields: polynomials and cos⁴ found again, uneven light refused."""

import numpy as np
import pytest

from omnisim.core.errors import MeasurementError
from omnisim.measurement.response import measure_vignetting
from omnisim.rendering.camera.degradations import Vignetting
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry

SIZE = 320, 240
CENTER = 163.0, 117.5
EFFECT = Vignetting((-0.4, 0.15, -0.05))
GEOMETRY = ImageGeometry(*SIZE, CENTER)


def flat_field(falloff, gradient=(0.0, 0.0), noise=0.0, seed=0):
    """Light (height, width) of an even surface behind a lens with a falloff of squared radii."""
    v, u = np.mgrid[: SIZE[1], : SIZE[0]].astype(np.float64)
    light = 0.7 * falloff(GEOMETRY.squared_radii().astype(np.float64))
    across, down = (u - CENTER[0]) / SIZE[0], (v - CENTER[1]) / SIZE[1]
    light *= 1.0 + gradient[0] * across + gradient[1] * down
    light += noise * np.random.default_rng(seed).normal(size=light.shape)
    return light


def drawn(vignetting, squared):
    return np.polynomial.polynomial.polyval(squared, (1.0, *vignetting.coefficients))


@pytest.mark.parametrize(
    ("tangent2", "gradient"),
    [(0.1, (0.0, 0.0)), (0.5, (0.1, -0.05)), (0.95, (0.1, -0.05))],
    ids=["56°", "100°", "117°"],
)
def test_cos4_is_found_within_half_a_percent(gradient, tangent2):
    def cos4(squared):
        return 1.0 / (1.0 + tangent2 * squared) ** 2

    flat = flat_field(cos4, gradient, noise=0.005)  # the mean of 16 frames with a noise of 2 %
    measured = measure_vignetting(flat, CENTER)
    squared = GEOMETRY.squared_radii().astype(np.float64)
    assert np.abs(drawn(measured.vignetting, squared) - cos4(squared)).max() < 0.005
    assert measured.gradient == pytest.approx(gradient, abs=0.003)


def test_our_own_vignetting_is_found_again():
    image = np.ones((SIZE[1], SIZE[0], 4), dtype=np.float32)
    flat = EFFECT.apply(image, GEOMETRY)[..., 1].astype(np.float64)
    measured = measure_vignetting(flat, CENTER)
    found = measured.vignetting.coefficients
    assert found == pytest.approx(EFFECT.coefficients, abs=5e-4)  # blocks of 8 px


@pytest.mark.slow
def test_standard_deviations_are_honest():
    within = []
    for seed in range(30):
        flat = flat_field(lambda squared: drawn(EFFECT, squared), noise=0.01, seed=seed)
        measured = measure_vignetting(flat, CENTER)
        for quantity, truth in zip(measured.quantities[:3], EFFECT.coefficients, strict=True):
            within.append(abs(quantity.value - truth) < 2.0 * quantity.sigma)
    assert 0.88 <= np.mean(within) <= 0.995  # 90 numbers, three of each fit related


def test_dust_does_not_count():
    flat = flat_field(lambda squared: drawn(EFFECT, squared), noise=0.005)
    flat[50:70, 100:120] *= 0.7
    measured = measure_vignetting(flat, CENTER)
    assert measured.vignetting.coefficients == pytest.approx(EFFECT.coefficients, abs=0.01)


@pytest.mark.parametrize(
    ("flat", "message"),
    [
        (np.zeros((240, 320)), "no light"),
        (flat_field(np.ones_like, (0.6, 0.0)), "the light changes by 60 % across the image"),
        (flat_field(lambda r2: r2 * 0.0 + 1.0 + 0.2 * (np.arange(320) // 40 % 2)), "unexplained"),
    ],
)
def test_what_is_no_flat_field_is_refused(flat, message):
    with pytest.raises(MeasurementError, match=message):
        measure_vignetting(flat, CENTER)
