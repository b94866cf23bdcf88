"""Random lenses, mirrors, optical systems and lidars."""

import dataclasses
import math

import numpy as np

from omnisim.cameras import (
    CylindricalCamera,
    DoubleSphereCamera,
    EquidistantCamera,
    EquirectangularCamera,
    EquisolidCamera,
    EucmCamera,
    HyperbolicCamera,
    KannalaBrandtCamera,
    OrthographicCamera,
    ParabolicCamera,
    PerspectiveCamera,
    RationalPolynomialCamera,
    StereographicCamera,
    UnifiedCamera,
)
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.core.errors import OpticsError
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.sensors.lidar.spinning_lidar import SpinningLidar
from tests.cameras.optics.examples import SYSTEMS

OPTICS = (
    "hyperbola", "misaligned hyperbola", "sphere", "tilted camera", "cone", "asphere", "polynomial",
    "needle", "folded", "dome",
)  # fmt: skip


def _image(random):
    """Width, height and center of an image; half of the centers are between or on pixels."""
    width, height = (int(size) for size in random.integers(40, 97, 2))
    center_px = np.array((width - 1, height - 1)) / 2
    if random.random() < 0.5:
        center_px += random.uniform(-4.0, 4.0, 2)
    elif random.random() < 0.5:
        center_px = np.round(center_px)
    return width, height, tuple(map(float, center_px))


def _hyperbolic(random):
    """A mirror whose rim passes through centers of pixels, or anywhere."""
    width, height, center_px = _image(random)
    mirror = HyperbolicMirror(
        k=random.uniform(2.5, 30.0), theta_max_rad=math.radians(random.uniform(80.0, 125.0))
    )
    radius_px = random.uniform(15.0, 60.0)
    if random.random() < 0.7:
        radius_px = round(2.0 * radius_px) / 2.0
    focal_px = radius_px / float(mirror.tangent_from_theta(mirror.theta_max_rad))
    return HyperbolicCamera(width, height, focal_px, center_px, mirror)


def _exact_mirror(random):
    return OmniCamera(_hyperbolic(random), polygons=None)


def _mirror_mesh(random):
    polygons = random.choice(["auto", 16, 64, 256, 1024])
    return OmniCamera(_hyperbolic(random), polygons="auto" if polygons == "auto" else int(polygons))


def _parabolic(random):
    width, height, center_px = _image(random)
    theta_rad = math.radians(random.uniform(70.0, 120.0))
    radius_px = round(random.uniform(15.0, 60.0))
    horizon_px = radius_px / math.tan(0.5 * theta_rad)
    return ParabolicCamera(width, height, horizon_px, center_px, theta_max_rad=theta_rad)


def _radial(random):
    """A lens without distortion whose domain ends at a circle, which may meet pixels' centers."""
    width, height, center_px = _image(random)
    model, widest_deg = [
        (EquidistantCamera, 180.0),
        (EquisolidCamera, 180.0),
        (StereographicCamera, 150.0),
        (OrthographicCamera, 90.0),
    ][random.integers(4)]
    theta_rad = math.radians(random.uniform(50.0, widest_deg))
    focal_px = float(random.choice([10.0, 16.0, 25.0, random.uniform(8.0, 60.0)]))
    return model(width, height, focal_px, center_px, theta_max_rad=theta_rad)


def _kannala_brandt(random):
    width, height, center_px = _image(random)
    focal_px = width * random.uniform(0.25, 0.7)
    focals_px = focal_px, focal_px * random.uniform(0.95, 1.05)
    terms = random.uniform(-1.0, 1.0, 4) * random.choice([0.05, 0.5]) * (1.0, 0.8, 2.4, 2.4)
    return KannalaBrandtCamera(width, height, focals_px, center_px, tuple(terms))


def rational(random):
    """A pinhole lens with strong terms of all kinds; every other one has a pole or a fold."""
    width, height, center_px = _image(random)
    focal_px = width * random.uniform(0.2, 0.7)
    focals_px = focal_px, focal_px * random.uniform(0.95, 1.05)
    terms = random.normal(size=12) * [0.3, 0.1, 0.01, 0.01, 0.02, 0.3, 0.1, 0.02, *[0.01] * 4]
    if random.random() < 0.5:
        terms[5:8] = np.abs(terms[5:8])  # no pole
    count = int(random.choice([5, 8, 12]))
    return RationalPolynomialCamera(width, height, focals_px, center_px, tuple(terms[:count]))


def _spheres(random):
    width, height, center_px = _image(random)
    focal_px = width * random.uniform(0.2, 0.6)
    focals_px = focal_px, focal_px * random.uniform(0.95, 1.05)
    kind = random.integers(3)
    if kind == 0:
        xi, alpha = random.uniform(-0.3, 0.5), random.uniform(0.3, 0.8)
        return DoubleSphereCamera(width, height, focals_px, center_px, xi, alpha)
    if kind == 1:
        alpha, beta = random.uniform(0.3, 0.9), random.uniform(0.5, 1.5)
        return EucmCamera(width, height, focals_px, center_px, alpha, beta)
    return UnifiedCamera(width, height, focals_px, center_px, random.uniform(0.3, 2.0))


def _panorama(random):
    width, height, center_px = _image(random)
    if random.random() < 0.5:
        return EquirectangularCamera(2 * width, height)
    return CylindricalCamera(2 * width, height, width * random.uniform(0.25, 0.5), center_px)


def _perspective(random):
    width, height, center_px = _image(random)
    return PerspectiveCamera(width, height, width * random.uniform(0.2, 1.5), center_px)


LENSES = {
    "mirror": _exact_mirror, "mirror's mesh": _mirror_mesh, "parabolic mirror": _parabolic,
    "radial lens": _radial, "Kannala-Brandt": _kannala_brandt, "rational": rational,
    "spheres": _spheres, "panorama": _panorama, "perspective": _perspective,
}  # fmt: skip


def lens_by_chance(random, kind):
    """A camera of a kind; parameters that make no lens are drawn anew."""
    while True:
        try:
            lens = LENSES[kind](random)
            return lens if isinstance(lens, OmniCamera) else OmniCamera(lens, polygons=None)
        except OpticsError:
            continue


def optics_by_chance(random, kind):
    """An optical system, smaller."""
    return OmniCamera(SYSTEMS[kind]).resized(int(random.integers(40, 97)))


def lidar_by_chance(random, most_rings=128):
    """A lidar of any rings without errors; some rings are far denser than others."""
    rings = int(2 ** random.uniform(1.0, math.log2(most_rings)))
    low_deg, high_deg = np.sort(random.uniform(-80.0, 60.0, 2))
    elevations_deg = np.linspace(low_deg, max(high_deg, low_deg + 0.1), rings)
    if random.random() < 0.3:
        elevations_deg[rings // 2 :] = elevations_deg[-1] + 0.05 * np.arange(rings - rings // 2)
    elif random.random() < 0.5:
        elevations_deg = np.sort(random.uniform(low_deg, high_deg + 1.0, rings))
    return dataclasses.replace(
        SpinningLidar().without_errors(),
        elevations_deg=tuple(map(float, np.unique(elevations_deg))),
        firings=int(random.integers(60, 200)),
        range_min_m=0.0,
        range_max_m=1000.0,
    )
