"""Best fit of one camera model to another, and its reprojection residuals.

A fit minimizes the sum of squared reprojection errors, in pixels, over pixels spread evenly across
the valid image of the source, including its edge. If both models can describe the same lens, the
linear initialization (`linear_fit`) is already the answer; otherwise the Levenberg-Marquardt method
refines it. Reported residuals use other pixels than the fit.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from omnisim.cameras import (
    CAMERA_MODELS,
    CentralCamera,
    KannalaBrandtCamera,
    PerspectiveCamera,
    UnifiedCamera,
    check_central,
)
from omnisim.cameras.calibration.calibrated_camera import Residuals
from omnisim.cameras.calibration.linear_fit import (
    FITTED,
    MIN_SAMPLES,
    STEEPEST_RAD,
    Bounds,
    FitSamples,
    ParameterVector,
    linear_fit,
    radial_profile,
)
from omnisim.cameras.models.field_of_view import corner_pixels, edge_pixels, optical_axis
from omnisim.cameras.parametric_camera import ParametricCamera
from omnisim.core.arrays import Floats
from omnisim.core.errors import CalibrationError, OpticsError

EXACT_PX = 1e-10  # rounding of a projection
MARGIN_RAD = 1e-9  # keeps the source's edge visible in spite of rounding
MIN_COVERED = 0.05  # minimum share of the source's pixels that a fit covers
MAX_RMS = 0.02  # maximum residual, as a share of the image's longer side
WIDEST_DEG = (30.0, 60.0, 90.0, 120.0, 150.0, 180.0)  # angles from the axis of the first guesses
INNER = 0.85  # share of the image's radius within which the axis is fitted
MIN_SHARE = 0.3  # valid share of the samples over the image; below it, more are drawn
AREA_SAMPLES, EDGE_SAMPLES = 1000, 120
PLASTIC = 1.32471795724474602596  # the plastic number: its powers fill the plane evenly

CameraT = TypeVar("CameraT", bound=CentralCamera)
FITTED_MODELS = {model.model_name: model for model in FITTED}


class Fit(NamedTuple, Generic[CameraT]):
    """A camera fitted in another model."""

    camera: CameraT
    residuals: Residuals  # residuals over the source's valid cone, at pixels not used by the fit
    covered: float  # share of the source's valid pixels that the fitted camera sees
    # (3, 3) target_from_source of the axes; the identity unless it was fitted too
    rotation: Floats


def fit_camera(
    camera: CentralCamera,
    model: type[CameraT],
    *,
    mirrored: bool = False,
    fixed: Mapping[str, Any] | None = None,
    rotated: bool = False,
) -> Fit[CameraT]:
    """Fit a model to a camera.

    Args:
        camera: source camera.
        model: class of the fitted camera, one of `FITTED_MODELS` or the source's own.
        mirrored: express the source's rays in a mirrored frame, see `mirrored_frame`. Mirrors look
            along −z of their optical frame, where most models see nothing.
        fixed: attributes of the fitted camera that are held constant: `{"xi": 0.0}` makes the
            unified model a pinhole camera with radial and tangential distortion. None holds the
            value of the linear initialization, also of one number, such as `polynomial.1`.
        rotated: also fit the orientation of the axes, for a source whose axis is not its z.

    Raises:
        CalibrationError: the model cannot be fitted, or cannot see the source's field of view.
        OpticsError: the source is non-central.
    """
    check_central(camera, "fit")
    fixed = dict(fixed or {})
    upright = np.eye(3)
    if isinstance(camera, model) and type(camera) is model and not mirrored and not fixed:
        return _evaluate(camera, camera, mirrored, upright)
    target = next((kind for kind in FITTED if kind is model), None)
    if target is None:
        names = ", ".join(FITTED_MODELS)
        raise _failure(camera, model, f"expected one of {names}")
    samples = samples_of(camera, mirrored)
    try:
        axis = _axis_of(camera, mirrored) if rotated else None
        fitted, rotation = fitted_to_samples(camera, target, samples, fixed, axis)
    except OpticsError as reason:
        raise _failure(camera, model, f"{reason}{_hint(camera, mirrored)}") from None
    assert isinstance(fitted, model)
    fit: Fit[CameraT] = _evaluate(camera, fitted, mirrored, rotation)
    if fit.covered < MIN_COVERED:
        share = f"it would show {100.0 * fit.covered:.1f} % of the valid pixels"
        raise _failure(camera, model, share + _hint(camera, mirrored))
    if fit.residuals.rms_px > MAX_RMS * max(camera.width_px, camera.height_px):
        rms = f"the best fit is off by {fit.residuals.rms_px:.3g} px RMS"
        raise _failure(camera, model, rms)
    return fit


@lru_cache(maxsize=4)  # one camera is fitted by several models
def samples_of(camera: CentralCamera, mirrored: bool, phase: float = 0.0) -> FitSamples:
    """Valid pixels, spread evenly over the image and along its edge, with their rays.

    If mirrored, rays are in `mirrored_frame`. Another phase in [0, 1] gives other pixels.
    """
    inner = _spread_pixels(camera, AREA_SAMPLES, phase)
    share = float(camera.ray_from_pixel(inner).valid.mean())
    if 0.0 < share < MIN_SHARE:
        inner = _spread_pixels(camera, round(AREA_SAMPLES / share), phase)
    edge = edge_pixels(camera, EDGE_SAMPLES, phase)
    pixels = np.concatenate((inner, edge, corner_pixels(camera)))
    rays = camera.ray_from_pixel(pixels)
    directions = rays.directions @ mirrored_frame(camera).T if mirrored else rays.directions
    on_area = np.arange(len(pixels)) < len(inner)
    return FitSamples(pixels, directions, on_area).subset(rays.valid)


def _spread_pixels(camera: CentralCamera, count: int, phase: float) -> Floats:
    """Pixels (count, 2) spread evenly over an image."""
    steps = np.arange(1, count + 1)[:, None] / np.array([PLASTIC, PLASTIC**2]) + phase
    return steps % 1.0 * (camera.width_px, camera.height_px) - 0.5


def mirrored_frame(source: CentralCamera) -> Floats:
    """Matrix (3, 3) from a mirror's optical frame to a frame in which its image is a lens's.

    (x, y, −z): a reflection, like the mirror itself; (−x, −y, −z) if the image is also upside
    down, as an elliptic mirror's. The matrix is its own inverse.
    """
    beside = source.ray_from_pixel(np.add(source.principal_point_px, (0.25, 0.0))).directions
    sign = -1.0 if beside[0] < 0.0 else 1.0
    return np.diag([sign, sign, -1.0])


class _Axis(NamedTuple):
    """Optical axis of a source, about which its rays are nearly symmetric."""

    rotation: Floats  # (3, 3) to axes whose z is the optical axis
    center_px: tuple[float, float]


@lru_cache(maxsize=4)  # one camera is fitted by several models
def _axis_of(camera: CentralCamera, mirrored: bool) -> _Axis:
    """Axis of a source, from a fit of a rotated Kannala-Brandt lens, which accepts any angle."""
    samples = samples_of(camera, mirrored)
    samples = samples.subset(samples.on_area)
    if len(samples.pixels_px) == 0:
        return _Axis(np.eye(3), camera.principal_point_px)
    axis = _equidistant_axis(camera, samples)
    radii = np.linalg.norm(samples.pixels_px - axis.center_px, axis=1)
    samples = samples.subset(radii < INNER * radii.max())  # a ball's outline is a fold
    turned = samples.rotated(axis.rotation)
    try:
        profile = radial_profile(camera, turned, axis.center_px)
        start = linear_fit(KannalaBrandtCamera, profile, False)
        seen = turned.subset(start.pixel_from_ray(turned.directions).valid)
        with np.errstate(all="ignore"):
            lens, turn = _refined(start, seen, FITTED[KannalaBrandtCamera].free, {}, True)
    except OpticsError:  # an inside-out image, as a cone's, fits no such lens
        return axis
    return _Axis(turn @ axis.rotation, lens.principal_point_px)


def _equidistant_axis(source: CentralCamera, samples: FitSamples) -> _Axis:
    """Axis of the equidistant lens nearest to the samples, among a few candidates.

    Source: Kabsch 1976, for the rotation between the two sets of directions.
    """
    u, v = samples.pixels_px.mean(axis=0).tolist()
    best, axis = -math.inf, _Axis(np.eye(3), source.principal_point_px)
    for center_px in (source.principal_point_px, (u, v)):
        offsets = samples.pixels_px - center_px
        radii = np.linalg.norm(offsets, axis=1)
        for widest_rad in np.radians(WIDEST_DEG):
            theta = widest_rad * radii / max(float(radii.max()), 1e-9)
            across = offsets * (np.sin(theta) / np.maximum(radii, 1e-9))[:, None]
            lens = np.column_stack((across, np.cos(theta)))
            left, sizes, right = np.linalg.svd(lens.T @ samples.directions)
            signs = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
            if float(sizes @ signs) > best:  # the sum of all cosines
                best, axis = float(sizes @ signs), _Axis((left * signs) @ right, center_px)
    return axis


def fitted_to_samples(
    source: CentralCamera,
    model: type[ParametricCamera],
    samples: FitSamples,
    fixed: Mapping[str, Any],
    axis: _Axis | None,
) -> tuple[ParametricCamera, Floats]:
    """Camera with the smallest residuals, and its rotation (3, 3); starts near `axis`, if given."""
    rotation = np.eye(3) if axis is None else axis.rotation
    center_px = None if axis is None else axis.center_px
    samples = samples.rotated(rotation)
    is_pinhole = model is UnifiedCamera and fixed.get("xi") == 0.0
    profile = radial_profile(source, samples, fixed.get("principal_point_px", center_px))
    given = {name: value for name, value in fixed.items() if value is not None}
    camera = dataclasses.replace(linear_fit(model, profile, is_pinhole, fixed), **given)
    seen = camera.pixel_from_ray(samples.directions)
    if not (seen.valid.all() and np.abs(seen.positions_px - samples.pixels_px).max() <= EXACT_PX):
        used = seen.valid
        if is_pinhole or model is PerspectiveCamera:  # near 90° an image plane extends far out
            used &= samples.theta_rad <= STEEPEST_RAD
        if used.sum() < MIN_SAMPLES:
            raise OpticsError("too few of the camera's rays are in its field of view")
        free = FITTED[model].free
        camera, turn = _refined(camera, samples.subset(used), free, fixed, axis is not None)
        rotation, samples = turn @ rotation, samples.rotated(turn)
    # beyond the source's own domain the fit is meaningless
    limit = min(float(samples.theta_rad.max(initial=0.0)) + MARGIN_RAD, model.largest_theta_rad)
    return camera.ending_at(limit) or camera, rotation


def _refined(
    start: ParametricCamera,
    samples: FitSamples,
    free: Mapping[str, Bounds],
    fixed: Mapping[str, Any],
    rotated: bool,
) -> tuple[ParametricCamera, Floats]:
    """Camera at the local minimum of the squared errors near `start`, and its rotation (3, 3)."""
    varied = {name: bounds for name, bounds in free.items() if name not in fixed}
    parameters = ParameterVector(start, varied, fixed)
    count = len(parameters.start)
    turns = [np.zeros(3)] if rotated else []
    first = np.concatenate([parameters.start, *turns])
    low = np.concatenate([parameters.low, *[turn - math.inf for turn in turns]])
    high = np.concatenate([parameters.high, *[turn + math.inf for turn in turns]])
    penalty = np.full(2 * len(samples.pixels_px), float(start.width_px + start.height_px))

    def turn_of(vector: Floats) -> Floats:
        turn = vector[count:]
        return Rotation.from_rotvec(turn).as_matrix() if rotated else np.eye(3)

    def errors_px(vector: Floats) -> Floats:
        directions = samples.directions @ turn_of(vector).T if rotated else samples.directions
        try:
            seen = parameters.camera(vector[:count]).pixel_from_ray(directions)
        except OpticsError:
            return penalty  # not a valid camera
        errors: Floats = seen.positions_px - samples.pixels_px
        errors[~seen.valid] = penalty[0]
        return errors.ravel()

    inside = np.clip(first, low + 1e-12, high - 1e-12)
    with np.errstate(all="ignore"):  # a step too far is no valid camera, and is taken back
        # parameters differ by many powers of ten: scaled by the columns of the Jacobian
        solution = least_squares(
            errors_px, inside, bounds=(low, high), x_scale="jac",
            ftol=1e-10, xtol=1e-14, gtol=1e-15, max_nfev=100,
        )  # fmt: skip
    before = errors_px(first)
    if not 2.0 * solution.cost < float(before @ before):
        return start, np.eye(3)
    return parameters.camera(solution.x[:count]), turn_of(solution.x)


def _evaluate(
    source: CentralCamera, target: CameraT, mirrored: bool, rotation: Floats
) -> Fit[CameraT]:
    """Fit with residuals at pixels not used by the fit; refuses a target that sees none of them."""
    samples = samples_of(source, mirrored, phase=0.5).rotated(rotation)
    seen = target.pixel_from_ray(samples.directions)
    if not seen.valid.any():
        raise CalibrationError(
            f"camera: the fields of view of {target.model_name} and {source.model_name} do not "
            "overlap" + _hint(source, mirrored)
        )
    errors_px = np.linalg.norm(seen.positions_px - samples.pixels_px, axis=-1)
    # the edge's samples would count for more than their share of the image
    on_area = errors_px[seen.valid & samples.on_area]
    residuals = Residuals(
        float(np.sqrt(np.mean(on_area * on_area))) if len(on_area) else math.inf,
        float(errors_px[seen.valid].max()),
        float(samples.theta_rad[seen.valid].max()),
        source.model_name,
    )
    shown = seen.valid[samples.on_area] if samples.on_area.any() else seen.valid
    return Fit(target, residuals, float(np.mean(shown)), rotation)


def _failure(camera: CentralCamera, model: type[CentralCamera], reason: str) -> CalibrationError:
    names = (name for name, kind in CAMERA_MODELS.items() if kind is model)
    target = next(names, model.__name__)
    source = camera.model_name
    return CalibrationError(f"camera: model {source!r} cannot be fitted by {target}: {reason}")


def _hint(source: CentralCamera, mirrored: bool) -> str:
    is_mirror = optical_axis(source) < 0.0
    return "; the rays of a mirror need mirrored=True" if is_mirror and not mirrored else ""
