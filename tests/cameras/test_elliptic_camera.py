"""The elliptic mirror as a mirror: the pinhole's rays reflected in Baker and Nayar's ellipsoid."""

import numpy as np
import pytest

from omnisim.cameras import EllipticCamera, pixel_grid
from omnisim.core.errors import OpticsError
from tests.camera_examples import CAMERA_EXAMPLES

C = 1.7  # distance of the foci
PINHOLE = np.array([0.0, 0.0, C])
MIRROR_FROM_OPTICAL = np.diag([1.0, -1.0, -1.0])

examples = pytest.mark.parametrize("name", ["elliptic", "elliptic-off-center"])


def _pinhole_rays(camera):
    """Unit directions (n, 3) that the pinhole looks in, mirror frame."""
    pixels = pixel_grid(camera.width_px, camera.height_px)[::5, ::5].reshape(-1, 2)
    pixels = pixels[camera.ray_from_pixel(pixels).valid]
    offset = (pixels - camera.principal_point_px) / camera.focal_length_px
    looking = np.concatenate((offset, np.ones((len(offset), 1))), axis=-1) @ MIRROR_FROM_OPTICAL.T
    return pixels, looking / np.linalg.norm(looking, axis=-1, keepdims=True)


def _hits(camera, looking):
    """Points where the pinhole's rays meet the inside of the ellipsoid, and its weights (3,).

    Baker and Nayar's ellipsoid is (z − c/2)² + r² (1 + c²/2k) = (2k + c²)/4.
    """
    e = camera.eccentricity
    k = 0.5 * C * C * (1.0 / (e * e) - 1.0)  # e = c/√(2k + c²)
    across = 1.0 + C * C / (2.0 * k)
    weights, right = np.array([across, across, 1.0]), 0.25 * (2.0 * k + C * C)
    start = PINHOLE - (0.0, 0.0, 0.5 * C)
    a = np.sum(weights * looking * looking, axis=-1)
    b = 2.0 * np.sum(weights * looking * start, axis=-1)
    c = np.sum(weights * start * start) - right
    distance = (-b + np.sqrt(b * b - 4.0 * a * c)) / (2.0 * a)  # the pinhole is inside
    return PINHOLE + distance[:, None] * looking, weights


@examples
def test_reflected_rays_meet_in_the_effective_viewpoint(name):
    camera = CAMERA_EXAMPLES[name]
    pixels, looking = _pinhole_rays(camera)
    hits, weights = _hits(camera, looking)
    normals = weights * (hits - (0.0, 0.0, 0.5 * C))
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    reflected = looking - 2.0 * np.sum(looking * normals, axis=-1, keepdims=True) * normals
    missed = np.linalg.norm(np.cross(hits, reflected), axis=-1)
    assert missed.max() < 1e-12 * C
    assert np.all(np.sum(hits * reflected, axis=-1) < 0.0)  # towards the viewpoint, then out
    ours = camera.ray_from_pixel(pixels).directions @ MIRROR_FROM_OPTICAL.T
    np.testing.assert_allclose(ours, reflected, rtol=0.0, atol=1e-12)


@examples
def test_mirror_does_not_occlude_itself(name):
    """A ray comes in on the pinhole's side of the rim's plane, where there is no mirror."""
    camera = CAMERA_EXAMPLES[name]
    pixels, looking = _pinhole_rays(camera)
    rim_height = _hits(camera, looking)[0][:, 2].max()
    rays = camera.ray_from_pixel(pixels).directions @ MIRROR_FROM_OPTICAL.T
    assert rim_height <= 1e-12
    assert rays[:, 2].min() >= -1e-12


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"eccentricity": 1.0}, "eccentricity: expected a number ≤ 0.9999, got 1"),
        ({"eccentricity": 0.0}, "eccentricity: .* got 0"),
        ({"theta_max_rad": 1.6}, "theta_max_rad: expected more than 0 .* \\(90°\\), got 1.6"),
    ],
)
def test_impossible_mirrors_are_refused(change, what):
    with pytest.raises(OpticsError, match=what):
        EllipticCamera(320, 320, 400.0, (159.5, 159.5), **{"eccentricity": 0.7, **change})
