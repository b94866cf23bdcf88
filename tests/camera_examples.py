"""Examples of every camera model, for the contract test and the GLSL comparison."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from omnisim.cameras import (
    CylindricalCamera,
    DivisionCamera,
    DoubleSphereCamera,
    EllipticCamera,
    EquidistantCamera,
    EquirectangularCamera,
    EquisolidCamera,
    EucmCamera,
    FThetaCamera,
    FThetaInverseCamera,
    GazeboCamera,
    HyperbolicCamera,
    KannalaBrandtCamera,
    OcamcalibCamera,
    OrthographicCamera,
    ParabolicCamera,
    PerspectiveCamera,
    PlanarCamera,
    RadialTableCamera,
    RationalPolynomialCamera,
    StereographicCamera,
    ThinPrismFisheyeCamera,
    UnifiedCamera,
)
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.core.arrays import Floats


def _framed(width: int, height: int, **mirror: float) -> HyperbolicCamera:
    return HyperbolicCamera.framed_on_rim(HyperbolicMirror(**mirror), width, height)


CAMERA_EXAMPLES = {
    "hyperbolic-paper": _framed(360, 360),
    "hyperbolic-wide-image": _framed(640, 480),
    "hyperbolic-up-face": _framed(401, 401, theta_max_rad=math.radians(150.0)),
    "hyperbolic-nearly-parabolic": _framed(512, 512, k=400.0, theta_max_rad=math.radians(120.0)),
    "hyperbolic-nearly-plane": _framed(300, 200, k=2.02, theta_max_rad=math.radians(70.0)),
    "hyperbolic-plane": _framed(300, 200, k=2.0, theta_max_rad=math.radians(60.0)),
    "hyperbolic-off-center": HyperbolicCamera(
        480, 360, 1300.0, (200.25, 150.75), HyperbolicMirror()
    ),
    "perspective": PerspectiveCamera.with_field_of_view(320, 240, math.radians(90.0)),
    "perspective-wide": PerspectiveCamera.with_field_of_view(300, 300, math.radians(150.0)),
    "perspective-off-center": PerspectiveCamera(200, 300, 150.0, (20.5, 310.25)),
    "cylindrical": CylindricalCamera(630, 200, 100.0, (314.5, 99.5)),
    "cylindrical-more-than-a-turn": CylindricalCamera(700, 160, 100.0, (340.25, 20.0)),
    "equidistant-full-sphere": EquidistantCamera(360, 360, 55.0, (179.5, 179.5)),
    "equidistant-off-center": EquidistantCamera(
        300, 200, 80.0, (140.25, 120.5), theta_max_rad=math.radians(100.0)
    ),
    "stereographic": StereographicCamera(320, 320, 21.0, (159.5, 159.5)),
    "stereographic-off-center": StereographicCamera(
        200, 150, 60.0, (90.5, 80.25), theta_max_rad=math.radians(95.0)
    ),
    "equisolid-full-sphere": EquisolidCamera(360, 360, 85.0, (179.5, 179.5)),
    "equisolid-off-center": EquisolidCamera(
        300, 200, 90.0, (140.25, 110.5), theta_max_rad=math.radians(105.0)
    ),
    "orthographic-full": OrthographicCamera(300, 300, 145.3, (149.5, 149.5)),
    "orthographic-off-center": OrthographicCamera(
        200, 150, 100.0, (110.25, 70.5), theta_max_rad=math.radians(70.0)
    ),
    "kannala-brandt-tum-vi": KannalaBrandtCamera(
        512, 512, (190.97848, 190.97331), (254.93171, 256.89744),
        (3.4823894e-3, 7.150348e-4, -2.0532361e-3, 2.0293674e-4),
    ),
    "kannala-brandt-to-its-fold": KannalaBrandtCamera(
        300, 260, (120.0, 110.0), (150.25, 128.5), (-0.05, -0.02, 0.0, 0.0)
    ),
    "kannala-brandt-full-sphere": KannalaBrandtCamera(
        400, 400, (60.0, 60.0), (199.5, 199.5), (0.01, 0.0, 0.0, 0.0)
    ),
    "kannala-brandt-skewed": KannalaBrandtCamera(
        320, 240, (150.0, 151.0), (160.25, 118.5), (0.03, -0.01, 2e-3, -1e-4), skew_px=-2.5
    ),
    "double-sphere-tum-vi": DoubleSphereCamera(
        512, 512, (158.28600, 158.27434), (254.96117, 256.88944), xi=-0.172131, alpha=0.593118
    ),
    "double-sphere-no-fold": DoubleSphereCamera(
        300, 200, (70.0, 71.0), (149.5, 90.25), xi=0.3, alpha=0.45
    ),
    "double-sphere-to-its-fold": DoubleSphereCamera(
        320, 320, (100.0, 100.0), (159.5, 159.5), xi=0.6, alpha=0.8
    ),
    "eucm": EucmCamera(512, 512, (190.0, 191.0), (254.5, 256.25), alpha=0.6, beta=1.1),
    "eucm-to-its-fold": EucmCamera(300, 260, (90.0, 80.0), (149.5, 129.5), alpha=0.75, beta=0.9),
    "eucm-no-fold": EucmCamera(300, 200, (70.0, 71.0), (140.5, 99.5), alpha=0.4, beta=1.6),
    # image_02, at a quarter of its size
    "unified-kitti-360": UnifiedCamera(
        350, 350, (334.0805, 333.947), (178.86, 176.07), xi=2.213404750785489,
        distortion=(0.016798, 1.654877, 4.222e-4, 4.246e-4),
    ),
    "unified-no-distortion": UnifiedCamera(400, 300, (250.0, 251.0), (199.5, 150.25), xi=0.9),
    "unified-barrel-fold": UnifiedCamera(
        400, 400, (300.0, 290.0), (199.5, 199.5), xi=1.0,
        distortion=(-0.3, 0.0, 2e-3, -1e-3), skew_px=1.5,
    ),
    "unified-kalibr": UnifiedCamera(
        376, 240, (260.0, 261.0), (188.25, 119.0), xi=1.6, distortion=(-0.2, 0.15, 1e-3, -5e-4)
    ),
    "unified-pinhole-with-k3": UnifiedCamera(
        320, 240, (266.4, 266.5), (171.2, 116.9), xi=0.0,
        distortion=(-0.281, 0.0252, 1.2e-3, -1.4e-4, 0.163),
    ),
    "equirectangular": EquirectangularCamera(400, 200),
    "equirectangular-odd": EquirectangularCamera(301, 203),
    "f-theta-woodscape-like": FThetaCamera(
        320, 242, (161.0, 119.3), (84.9, -8.0, 12.0, -3.3), theta_max_rad=math.radians(100.0)
    ),
    "f-theta-oblong-pixels": FThetaCamera(
        320, 200, (158.0, 101.5), (95.0, -3.0, 2.5), theta_max_rad=math.radians(110.0),
        aspect_ratio=0.87,
    ),
    "f-theta-to-its-fold": FThetaCamera(300, 300, (149.5, 149.5), (90.0, 0.0, -10.0)),
    "f-theta-inverse": FThetaInverseCamera(
        320, 240, (158.5, 121.25), (0.0105, 1e-6, 4e-9), theta_max_rad=math.radians(105.0)
    ),
    "f-theta-inverse-nurec": FThetaInverseCamera(
        300, 200, (150.5, 98.25), (8.5e-3, 1e-6, -3e-8), math.radians(75.0), (1.01, 2e-3, -5e-3)
    ),
    "f-theta-nurec": FThetaCamera(
        300, 200, (150.5, 98.25), (118.0, -4.0, 9.0), math.radians(75.0), 0.95, (0.99, -2e-3, 5e-3)
    ),
    "f-theta-inverse-to-its-end": FThetaInverseCamera(300, 300, (149.5, 149.5), (0.02, 0.0, -3e-7)),
    "parabolic": ParabolicCamera(360, 360, 140.0, (179.5, 179.5)),
    "parabolic-off-center": ParabolicCamera(
        300, 200, 70.0, (120.25, 110.5), theta_max_rad=math.radians(140.0)
    ),
    "ocamcalib-fisheye": OcamcalibCamera(
        360, 300, (181.25, 148.5), (-120.0, 0.0, 2.2e-3, -4e-6, 2e-8), (0.999, 1e-3, -2e-3)
    ),
    "ocamcalib-mirror": OcamcalibCamera(
        320, 240, (158.0, 121.5), (-75.0, 0.0, 6e-3), theta_max_rad=math.radians(110.0)
    ),
    "radial-table": RadialTableCamera(
        320, 300, (161.25, 148.5), tuple(math.radians(10.0 * i) for i in range(11)),
        (0.0, 15.5, 30.8, 45.9, 60.6, 74.8, 88.3, 100.9, 112.4, 122.5, 130.9),
    ),
    "radial-table-of-three": RadialTableCamera(
        200, 200, (99.5, 99.5), (0.0, 0.7, 1.4), (0.0, 60.0, 95.0)
    ),
    "gazebo-sin": GazeboCamera(
        300, 200, 82.0, (149.5, 99.5), 1.2, 1.6, 0.0, "sin", theta_max_rad=math.radians(130.0)
    ),
    "gazebo-tan": GazeboCamera(
        300, 240, 40.0, (150.5, 118.5), 2.0, 2.2, -0.1, "tan", theta_max_rad=math.radians(120.0)
    ),
    "gazebo-id": GazeboCamera(200, 200, 45.0, (99.5, 99.5), 1.0, 1.0, 0.0, "id"),
    "planar": PlanarCamera(300, 200, 140.0, (140.5, 99.5)),
    "elliptic": EllipticCamera(320, 320, 420.0, (159.5, 159.5), eccentricity=0.7),
    "elliptic-off-center": EllipticCamera(
        300, 200, 900.0, (130.25, 110.5), eccentricity=0.9, theta_max_rad=math.radians(75.0)
    ),
    # coefficients of the size that Azure Kinect's color camera has
    "rational-polynomial-kinect": RationalPolynomialCamera(
        320, 180, (151.4, 151.3), (159.2, 91.6),
        (0.45, -2.62, 6.5e-4, -2.3e-4, 1.52, 0.33, -2.44, 1.44),
    ),
    "rational-polynomial-wide": RationalPolynomialCamera(
        320, 240, (110.0, 111.0), (161.3, 118.2),
        (8.1, 3.2, 5e-4, -3e-4, 0.12, 8.5, 5.9, 0.75, 1e-3, -5e-4, -8e-4, 4e-4),
    ),
    "rational-polynomial-tilted-to-its-fold": RationalPolynomialCamera(
        300, 260, (150.0, 140.0), (149.5, 128.5),
        (-0.3, 0.02, 2e-3, -1e-3, 0.0, 0.05, 0.01, 0.0, 2e-3, 0.0, -1e-3, 0.0, 0.06, -0.04),
    ),
    "rational-polynomial-ending": RationalPolynomialCamera(
        320, 240, (135.5, 136.0), (161.25, 118.5),
        (0.31, -0.0195, -2.5e-4, 6e-5, 0.0155, 0.58, -0.061, 0.0335), math.radians(50.0),
    ),
    # coefficients of the size that Project Aria's cameras have
    "thin-prism-fisheye-aria": ThinPrismFisheyeCamera(
        352, 352, (152.5, 152.5), (179.2, 175.4), (-0.0263, 0.098, -0.0655, 0.0117, 2.2e-3, -6e-4),
        (5.6e-4, -2.7e-4), (-8.9e-4, -1.3e-4, 6.7e-4, 9.1e-5),
    ),
    "thin-prism-fisheye-to-its-fold": ThinPrismFisheyeCamera(
        320, 240, (95.0, 90.0), (150.25, 125.5), (-0.05, -0.02, 0.0, 0.0, 0.0, 0.0),
        (4e-3, -2e-3), (2e-3, 1e-3, -3e-3, 5e-4),
    ),
    "thin-prism-fisheye-without-either": ThinPrismFisheyeCamera(
        300, 300, (60.0, 61.0), (149.5, 148.25), (0.01, 0.0, 1e-3, 0.0, 0.0, 0.0),
        theta_max_rad=math.radians(130.0),
    ),
    "division": DivisionCamera(320, 240, (120.0, 121.0), (158.25, 121.5), -0.35),
    "division-past-90": DivisionCamera(
        300, 300, (60.0, 60.0), (149.5, 149.5), -0.4, theta_max_rad=math.radians(140.0)
    ),
    "division-to-its-fold": DivisionCamera(300, 260, (150.0, 140.0), (149.5, 128.5), 0.9),
}  # fmt: skip

_FIRST_OF_MODEL = {type(camera): name for name, camera in reversed(CAMERA_EXAMPLES.items())}
FIRST_EXAMPLES = frozenset(_FIRST_OF_MODEL.values())  # one of each model
# Each test of a camera; those of all but the first example of each model are slow.
camera_examples = pytest.mark.parametrize(
    "camera",
    [
        pytest.param(camera, id=name, marks=() if name in FIRST_EXAMPLES else pytest.mark.slow)
        for name, camera in CAMERA_EXAMPLES.items()
    ],
)

# Of the pixels near the pole of its denominator the GPU's iteration finds a part only.
POLE = RationalPolynomialCamera(
    90, 70, (30.0, 31.0), (44.5, 34.5), (-0.06, 0.043, -0.005, 0.017, -0.012, -0.813, -0.075, -0.01)
)


@dataclass(frozen=True)
class OwnCamera(EquidistantCamera):
    """A model that is not omnisim's own: r = 1.5 f sin(θ / 1.5), under the name of another."""

    def _radius_from_theta(self, theta: Floats) -> Floats:
        return 1.5 * np.sin(theta / 1.5)

    def _theta_from_radius(self, radius: Floats) -> Floats:
        return 1.5 * np.arcsin(radius / 1.5)


OWN = OwnCamera(120, 90, 34.0, (60.25, 44.0), theta_max_rad=1.7)


def points_around_axis(largest_theta_rad: float, count: int = 2000, seed: int = 5) -> Floats:
    """Points (n, 3) up to an angle from +z, at different distances."""
    generator = np.random.default_rng(seed)
    theta = generator.uniform(0.0, largest_theta_rad, count)
    azimuth = generator.uniform(-math.pi, math.pi, count)
    sine = np.sin(theta)
    rays = np.stack((sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(theta)), axis=-1)
    return rays * generator.uniform(0.5, 20.0, count)[:, None]
