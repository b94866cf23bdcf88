"""The best fit of one camera model to another, and how far off it is.

A fit makes smallest the sum of squared distances in the picture, in pixels, over pixels spread
evenly over what the source shows, its edge included. Where both models can say the same, the
linear start (`fit_start`) already is the answer; otherwise Levenberg and Marquardt's method goes
on from there. The distances that a fit states are of other pixels than it was made from.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from omnisim.calibration.fit_start import Samples, start_of
from omnisim.cameras import CentralCamera
from omnisim.cameras.domain import corner_pixels, edge_pixels, middle_px, optical_axis
from omnisim.errors import CalibrationError, OpticsError

EXACT_PX = 1e-10  # rounding of a projection
MARGIN_RAD = 1e-9  # the source's edge, rounded, is still seen
LEAST_SHARE = 0.05  # of the source's pixels; less is no picture of it
MOST_OFF = 0.02  # RMS as a share of the picture's longer side; more is another kind of picture
INNER, ON_EDGE = 1000, 120  # samples
STEEPEST_RAD = math.radians(80.0)  # further out a tangent's pixels would drown all others
GOLDEN = 1.32471795724474602596  # the plastic number: its powers fill the plane evenly

# What a fit is free to choose, and between which limits; None: no limit.
_FREE: dict[str, dict[str, tuple[float | None, float | None]]] = {
    "perspective": {"focal_length_px": (0.0, None), "principal_point_px": (None, None)},
    "kannala_brandt": {
        "focal_lengths_px": (0.0, None),
        "principal_point_px": (None, None),
        "coefficients": (None, None),
    },
    "unified": {
        "focal_lengths_px": (0.0, None),
        "principal_point_px": (None, None),
        "xi": (0.0, None),
        "distortion": (None, None),
    },
    "eucm": {
        "focal_lengths_px": (0.0, None),
        "principal_point_px": (None, None),
        "alpha": (0.0, 1.0),
        "beta": (1e-9, None),
    },
    "double_sphere": {
        "focal_lengths_px": (0.0, None),
        "principal_point_px": (None, None),
        "xi": (-0.999, 0.999),
        "alpha": (0.0, 1.0),
    },
    "ocamcalib": {
        "principal_point_px": (None, None),
        "polynomial": (None, None),
        "affine": (None, None),
    },
    "f_theta": {"principal_point_px": (None, None), "coefficients_px": (None, None)},
    "f_theta_inverse": {"principal_point_px": (None, None), "coefficients": (None, None)},
    "radial_table": {"principal_point_px": (None, None), "radii_px": (None, None)},
    "gazebo": {
        "principal_point_px": (None, None),
        "c1": (1e-9, None),
        "c2": (1e-9, None),
        "c3": (None, 0.0),
    },
    **{
        model: {"focal_length_px": (0.0, None), "principal_point_px": (None, None)}
        for model in ("equidistant", "stereographic", "equisolid", "orthographic")
    },
}
FITTED_MODELS = tuple(_FREE)


@dataclass(frozen=True)
class Residuals:
    """How far one camera's pixels are from another's, for the same rays.

    Attributes:
        rms_px: root mean square of the distances, evenly over the pixels that both show.
        max_px: largest distance there and on the edge.
        covered: share of the source's valid pixels that the other camera shows.
        theta_max_rad: largest angle from +z of the rays that both show.
    """

    rms_px: float
    max_px: float
    covered: float
    theta_max_rad: float


@dataclass(frozen=True, eq=False)
class Fit:
    """A camera in another model.

    Attributes:
        camera: it.
        mirrored: its rays are the source's in a mirrored frame.
        fitted_from_source: (3, 3) the matrix that takes the source's rays to the fit's: the unit
            matrix, or `mirrored_frame` of the source.
        rms_px, max_px, covered, theta_max_rad: see `Residuals`; over the source's valid cone, at
            pixels that the fit was not made from.
    """

    camera: CentralCamera
    mirrored: bool
    fitted_from_source: NDArray[np.float64]
    rms_px: float
    max_px: float
    covered: float
    theta_max_rad: float

    @property
    def is_exact(self) -> bool:
        """Whether the two cameras are the same, to rounding, all over the source's picture."""
        return self.covered == 1.0 and self.max_px <= 1e-9


def fit_camera(
    camera: CentralCamera,
    model: type[CentralCamera],
    *,
    mirrored: bool = False,
    fixed: Mapping[str, Any] | None = None,
) -> Fit:
    """Fit a model to a camera.

    Args:
        camera: the source.
        model: the target's class, one of those whose names are in `FITTED_MODELS`, or the
            source's own.
        mirrored: take the source's rays in a mirrored frame, see `mirrored_frame`: mirrors look
            down −z of their optical frame, where most models see nothing.
        fixed: attributes of the target that are given: `{"xi": 0.0}` makes the unified model a
            pinhole camera with radial and tangential distortion.

    Raises:
        CalibrationError: a model that cannot be fitted, or one that cannot see what the source
            shows.
    """
    fixed = dict(fixed or {})
    if type(camera) is model and not mirrored and not fixed:
        return _stated(camera, camera, mirrored)
    name = model.model_name if isinstance(model.model_name, str) else model.__name__
    if name not in _FREE:
        raise CalibrationError(
            f"camera: model {camera.model_name!r} cannot be fitted by {name}: want one of "
            + ", ".join(FITTED_MODELS)
        )
    samples = samples_of(camera, mirrored)
    theta_max_rad = float(samples.theta_rad.max(initial=0.0))
    try:
        best = start_of(name, camera, samples, fixed)
        if _largest_px(best, samples) > EXACT_PX:
            best = _refined(best, _used(best, samples, fixed), _FREE[name], fixed)
        if "theta_max_rad" in {field.name for field in dataclasses.fields(best)}:
            best = _ended(best, theta_max_rad)
    except OpticsError as reason:
        raise CalibrationError(
            f"camera: model {camera.model_name!r} cannot be fitted by {name}: {reason}"
            + _hint(camera, mirrored)
        ) from None
    fit = _stated(camera, best, mirrored)
    if fit.covered < LEAST_SHARE:
        raise CalibrationError(
            f"camera: model {camera.model_name!r} cannot be fitted by {name}: it would show "
            f"{100.0 * fit.covered:.1f} % of the valid pixels" + _hint(camera, mirrored)
        )
    if fit.rms_px > MOST_OFF * max(camera.width_px, camera.height_px):
        raise CalibrationError(
            f"camera: model {camera.model_name!r} cannot be fitted by {name}: the best found is "
            f"off by {fit.rms_px:.3g} px RMS"
        )
    return fit


@lru_cache(maxsize=4)  # one camera is fitted by several models
def samples_of(camera: CentralCamera, mirrored: bool, turned: float = 0.0) -> Samples:
    """Pixels that see something, evenly all over the picture and on the edge, and their rays.

    Args:
        camera: the camera.
        mirrored: rays in `mirrored_frame`.
        turned: another number, from 0 to 1, gives others.
    """
    steps = np.arange(1, INNER + 1)[:, None] / np.array([GOLDEN, GOLDEN**2]) + turned
    inner = steps % 1.0 * (camera.width_px, camera.height_px) - 0.5
    pixels = np.concatenate((inner, edge_pixels(camera, ON_EDGE, turned), corner_pixels(camera)))
    rays = camera.ray_from_pixel(pixels)
    directions = rays.directions[rays.valid]
    if mirrored:
        directions = directions @ mirrored_frame(camera).T
    on_area = np.arange(len(pixels)) < INNER
    return Samples(pixels[rays.valid], directions, on_area[rays.valid])


def residuals(source: CentralCamera, target: CentralCamera, *, mirrored: bool) -> Residuals:
    """Compare a source with a target, at pixels that no fit was made from.

    Raises:
        CalibrationError: the target sees nothing of what the source shows.
    """
    samples = samples_of(source, mirrored, turned=0.5)
    seen = target.pixel_from_ray(samples.directions)
    if not seen.valid.any():
        raise CalibrationError(
            f"camera: a {target.model_name} sees nothing of what a {source.model_name} shows"
            + _hint(source, mirrored)
        )
    off = np.linalg.norm(seen.positions_px - samples.pixels_px, axis=-1)
    # the edge's samples would count for more than their share of the picture
    on_area = off[seen.valid & samples.on_area]
    return Residuals(
        float(np.sqrt(np.mean(on_area * on_area))) if len(on_area) else math.inf,
        float(off[seen.valid].max()),
        float(np.mean(seen.valid)),
        float(samples.theta_rad[seen.valid].max()),
    )


def _hint(source: CentralCamera, mirrored: bool) -> str:
    is_mirror = optical_axis(source) < 0.0
    return "; a mirror's rays have to be mirrored" if is_mirror and not mirrored else ""


def _stated(source: CentralCamera, target: CentralCamera, mirrored: bool) -> Fit:
    found = residuals(source, target, mirrored=mirrored)
    frame = mirrored_frame(source) if mirrored else np.eye(3)
    return Fit(target, mirrored, frame, **dataclasses.asdict(found))


def mirrored_frame(source: CentralCamera) -> NDArray[np.float64]:
    """The matrix (3, 3) from a mirror's optical frame to one in which its picture is a lens's.

    (x, y, −z), a reflection as the mirror itself is one; (−x, −y, −z) where the picture is also
    turned upside down, as the elliptic mirror's. It is its own inverse.
    """
    beside = source.ray_from_pixel(middle_px(source) + (0.25, 0.0)).directions
    turn = -1.0 if beside[0] < 0.0 else 1.0
    return np.diag([turn, turn, -1.0])


def _ended(camera: Any, theta_max_rad: float) -> Any:
    """The camera with its domain ended where the source's ends: past it the fit means nothing."""
    highest = getattr(type(camera), "largest_theta_rad", math.pi)
    return dataclasses.replace(camera, theta_max_rad=min(theta_max_rad + MARGIN_RAD, highest))


def _largest_px(camera: CentralCamera, samples: Samples) -> float:
    seen = camera.pixel_from_ray(samples.directions)
    if not seen.valid.all():
        return math.inf
    return float(np.abs(seen.positions_px - samples.pixels_px).max())


def _used(camera: CentralCamera, samples: Samples, fixed: Mapping[str, Any]) -> Samples:
    """The samples that the target can see, and near its plane of 90° only if it is no plane."""
    used = camera.pixel_from_ray(samples.directions).valid
    if camera.model_name == "perspective" or fixed.get("xi") == 0.0:
        used &= samples.theta_rad <= STEEPEST_RAD
    if used.sum() < 20:
        raise OpticsError("it sees nothing, or next to nothing, of what that shows")
    return Samples(*(one[used] for one in samples))


def _refined(
    start: Any,
    samples: Samples,
    free: Mapping[str, tuple[float | None, float | None]],
    fixed: Mapping[str, Any],
) -> Any:
    """The camera with the smallest sum of squared distances that is found from `start`."""
    names = [name for name in free if name not in fixed]
    values = [np.atleast_1d(getattr(start, name)).astype(np.float64) for name in names]
    ends = np.cumsum([len(value) for value in values])[:-1]
    first = np.concatenate(values)
    low, high = (
        np.repeat(
            [infinite if free[name][side] is None else free[name][side] for name in names],
            [len(value) for value in values],
        ).astype(np.float64)
        for side, infinite in ((0, -math.inf), (1, math.inf))
    )
    penalty = np.full(2 * len(samples.pixels_px), float(start.width_px + start.height_px))

    def made(vector: NDArray[np.float64]) -> Any:
        parts = np.split(vector, ends)
        changes = {
            name: tuple(part.tolist())
            if isinstance(getattr(start, name), tuple)
            else float(part[0])
            for name, part in zip(names, parts, strict=True)
        }
        return dataclasses.replace(start, **changes)

    def off(vector: NDArray[np.float64]) -> NDArray[np.float64]:
        try:
            seen = made(vector).pixel_from_ray(samples.directions)
        except OpticsError:
            return penalty  # no camera at all
        distances = seen.positions_px - samples.pixels_px
        distances[~seen.valid] = penalty[0]
        return distances.ravel()

    inside = np.clip(first, low + 1e-12, high - 1e-12)
    with np.errstate(all="ignore"):  # a step too far is no camera, and is taken back
        # parameters differ by many powers of ten: the columns of the Jacobian say by how many
        found = least_squares(
            off, inside, bounds=(low, high), x_scale="jac",
            ftol=1e-10, xtol=1e-14, gtol=1e-15, max_nfev=100,
        )  # fmt: skip
    before = off(first)
    return made(found.x) if 2.0 * found.cost < float(before @ before) else start
