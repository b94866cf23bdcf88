"""Crossings of rays and profiles against dense samples, and SciPy's root finder between them."""

import numpy as np
import pytest
import scipy

from omnisim.cameras.optics.shapes import Asphere, Polynomial, TabulatedProfile

RADIUS_M = 0.03
RADII_M = np.linspace(0.0, RADIUS_M, 201)
UNEVEN_M = RADIUS_M * np.linspace(0.0, 1.0, 61) ** 1.5
PROFILES = {
    "convex": Asphere(0.03, -0.5, (1e3,)),
    "concave": Polynomial((0.0, -12.0, 0.0, -3e3)),
    "pointed": Polynomial((0.5, 10.0)),
    "wave": Polynomial((0.0, 20.0, 0.0, -25e3)),
    "table": TabulatedProfile(RADII_M, 10.0 * RADII_M**2),
    "uneven table": TabulatedProfile(UNEVEN_M, 2e-3 * np.sin(150.0 * UNEVEN_M) ** 2),
}
SAMPLES = 20_001


def _rays(count=150):
    """Rays from all around to points near the profile."""
    generator = np.random.default_rng(3)
    origins_m = generator.normal(size=(count, 3))
    origins_m *= 0.1 / np.linalg.norm(origins_m, axis=1, keepdims=True)
    through_m = generator.uniform(-1.0, 1.0, (count, 3)) * (RADIUS_M, RADIUS_M, 0.01)
    directions = through_m - origins_m
    return origins_m, directions / np.linalg.norm(directions, axis=1, keepdims=True)


@pytest.mark.parametrize("name", PROFILES)
def test_first_crossing(name):
    profile = PROFILES[name]
    origins_m, directions = _rays()
    got = profile.intersections(origins_m, directions, RADIUS_M)
    lengths = np.linspace(0.0, 0.2, SAMPLES)
    compared = 0
    for origin_m, direction, (length, _) in zip(origins_m, directions, got, strict=True):

        def height(at, origin_m=origin_m, direction=direction):
            x, y, z = origin_m[:, None] + direction[:, None] * np.atleast_1d(at)
            return z - profile.derivatives(np.hypot(x, y)).heights_m

        x, y = (origin_m[axis] + lengths * direction[axis] for axis in range(2))
        below = height(lengths) > 0.0
        crossed = (below[1:] != below[:-1]) & (np.hypot(x, y)[1:] < RADIUS_M)
        crossed &= np.hypot(x, y)[:-1] < RADIUS_M
        if not crossed.any():
            assert np.isnan(length) or np.abs(height(length)) < 1e-12
            continue
        at = crossed.argmax()
        expected = scipy.optimize.brentq(
            lambda at: height(at)[0], lengths[at], lengths[at + 1], xtol=1e-15
        )
        assert length == pytest.approx(expected, abs=1e-12)
        compared += 1
    assert compared > 40
