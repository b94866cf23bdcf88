"""Published calibrations, against their publishers' formulas, angle by angle."""

import json

import numpy as np
import pytest

from omnisim.cameras import DoubleSphereCamera, FThetaCamera, KannalaBrandtCamera, UnifiedCamera
from tests.cameras import formulas

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
WOODSCAPE_FILE = json.loads("""{"cx_offset": 3.942, "cy_offset": -3.093, "width": 1280,
    "height": 966, "k1": 339.749, "k2": -31.988, "k3": 48.275, "k4": -7.201}""")


def _rays(largest_deg):
    """Rays (n, 3) of length 2.5 up to an angle from the axis."""
    theta, azimuth = np.meshgrid(np.radians(np.linspace(0.5, largest_deg, 40)), np.arange(6.0))
    sine = np.sin(theta)
    rays = np.stack((sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(theta)), axis=-1)
    return 2.5 * rays.reshape(-1, 3)


@pytest.mark.parametrize(
    ("camera", "formula", "given", "largest_deg"),
    [
        (KITTI_360, formulas.brown, KITTI_360, 100.0),
        (TUM_VI_KB4, formulas.kannala_brandt, TUM_VI_KB4, 110.0),
        (TUM_VI_DS, formulas.double_sphere, TUM_VI_DS, 120.0),
        (WOODSCAPE, formulas.woodscape, WOODSCAPE_FILE, 100.0),
    ],
    ids=["kitti-360", "tum-vi-kb4", "tum-vi-ds", "woodscape"],
)
def test_pixels_are_those_of_the_publisher(camera, formula, given, largest_deg):
    rays = _rays(largest_deg)
    expected_px = formula(given, *rays.T)
    ours = camera.pixel_from_ray(rays)
    assert ours.valid.all()
    assert np.abs(ours.positions_px - expected_px).max() < 1e-6
    back = camera.ray_from_pixel(expected_px).directions
    assert np.linalg.norm(back - rays / 2.5, axis=-1).max() < 1e-9


def test_two_models_of_one_camera_agree():
    """Fitted by others to the same images: a swapped axis or sign would be hundreds of pixels."""
    one, other = (
        camera.pixel_from_ray(_rays(85.0)).positions_px for camera in (TUM_VI_KB4, TUM_VI_DS)
    )
    assert np.linalg.norm(one - other, axis=-1).max() < 1.0
