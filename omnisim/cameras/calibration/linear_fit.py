"""Linear initialization of a fit: for each model, the linear problem closest to the full fit.

Each uses the source's principal point and ratio of focal lengths, and only the angle θ from +z and
the radius r about the axis. If the source is symmetric about its axis and the target can be the
same lens, this is already the answer. The unified models, for example, satisfy
r (α + (1 − α) cos θ) = f sin θ, which is linear in α and f. Numbers of no valid camera, and a
target that sees too few samples, raise `OpticsError`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from omnisim.cameras import (
    CentralCamera,
    DivisionCamera,
    DoubleSphereCamera,
    EquidistantCamera,
    EquisolidCamera,
    EucmCamera,
    FThetaCamera,
    FThetaInverseCamera,
    GazeboCamera,
    KannalaBrandtCamera,
    OcamcalibCamera,
    OrthographicCamera,
    PerspectiveCamera,
    RadialTableCamera,
    RationalPolynomialCamera,
    StereographicCamera,
    ThinPrismFisheyeCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration.equivalents import IDEAL_FISHEYES
from omnisim.cameras.lens_polynomials import RadialTangential
from omnisim.cameras.models.field_of_view import angles_from_axis
from omnisim.cameras.models.gazebo import FUNCTIONS
from omnisim.cameras.parametric_camera import ParametricCamera, PlaneCamera
from omnisim.core.arrays import Bools, Floats
from omnisim.core.errors import OpticsError

MIN_SAMPLES = 20
MAX_ALPHA = 0.99  # ξ = 99 for the unified model; beyond it the image hardly changes
STEEPEST_RAD = math.radians(80.0)  # farther out, tan θ would outweigh all other pixels
TABLE_NODES = 48
OCAMCALIB_POWERS = (0, 2, 3, 4, 5, 6)  # a1 = 0: the image is smooth at the axis
IdealFisheye = EquidistantCamera | StereographicCamera | EquisolidCamera | OrthographicCamera


@dataclass(frozen=True, eq=False)
class FitSamples:
    """Source pixels and their rays, in the target's optical frame."""

    # pixels_px, directions: (n, 2) positions in the image, and (n, 3) unit directions
    pixels_px: Floats
    directions: Floats
    on_area: Bools  # (n,) True for samples spread over the image, False on its edge

    @cached_property
    def theta_rad(self) -> Floats:
        """Angles (n,) of the rays from +z."""
        return angles_from_axis(self.directions, 1.0)

    def subset(self, mask: Bools) -> FitSamples:
        """Samples selected by a mask (n,)."""
        return FitSamples(self.pixels_px[mask], self.directions[mask], self.on_area[mask])

    def rotated(self, rotation: Floats) -> FitSamples:
        """The same samples with rotated rays; `self` if the rotation is the identity."""
        if np.array_equal(rotation, np.eye(3)):
            return self  # keeps every bit
        return FitSamples(self.pixels_px, self.directions @ rotation.T, self.on_area)


class Profile(NamedTuple):
    """Source camera as a radially symmetric lens."""

    size: tuple[int, int]  # width and height of the image
    center_px: tuple[float, float]  # (u, v) of the axis
    aspect: float  # ratio of the focal length along v to that along u
    theta_rad: Floats  # (n,) angles from +z
    radii_px: Floats  # (n,) distances from the axis in pixels along u

    def intrinsics(
        self, focal_px: float
    ) -> tuple[int, int, tuple[float, float], tuple[float, float]]:
        """Size, focal lengths along u and v, and principal point."""
        return *self.size, (focal_px, focal_px * self.aspect), self.center_px


def radial_profile(
    camera: CentralCamera, samples: FitSamples, center_px: tuple[float, float] | None = None
) -> Profile:
    """Radial profile of a camera about its principal point, or about `center_px` of the target."""
    if len(samples.theta_rad) < MIN_SAMPLES or samples.theta_rad.min() > math.radians(170.0):
        raise OpticsError("the camera has too few rays to compare")
    scale = camera.pixels_per_plane if isinstance(camera, PlaneCamera) else 1.0
    aspect = scale[1] / scale[0] if isinstance(scale, tuple) else 1.0
    u, v = camera.principal_point_px
    offset = (samples.pixels_px - (u, v)) / (1.0, aspect)
    radii = np.hypot(offset[:, 0], offset[:, 1])
    size = camera.width_px, camera.height_px
    center = (float(u), float(v)) if center_px is None else center_px
    return Profile(size, center, aspect, samples.theta_rad, radii)


def linear_fit(
    model: type[ParametricCamera],
    profile: Profile,
    is_pinhole: bool,
    held: Collection[str] = (),
) -> ParametricCamera:
    """Initial camera of a model in `FITTED`; a unified one with ξ = 0 for a pinhole.

    OCamCalib's polynomial lacks the powers whose labels, such as `polynomial.5`, are in `held`.
    """
    if model is OcamcalibCamera:
        return _ocamcalib(profile, held)
    return _pinhole(profile) if is_pinhole else FITTED[model].initialize(profile)


def _solve(columns: list[Floats], values: Floats) -> Floats:
    """Solution (columns,) of a linear least-squares problem; scales columns to equal length."""
    matrix = np.stack(columns, axis=-1)
    lengths = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    return np.linalg.lstsq(matrix / lengths, values, rcond=None)[0] / lengths


def _alpha_and_focal(profile: Profile) -> tuple[float, float]:
    """α and f in r (α + (1 − α) cos θ) = f sin θ, from the angles that such a model can see."""
    theta, radius = profile.theta_rad, profile.radii_px
    alpha, focal = 0.5, 1.0
    for _ in range(8):
        sine, cosine = np.sin(theta), np.cos(theta)
        alpha, focal = _solve([radius * (1.0 - cosine), -sine], -radius * cosine)
        alpha = float(alpha)
        if abs(alpha) < 1e-12 or abs(alpha - 1.0) < 1e-12:
            alpha = round(alpha)  # rounding error at the model's limits
        if not 0.0 <= alpha <= 1.0:
            alpha = min(max(alpha, 0.0), 1.0)
            spread = sine / np.maximum(alpha + (1.0 - alpha) * cosine, 0.1)
            focal = float(radius @ spread / (spread @ spread))
        w = alpha / (1.0 - alpha) if alpha <= 0.5 else (1.0 - alpha) / alpha
        seen = profile.theta_rad < math.acos(-w) + 1e-9
        if seen.sum() < 20 or np.array_equal(profile.theta_rad[seen], theta):
            break
        theta, radius = profile.theta_rad[seen], profile.radii_px[seen]
    return alpha, max(float(focal), 1e-6)


def _perspective_focal(profile: Profile) -> float:
    """f in r cos θ = f sin θ, from the angles in front of the camera."""
    front = profile.theta_rad < STEEPEST_RAD
    if not front.any():
        raise OpticsError("no ray of the camera points forward")
    sine = np.sin(profile.theta_rad[front])
    radius = profile.radii_px[front] * np.cos(profile.theta_rad[front])
    return max(float(radius @ sine / (sine @ sine)), 1e-6)


def _perspective(profile: Profile) -> PerspectiveCamera:
    return PerspectiveCamera(*profile.size, _perspective_focal(profile), profile.center_px)


def _unified(profile: Profile) -> UnifiedCamera:
    alpha, focal = _alpha_and_focal(profile)
    alpha = min(alpha, MAX_ALPHA)
    xi = alpha / (1.0 - alpha)
    return UnifiedCamera(*profile.intrinsics(focal * (1.0 + xi)), xi)


def _pinhole(profile: Profile) -> UnifiedCamera:
    """Unified model with ξ = 0, unless it folds: r = f (t + k1 t³ + k2 t⁵), t = tan θ."""
    focal, distortion = _perspective_focal(profile), (0.0, 0.0, 0.0, 0.0)
    front = profile.theta_rad < STEEPEST_RAD
    tangent = np.tan(profile.theta_rad[front])
    first, third, fifth = _solve([tangent, tangent**3, tangent**5], profile.radii_px[front])
    if first > 0.0:
        k1, k2 = float(third / first), float(fifth / first)
        residuals = profile.radii_px[front] - focal * tangent
        # rounding errors of an undistorted lens are not distortion
        is_distorted = np.abs(residuals).max() > 1e-9 * focal
        if is_distorted and RadialTangential(k1, k2, 0.0, 0.0).radius_limit(10.0) > tangent.max():
            focal, distortion = float(first), (k1, k2, 0.0, 0.0)
    return UnifiedCamera(*profile.intrinsics(focal), 0.0, distortion)


def _rational(profile: Profile) -> RationalPolynomialCamera:
    pinhole = _pinhole(profile)
    distortion = (*pinhole.distortion, *(0.0,) * 8)[:8]
    return RationalPolynomialCamera(*profile.intrinsics(pinhole.focal_lengths_px[0]), distortion)


def _eucm(profile: Profile) -> EucmCamera:
    alpha, focal = _alpha_and_focal(profile)
    return EucmCamera(*profile.intrinsics(focal), alpha, beta=1.0)


def _double_sphere(profile: Profile) -> DoubleSphereCamera:
    alpha, focal = _alpha_and_focal(profile)
    return DoubleSphereCamera(*profile.intrinsics(focal), 0.0, alpha)


def _kannala_brandt(profile: Profile) -> KannalaBrandtCamera:
    powers = [profile.theta_rad**power for power in (1, 3, 5, 7, 9)]
    first, *others = _solve(powers, profile.radii_px)
    coefficients = tuple(float(coefficient / first) for coefficient in others)
    return KannalaBrandtCamera(*profile.intrinsics(float(first)), coefficients)


def _thin_prism_fisheye(profile: Profile) -> ThinPrismFisheyeCamera:
    first, *others = _solve(
        [profile.theta_rad**power for power in range(1, 14, 2)], profile.radii_px
    )
    coefficients = tuple(float(coefficient / first) for coefficient in others)
    return ThinPrismFisheyeCamera(*profile.intrinsics(float(first)), coefficients)


def _division(profile: Profile) -> DivisionCamera:
    # r cos θ = f sin θ + (k/f) r² sin θ
    sine, radius = np.sin(profile.theta_rad), profile.radii_px
    focal, bend = _solve([sine, radius * radius * sine], radius * np.cos(profile.theta_rad))
    focal = max(float(focal), 1e-6)
    return DivisionCamera(*profile.intrinsics(focal), float(bend) * focal)


def _f_theta(profile: Profile) -> FThetaCamera:
    powers = [profile.theta_rad**power for power in (1, 2, 3, 4)]
    coefficients_px = tuple(_solve(powers, profile.radii_px).tolist())
    return FThetaCamera(
        *profile.size, profile.center_px, coefficients_px, aspect_ratio=profile.aspect
    )


def _f_theta_inverse(profile: Profile) -> FThetaInverseCamera:
    powers = [profile.radii_px**power for power in (1, 2, 3, 4, 5)]
    coefficients = tuple(_solve(powers, profile.theta_rad).tolist())
    return FThetaInverseCamera(*profile.size, profile.center_px, coefficients)


def _ocamcalib(profile: Profile, held: Collection[str] = ()) -> OcamcalibCamera:
    # F(ρ) sin θ = −ρ cos θ
    sine, cosine = np.sin(profile.theta_rad), np.cos(profile.theta_rad)
    powers = [power for power in OCAMCALIB_POWERS if f"polynomial.{power}" not in held]
    columns = [sine * profile.radii_px**power for power in powers]
    a0, *others = _solve(columns, -profile.radii_px * cosine).tolist()
    affine = (profile.aspect, 0.0, 0.0)
    return OcamcalibCamera(*profile.size, profile.center_px, (a0, 0.0, *others), affine)


def _radial_table(profile: Profile) -> RadialTableCamera:
    order = np.argsort(profile.theta_rad)
    theta, radius = profile.theta_rad[order], np.maximum.accumulate(profile.radii_px[order])
    nodes = np.linspace(0.0, min(theta[-1] + 1e-9, math.pi), TABLE_NODES)
    radii = np.interp(nodes, np.append(0.0, theta), np.append(0.0, radius))
    radii += np.arange(TABLE_NODES) * 1e-9 * radii[-1]  # rises even where the source does not
    return RadialTableCamera(
        *profile.size, profile.center_px, tuple(nodes.tolist()), tuple(radii.tolist())
    )


def _gazebo(profile: Profile) -> GazeboCamera:
    """Best of Gazebo's three functions, each with the best c2 of a set and c3 = 0."""
    candidates: list[tuple[float, GazeboCamera]] = []
    widest = float(profile.theta_rad.max())
    for name, function in FUNCTIONS.items():
        least = widest / (0.5 * math.pi) if name != "id" else 0.0
        for c2 in (1.0,) if name == "id" else (1.0, 1.5, 2.0, 2.5, 3.0, 4.0):
            if c2 < least or (name == "tan" and c2 * math.radians(89.9) < widest):
                continue
            shape = function(profile.theta_rad / c2)
            focal = _scale(shape, profile.radii_px) / c2
            residual = float(np.linalg.norm(profile.radii_px - focal * c2 * shape))
            camera = GazeboCamera(*profile.size, focal, profile.center_px, c2, c2, 0.0, name)
            candidates.append((residual, camera))
    if not candidates:
        raise OpticsError("none of its functions reaches that far from the axis")
    return min(candidates, key=lambda candidate: candidate[0])[1]


def _fisheye(model: type[IdealFisheye], profile: Profile) -> IdealFisheye:
    c1, c2, function = IDEAL_FISHEYES[model]
    limit = model.largest_theta_rad
    seen = profile.theta_rad <= limit + 1e-9
    if not seen.any():
        raise OpticsError("none of the camera's rays is in its field of view")
    shape = c1 * FUNCTIONS[function](np.minimum(profile.theta_rad[seen], limit) / c2)
    focal = _scale(shape, profile.radii_px[seen])
    return model(*profile.size, focal, profile.center_px, limit)


def _scale(shape: Floats, values: Floats) -> float:
    """Least-squares factor from a shape (n,) to values (n,)."""
    return float(values @ shape / (shape @ shape))


Bounds = tuple[float, float]
FREE: Bounds = (-math.inf, math.inf)
POSITIVE: Bounds = (1e-9, math.inf)
_CENTER = {"principal_point_px": FREE}
_FOCAL = {"focal_length_px": (0.0, math.inf), **_CENTER}
_FOCALS = {"focal_lengths_px": (0.0, math.inf), **_CENTER}


class FittedModel(NamedTuple):
    """Initialization of a fit, and bounds on the model's free parameters."""

    initialize: Callable[[Profile], ParametricCamera]
    free: Mapping[str, Bounds]


FITTED: Mapping[type[ParametricCamera], FittedModel] = {
    PerspectiveCamera: FittedModel(_perspective, _FOCAL),
    KannalaBrandtCamera: FittedModel(_kannala_brandt, {**_FOCALS, "coefficients": FREE}),
    ThinPrismFisheyeCamera: FittedModel(
        _thin_prism_fisheye, {**_FOCALS, "coefficients": FREE, "tangential": FREE, "prism": FREE}
    ),
    DivisionCamera: FittedModel(_division, {**_FOCALS, "k": FREE}),
    UnifiedCamera: FittedModel(_unified, {**_FOCALS, "xi": (0.0, math.inf), "distortion": FREE}),
    RationalPolynomialCamera: FittedModel(_rational, {**_FOCALS, "distortion": FREE}),
    EucmCamera: FittedModel(_eucm, {**_FOCALS, "alpha": (0.0, 1.0), "beta": POSITIVE}),
    DoubleSphereCamera: FittedModel(
        _double_sphere, {**_FOCALS, "xi": (-0.999, 0.999), "alpha": (0.0, 1.0)}
    ),
    OcamcalibCamera: FittedModel(_ocamcalib, {**_CENTER, "polynomial": FREE, "affine": FREE}),
    FThetaCamera: FittedModel(
        _f_theta, {**_CENTER, "coefficients_px": FREE, "aspect_ratio": (0.1, 10.0)}
    ),
    FThetaInverseCamera: FittedModel(_f_theta_inverse, {**_CENTER, "coefficients": FREE}),
    RadialTableCamera: FittedModel(_radial_table, {**_CENTER, "radii_px": FREE}),
    GazeboCamera: FittedModel(
        _gazebo, {**_CENTER, "c1": POSITIVE, "c2": POSITIVE, "c3": (-math.inf, 0.0)}
    ),
    **{
        model: FittedModel(partial(_fisheye, model), _FOCAL)
        for model in (EquidistantCamera, StereographicCamera, EquisolidCamera, OrthographicCamera)
    },
}


# Free parameters of a camera as a vector, for solvers.


CameraT = TypeVar("CameraT", bound=ParametricCamera)


class ParameterVector(Generic[CameraT]):
    """Numbers of a camera that a solver may change, each in units of similar effect.

    Args:
        camera: initial camera.
        free: bounds of the free attributes, by name.
        fixed: labels of numbers that are held constant, such as `affine.2`.

    Attributes:
        labels: attribute, or attribute and index, of each number.
        start, low, high: (n,) numbers of the initial camera, and bounds.
        units: (n,) attribute's value per number of the vector.
    """

    def __init__(
        self, camera: CameraT, free: Mapping[str, Bounds], fixed: Collection[str] = ()
    ) -> None:
        self._camera, self._names = camera, list(free)
        values = [np.atleast_1d(getattr(camera, name)).astype(np.float64) for name in free]
        self._lengths = [len(value) for value in values]
        labels = [
            f"{name}.{index}" if isinstance(getattr(camera, name), tuple) else name
            for name, length in zip(free, self._lengths, strict=True)
            for index in range(length)
        ]
        units = [_units(name, value, camera) for name, value in zip(free, values, strict=True)]
        self._all = np.concatenate([np.zeros(0), *values])
        self._units = np.concatenate([np.zeros(0), *units])
        bounds = np.repeat(np.reshape(list(free.values()), (-1, 2)), self._lengths, axis=0)
        low, high = bounds.T
        self._used = np.array([label not in fixed for label in labels], dtype=bool)
        self.labels = [label for label, used in zip(labels, self._used, strict=True) if used]
        self.units = self._units[self._used]
        self.start = (self._all / self._units)[self._used]
        self.low, self.high = (low / self._units)[self._used], (high / self._units)[self._used]

    def camera(self, vector: Floats) -> CameraT:
        """Camera with other numbers (n,)."""
        if not self._names:
            return self._camera
        values = self._all.copy()
        values[self._used] = vector * self.units
        parts = np.split(values, np.cumsum(self._lengths)[:-1])
        changes: dict[str, Any] = {
            name: tuple(part.tolist())
            if isinstance(getattr(self._camera, name), tuple)
            else float(part[0])
            for name, part in zip(self._names, parts, strict=True)
        }
        return dataclasses.replace(self._camera, **changes)


def _units(name: str, values: Floats, camera: ParametricCamera) -> Floats:
    """Step units (n,) of a parameter's values that move the image by similar distances.

    The units of a polynomial of the image radius are powers of the radius.
    """
    powers = np.arange(len(values), dtype=np.float64)
    if name == "coefficients" and isinstance(camera, FThetaInverseCamera):
        powers += 1.0  # without a constant term
    elif name != "polynomial":
        return np.ones(len(values))
    radius_px = 0.5 * max(camera.width_px, camera.height_px)
    return radius_px**-powers
