"""Published calibrations, against their publishers' formulas, angle by angle.

The formulas are written out here in plain arithmetic, as the documents have them: they share no
line with the models.
"""

import math

import numpy as np
import pytest

from omnisim.cameras import DoubleSphereCamera, FThetaCamera, KannalaBrandtCamera, UnifiedCamera

WITHIN_PX = 1e-6

# KITTI-360, image_02.yaml
KITTI_360 = UnifiedCamera(
    1400, 1400, (1336.3220825849971, 1335.7883350012958), (716.94323510126321, 705.76498308221585),
    2.2134047507854890,
    (1.6798235660113681e-02, 1.6548773243373522, 4.2223943394772046e-04, 4.2462134260997584e-04),
)  # fmt: skip
# TUM-VI, cam0 of the 512 px set, by two models
TUM_VI_KB4 = KannalaBrandtCamera(
    512, 512, (190.97847715128717, 190.9733070521226), (254.93170605935475, 256.8974428996504),
    (0.0034823894022493434, 0.0007150348452162257, -0.0020532361418706202, 0.00020293673591811182),
)  # fmt: skip
TUM_VI_DS = DoubleSphereCamera(
    512, 512, (158.28600, 158.27434), (254.96117, 256.88944), xi=-0.172131, alpha=0.593118
)
# WoodScape, a front view
WOODSCAPE = FThetaCamera(
    1280, 966, (3.942 + 0.5 * 1280 - 0.5, -3.093 + 0.5 * 966 - 0.5),
    (339.749, -31.988, 48.275, -7.201),
)  # fmt: skip


def _mei(x, y, z):
    x, y, z = (one / math.sqrt(x * x + y * y + z * z) for one in (x, y, z))
    x, y = x / (z + 2.2134047507854890), y / (z + 2.2134047507854890)
    k1, k2, p1, p2 = (
        1.6798235660113681e-02, 1.6548773243373522, 4.2223943394772046e-04, 4.2462134260997584e-04,
    )  # fmt: skip
    r2 = x * x + y * y
    radial = k1 * r2 + k2 * r2 * r2
    dx = radial * x + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    dy = radial * y + 2 * p2 * x * y + p1 * (r2 + 2 * y * y)
    return (
        1336.3220825849971 * (x + dx) + 716.94323510126321,
        1335.7883350012958 * (y + dy) + 705.76498308221585,
    )


def _kb4(x, y, z):
    r = math.hypot(x, y)
    theta = math.atan2(r, z)
    k = (0.0034823894022493434, 0.0007150348452162257, -0.0020532361418706202,
         0.00020293673591811182)  # fmt: skip
    d = theta + sum(one * theta ** (2 * n + 3) for n, one in enumerate(k))
    return (
        190.97847715128717 * d * x / r + 254.93170605935475,
        190.9733070521226 * d * y / r + 256.8974428996504,
    )


def _double_sphere(x, y, z):
    xi, alpha = -0.172131, 0.593118
    d1 = math.sqrt(x * x + y * y + z * z)
    d2 = math.sqrt(x * x + y * y + (xi * d1 + z) ** 2)
    scale = alpha * d2 + (1 - alpha) * (xi * d1 + z)
    return 158.28600 * x / scale + 254.96117, 158.27434 * y / scale + 256.88944


def _woodscape(x, y, z):
    chi = math.sqrt(x * x + y * y)
    theta = math.pi / 2 - math.atan2(z, chi)
    rho = 339.749 * theta - 31.988 * theta**2 + 48.275 * theta**3 - 7.201 * theta**4
    return rho * x / chi + 3.942 + 1280 / 2 - 0.5, rho * y / chi - 3.093 + 966 / 2 - 0.5


SETS = {
    "kitti-360": (KITTI_360, _mei, 100.0),
    "tum-vi-kb4": (TUM_VI_KB4, _kb4, 110.0),
    "tum-vi-ds": (TUM_VI_DS, _double_sphere, 120.0),
    "woodscape": (WOODSCAPE, _woodscape, 100.0),
}


@pytest.mark.parametrize("name", SETS)
def test_pixels_are_those_of_the_publisher(name):
    camera, formula, largest_deg = SETS[name]
    for theta in np.radians(np.linspace(0.5, largest_deg, 40)):
        for azimuth in (0.1, 1.9, 3.6, 5.2):
            sine = math.sin(theta)
            ray = (
                2.5 * sine * math.cos(azimuth), 2.5 * sine * math.sin(azimuth),
                2.5 * math.cos(theta),
            )  # fmt: skip
            ours = camera.pixel_from_ray(ray)
            assert ours.valid, math.degrees(theta)
            assert np.abs(ours.positions_px - formula(*ray)).max() < WITHIN_PX
            back = camera.ray_from_pixel(formula(*ray)).directions
            assert np.linalg.norm(back - np.array(ray) / 2.5) < 1e-9


def test_two_models_of_one_camera_agree():
    """Fitted by others to the same images: a swapped axis or sign would be hundreds of pixels."""
    theta, azimuth = np.meshgrid(np.radians(np.linspace(0.0, 85.0, 30)), np.linspace(0, 6, 20))
    sine = np.sin(theta)
    rays = np.stack((sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(theta)), axis=-1)
    one, other = (camera.pixel_from_ray(rays).positions_px for camera in (TUM_VI_KB4, TUM_VI_DS))
    assert np.linalg.norm(one - other, axis=-1).max() < 1.0
