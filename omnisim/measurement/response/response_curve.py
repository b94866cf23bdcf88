"""Response curve and vignetting, measured from images."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion, median_filter
from scipy.optimize import minimize_scalar

from omnisim.core.arrays import Bools, Floats
from omnisim.core.errors import MeasurementError
from omnisim.core.srgb import linear_from_srgb
from omnisim.measurement import Quantity
from omnisim.measurement.inputs import read_photo
from omnisim.rendering.camera.degradations.encoding import Encoding
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.rendering.camera.degradations.vignetting import MAX_TERMS, Vignetting

MIN_EXPOSURES = 3
LOW, HIGH = 0.03, 0.97  # levels that count, as shares of the largest one
MIN_BRIGHTEST, MAX_BRIGHTEST = 0.5, 1.001  # share of the largest level
MAX_PIXELS = 20_000
MAX_ERROR = 0.005  # of full scale, beyond what the solved curve leaves, for a named function
_KNOTS = 33  # of the solved curve, dense in the dark
_SMOOTHNESS = 0.1  # weight of the curve's second differences, in pixels


@dataclass(frozen=True, eq=False)
class MeasuredResponse:
    """Response of a camera."""

    encoding: Encoding  # named transfer function, or a curve
    quantities: tuple[Quantity, ...]  # exponent of the best power function, and error of `encoding`
    errors: dict[str, float]  # root mean square error of each function, as a share of full scale
    light: Floats  # (n,) solved curve: light as a share of the light of white
    levels: Floats  # (n,) its levels in [0, 1]


def measure_response(
    images: Sequence[NDArray[Any]],
    exposures_s: Sequence[float],
    black_dn: float = 0.0,
    white_dn: float = 255.0,
    name: str = "images",
) -> MeasuredResponse:
    """Measure the response of a camera.

    Args:
        images: for each exposure time, (height, width) levels of a static scene: of one image, or
            the mean of several.
        exposures_s: exposure times.
        black_dn, white_dn: level without light, and largest level.
        name: name of the images, for messages.

    Raises:
        MeasurementError: too few exposure times, images of several sizes, a wrong largest level,
            brightness that does not follow the exposure time, or too few levels between black and
            white.
    """
    order = np.argsort(exposures_s)
    times = np.asarray(exposures_s, dtype=np.float64)[order]
    if len(np.unique(times)) < MIN_EXPOSURES:
        raise MeasurementError(
            f"{name}: {len(np.unique(times))} exposure times: expected at least {MIN_EXPOSURES}"
        )
    if len({image.shape for image in images}) > 1:
        raise MeasurementError(f"{name}: images of several sizes: expected one camera")
    steps = [max(1, math.ceil(images[index].size / MAX_PIXELS)) for index in order]
    stack = np.stack([
        images[index].reshape(-1)[::step].astype(np.float64)
        for index, step in zip(order, steps, strict=True)
    ])  # fmt: skip
    levels = (stack - black_dn) / (white_dn - black_dn)
    brightest = float(np.max(levels))
    if not MIN_BRIGHTEST < brightest < MAX_BRIGHTEST:
        raise MeasurementError(
            f"{name}: the brightest pixel is at {100.0 * brightest:.0f} % of white, {white_dn:g}: "
            "expected exposure times up to white, and the camera's own white level"
        )
    means = np.median(levels, axis=1)
    for index in range(1, len(times)):
        if means[index] < means[index - 1] - 0.01:
            raise MeasurementError(
                f"{name}: {1e3 * times[index]:g} ms is darker than {1e3 * times[index - 1]:g} ms: "
                "expected a still scene, constant light, and no automatic exposure"
            )
    used = (levels > LOW) & (levels < HIGH)
    used &= used.sum(axis=0) >= 2
    if used.sum() < 200:
        raise MeasurementError(
            f"{name}: {int(used.sum())} levels between black and white: expected exposure times at "
            "which the scene is neither"
        )
    gamma = _best_gamma(levels, times, used)
    curves: dict[str, Callable[[Floats], Floats]] = {
        "linear": lambda values: values,
        "srgb": lambda values: linear_from_srgb(np.clip(values, 0.0, 1.0)),
        "gamma": lambda values: np.clip(values, 0.0, 1.0) ** gamma,
    }
    knots, light = _solved_curve(levels, times, used)
    curves["curve"] = lambda values: np.interp(values, knots, light)
    errors = {name: _error(curve, levels, times, used) for name, curve in curves.items()}
    # the function with the smallest error, or a simpler one that is nearly as good
    nearly = [
        name
        for name in ("linear", "srgb")
        if errors[name] <= 1.05 * min(errors["gamma"], errors[name]) + 2e-4
    ]
    best = (*nearly, "gamma")[0]
    if errors[best] > math.hypot(errors["curve"], MAX_ERROR):
        best = "curve"
    encodings = {
        "linear": Encoding(gamma=1.0),
        "srgb": Encoding(gamma="srgb"),
        "gamma": Encoding(gamma=gamma),
        "curve": Encoding(curve=tuple(zip(light.tolist(), knots.tolist(), strict=True))),
    }
    basis = f"{int(used.any(axis=0).sum())} pixels at {len(times)} exposure times"
    # standard deviation of the exponent, from eighths of the pixels; NaN: too few pixels
    parts = [
        _best_gamma(levels[:, start::8], times, used[:, start::8])
        for start in range(8)
        if used[:, start::8].sum() >= 20
    ]
    sigma = float(np.std(parts, ddof=1) / math.sqrt(len(parts))) if len(parts) > 2 else math.nan
    quantities = (
        Quantity("gamma", gamma, sigma, "", f"{basis}, as a power"),
        Quantity("response_error", errors[best], math.nan, "of full scale", f"{basis}, as {best}"),
    )
    return MeasuredResponse(encodings[best], quantities, errors, light, knots)


def _error(
    inverse: Callable[[Floats], Floats], levels: Floats, times: Floats, used: Bools
) -> float:
    """Root mean square error of levels (images, pixels) predicted with an inverse response.

    White is 1; levels that are not `used` are too dark or too bright.
    """
    # of each pixel, from its mean light per second
    weights = used * times[:, None]
    per_second = (inverse(levels) * used).sum(axis=0) / np.maximum(weights.sum(axis=0), 1e-30)
    light = per_second * times[:, None]
    # back to levels along the inverse's slope
    grid = np.linspace(0.0, 1.0, 2049)
    expected = np.interp(light, inverse(grid), grid)
    return float(np.sqrt(np.mean(np.square((expected - levels)[used]))))


def _best_gamma(levels: Floats, times: Floats, used: Bools) -> float:
    """Exponent of the power that explains the levels best."""

    def error(gamma: float) -> float:
        return _error(lambda values: np.clip(values, 0.0, 1.0) ** gamma, levels, times, used)

    return float(minimize_scalar(error, bounds=(0.3, 4.0), method="bounded").x)


def _solved_curve(levels: Floats, times: Floats, used: Bools) -> tuple[Floats, Floats]:
    """Levels (n,) of the knots, from 0 to 1, and their light (n,), 1 at the last knot.

    The logarithm of the light is the logarithm of the level plus a function that is linear between
    knots. Subtracting the weighted mean of a pixel's equations eliminates that pixel's light.
    """
    knots = np.linspace(0.0, 1.0, _KNOTS) ** 2
    weights = np.where(used, levels, 0.0) ** 2  # noise of a logarithm falls with the level
    normal = np.zeros((_KNOTS, _KNOTS))
    right = np.zeros(_KNOTS)
    total = np.maximum(weights.sum(axis=0), 1e-30)
    known = np.log(times)[:, None] - np.log(np.clip(levels, 1e-6, None))
    known -= (weights * known).sum(axis=0) / total
    rows = np.zeros((len(times), levels.shape[1], _KNOTS))
    index = np.clip(np.searchsorted(knots, levels, side="right") - 1, 0, _KNOTS - 2)
    share = np.clip((levels - knots[index]) / (knots[index + 1] - knots[index]), 0.0, 1.0)
    np.put_along_axis(rows, index[..., None], 1.0 - share[..., None], axis=2)
    np.put_along_axis(rows, index[..., None] + 1, share[..., None], axis=2)
    rows -= (weights[..., None] * rows).sum(axis=0) / total[:, None]
    for row, value, weight in zip(rows, known, weights, strict=True):
        normal += row.T @ (weight[:, None] * row)
        right += row.T @ (weight * value)
    bend = np.diff(np.eye(_KNOTS), 2, axis=0)
    normal += _SMOOTHNESS * bend.T @ bend
    normal[-1, -1] += 1.0  # the light of white is 1: its logarithm is 0
    offsets = np.linalg.solve(normal, right)
    light = knots * np.exp(offsets - offsets[-1])
    rising: Floats = np.maximum.accumulate(light + 1e-9 * np.arange(_KNOTS))
    return knots, rising / rising[-1]


# Vignetting from flat fields: an even polynomial of the image radius, and the light's gradient.
#
# Source: Goldman, "Vignette and exposure calibration and compensation", PAMI 2010.


BLOCKS = 60  # along the image's shorter side
MIN_BLOCK_PX, MAX_BLOCK_PX = 4, 16
MAX_RESIDUAL = 0.02  # share of the light: more is no evenly lit surface
MAX_GRADIENT = 0.25  # of the light across the image
MIN_LIGHT = 0.02  # of the brightest block: darker ones are outside of the image circle


@dataclass(frozen=True, eq=False)
class MeasuredVignetting:
    """Vignetting measured from a flat field."""

    vignetting: Vignetting  # degradation for the sensor file, with the fitted coefficients
    # the coefficients, and the relative light at the largest fitted radius
    quantities: tuple[Quantity, ...]
    gradient: Floats  # (2,) relative change of the illumination over the image's width and height
    residual: float  # root mean square error of the fit, as a share of the light in the middle
    middle: float  # light in the middle of the image, in the units of the flat field
    # radii, light, fitted: (blocks,) radius in units of half the shorter side, relative light
    # without the gradient, and the fitted profile
    radii: Floats
    light: Floats
    fitted: Floats


def measure_vignetting(
    flat: Floats, center_px: tuple[float, float] | None = None, name: str = "flat field"
) -> MeasuredVignetting:
    """Measure vignetting from the mean of flat fields.

    Fits the mean light of blocks of 4 × 4 to 16 × 16 px. Blocks that differ by more than four
    standard deviations from those of about the same radius, such as dust, are ignored, and so are
    blocks beside the edge of the image circle.

    Args:
        flat, name: (height, width) linear light, without black level (NaN: invalid); its name.
        center_px: principal point; None: the middle of the image.

    Raises:
        MeasurementError: no light, light that changes by more than 25 % across the image, or light
            that vignetting does not explain.
    """
    height, width = flat.shape
    center = center_px or (0.5 * (width - 1.0), 0.5 * (height - 1.0))
    geometry = ImageGeometry(width, height, center)
    block_px = int(np.clip(min(flat.shape) // BLOCKS, MIN_BLOCK_PX, MAX_BLOCK_PX))
    light, u, v = _lit_blocks(flat, block_px)
    if not len(light):
        raise MeasurementError(f"{name}: no light: expected an evenly lit surface")
    brightest = float(np.percentile(light, 99.0))
    spread_px2 = (block_px**2 - 1.0) / 6.0  # mean square radius of a block's pixels in it
    squared = (u - center[0]) ** 2 + (v - center[1]) ** 2 + spread_px2
    squared /= geometry.radius_unit_px**2
    x, y = (u - center[0]) / width, (v - center[1]) / height
    fit = fit_profile(light, squared, np.stack((x, y), axis=1), brightest)
    solution, gradient, is_kept = fit.solution, fit.gradient, fit.is_kept
    terms = fit.terms(squared)
    even = terms @ solution
    slope = 1.0 + x * gradient[0] + y * gradient[1]
    residual = fit.rms / float(solution[0])
    _check(name, residual, gradient, float(is_kept.mean()))
    design = np.column_stack((terms * slope[:, None], even * x, even * y))
    covariance = _covariance(design[is_kept], fit.residuals[is_kept])
    edge = float(np.sqrt(squared[is_kept].max()))
    matrix = fit.polynomial_from_solution(float(geometry.squared_radii().max()))
    coefficients = matrix @ solution
    count = len(solution)
    variances = np.einsum("pi,ij,pj->p", matrix, covariance[:count, :count], matrix)
    vignetting = Vignetting(tuple(coefficients.tolist()))
    basis = f"{is_kept.sum()} blocks of {block_px} × {block_px} px, to a radius of {edge:.2f}"
    quantities = [
        Quantity(f"coefficients.{index}", float(value), float(sigma), "", basis)
        for index, (value, sigma) in enumerate(zip(coefficients, np.sqrt(variances), strict=True))
    ]
    at_edge = float((fit.terms(np.array([edge**2])) @ solution)[0] / solution[0])
    quantities.append(Quantity("light_at_edge", at_edge, residual, "", basis))
    return MeasuredVignetting(
        vignetting, tuple(quantities), gradient, residual, float(solution[0]),
        np.sqrt(squared), light / slope / solution[0], even / solution[0],
    )  # fmt: skip


def _lit_blocks(flat: Floats, block_px: int) -> tuple[Floats, Floats, Floats]:
    """Mean light of blocks, and their centers u and v in px; only blocks in the image circle.

    Blocks with invalid pixels or with little light, and their neighbors, are left out.
    """
    rows, columns = (side // block_px for side in flat.shape)
    whole = flat[: rows * block_px, : columns * block_px]
    means = whole.reshape(rows, block_px, columns, block_px).mean(axis=(1, 3))
    v, u = np.mgrid[:rows, :columns] * block_px + 0.5 * (block_px - 1.0)
    finite = means[np.isfinite(means)]
    limit = max(MIN_LIGHT * float(np.percentile(finite, 99.0)), 0.0) if len(finite) else math.inf
    is_lit = np.nan_to_num(means) > limit
    is_inside = binary_erosion(is_lit, np.ones((3, 3), dtype=np.bool_), border_value=1)
    return means[is_inside], u[is_inside], v[is_inside]


def _check(name: str, residual: float, gradient: Floats, kept: float) -> None:
    """Reject a surface that is not evenly lit; `kept` is the share of blocks without outliers."""
    change = float(np.abs(gradient).max())
    if change > MAX_GRADIENT:
        raise MeasurementError(
            f"{name}: the light changes by {100.0 * change:.0f} % across the image: expected an "
            f"evenly lit surface, to {100.0 * MAX_GRADIENT:.0f} %"
        )
    if residual > MAX_RESIDUAL or kept < 0.8:
        raise MeasurementError(
            f"{name}: vignetting leaves {100.0 * residual:.1f} % of the light unexplained in "
            f"{100.0 * kept:.0f} % of the image: expected an evenly lit surface without structure"
        )


def _covariance(design: Floats, residuals: Floats) -> Floats:
    """Covariance (parameters, parameters) of a linear fit's parameters."""
    freedom = max(len(residuals) - design.shape[1], 1)
    scale = np.linalg.norm(design, axis=0)
    inverse = np.linalg.pinv((design / scale).T @ (design / scale))
    variance = float(residuals @ residuals) / freedom
    return inverse * variance / np.outer(scale, scale)


# Light by image radius, fitted to blocks of a flat field, as the polynomial of a sensor file.
#
# A polynomial of few powers does not follow the cos⁴ law over a wide field: least squares leave its
# largest errors in the corners, where there are few blocks. A profile (a + b r² + c r⁴ + d r⁶) /
# (1 + k r²)² follows it with fewer unknowns; the polynomial is then interpolated from the profile.
#
# Source: Trefethen, "Approximation Theory and Approximation Practice" (2013), for Chebyshev points.


MIN_TERMS = 3
_RATES = np.geomspace(0.05, 4.0, 24)  # squared tangents at r = 1: fields up to 127° across
_RING = 31  # blocks of about the same radius
_MIN_SPREAD = 2.5e-4  # of the light: what is off by less than four of it is no outlier
_MIN_ERROR = 5e-5  # of the light: smaller errors are as good
_MAX_ERROR_RATIO = 1.005  # times the smallest error of all profiles
_ROUNDS, _MIN_ROUNDS = 6, 2  # profile and gradient converge in two
_POINTS = 200


class RadialProfile(NamedTuple):
    """Light (a + b r² + c r⁴ + …) / (1 + k r²)² of blocks, and its gradient over the image."""

    solution: Floats  # (terms,) coefficients a, b, c and so on
    rate: float  # k, the squared tangent of the field angle at r = 1; 0: a polynomial
    gradient: Floats  # (2,) relative change of the light over the image's width and height
    is_kept: Bools  # (blocks,) False: outliers
    residuals: Floats  # (blocks,) measured minus fitted light

    @property
    def rms(self) -> float:
        """Root mean square of the residuals of the kept blocks."""
        return float(np.sqrt(np.mean(np.square(self.residuals[self.is_kept]))))

    def terms(self, squared: Floats) -> Floats:
        """Functions (n, terms) of squared radii (n,); their sum by `solution` is the profile."""
        return _terms(squared, len(self.solution), self.rate)

    def polynomial_from_solution(self, largest_squared: float) -> Floats:
        """Matrix (powers, terms) from `solution` to coefficients of r², r⁴ and so on.

        The polynomial is that of a field up to a squared radius, in units of the light at r = 0.
        """
        count = len(self.solution)
        if self.rate == 0.0:
            return np.eye(count)[1:] / self.solution[0]
        angles = np.pi * (np.arange(_POINTS) + 0.5) / _POINTS
        squared = 0.5 * largest_squared * (1.0 - np.cos(angles))
        powers = _terms(squared, MAX_TERMS + 1, 0.0)
        relative = self.terms(squared) - _terms(np.zeros(1), count, self.rate)
        matrix = np.linalg.lstsq(powers[:, 1:], relative, rcond=None)[0]
        return matrix / self.solution[0]


def fit_profile(light: Floats, squared: Floats, offsets: Floats, brightest: float) -> RadialProfile:
    """Fit the profile with the fewest unknowns among those as good as the best one.

    Light, squared radius (blocks,) in units of half the shorter side, and offsets (blocks, 2) from
    the center, as shares of the image's width and height.
    """
    polynomials = [
        _fit(light, squared, offsets, count + 1, 0.0, brightest)
        for count in range(MIN_TERMS, MAX_TERMS + 1)
    ]
    judged = polynomials[-1].is_kept
    even = light / (1.0 + offsets @ polynomials[-1].gradient)

    def misfit(rate: float) -> float:  # sum of squared errors of a profile
        terms = _terms(squared[judged], MIN_TERMS + 1, rate)
        side = terms.T @ even[judged]
        rest = side @ np.linalg.solve(terms.T @ terms, side)
        return float(even[judged] @ even[judged] - rest)

    rate = min(_RATES.tolist(), key=misfit)
    wide = _fit(light, squared, offsets, MIN_TERMS + 1, rate, brightest)
    profiles = [*polynomials[:2], wide, *polynomials[2:]]  # by their number of unknowns
    errors = [float(np.sqrt(np.mean(np.square(profile.residuals[judged])))) for profile in profiles]
    limit = max(_MAX_ERROR_RATIO * min(errors), _MIN_ERROR * brightest)
    return next(profile for profile, rms in zip(profiles, errors, strict=True) if rms <= limit)


def _terms(squared: Floats, count: int, rate: float) -> Floats:
    """Functions (n, count) of squared radii (n,): powers from r⁰, divided by (1 + k r²)²."""
    terms: Floats = np.vander(squared, count, increasing=True)
    terms /= np.square(1.0 + rate * squared)[:, None]
    return terms


def _fit(
    light: Floats, squared: Floats, offsets: Floats, count: int, rate: float, brightest: float
) -> RadialProfile:
    """Fit profile × (1 + g · (x, y)): profile and g in turn, without outliers.

    `count` is the number of the profile's terms, `rate` that of `RadialProfile`; for the others,
    see `fit_profile`.
    """
    terms = _terms(squared, count, rate)
    is_kept: Bools = np.ones(len(light), dtype=bool)
    gradient: Floats = np.zeros(2)
    solution: Floats = np.zeros(count)
    for number in range(_ROUNDS):
        design = terms * (1.0 + offsets @ gradient)[:, None]
        solution[:] = np.linalg.lstsq(design[is_kept], light[is_kept], rcond=None)[0]
        even = terms @ solution
        tilt = even[:, None] * offsets
        gradient[:] = np.linalg.lstsq(tilt[is_kept], (light - even)[is_kept], rcond=None)[0]
        residuals = light - even * (1.0 + offsets @ gradient)
        before = is_kept
        # a misfit of the profile is the same all around, and no outlier: otherwise the corners of
        # wide fields would be left out, where the polynomial then rises at will
        order = np.argsort(squared, kind="stable")
        medians = np.empty_like(residuals)
        medians[order] = median_filter(residuals[order], size=_RING, mode="nearest")
        deviations = np.abs(residuals - medians)
        spread = 1.4826 * float(np.median(deviations[is_kept]))
        is_kept = deviations <= 4.0 * max(spread, _MIN_SPREAD * brightest)
        if number >= _MIN_ROUNDS and np.array_equal(before, is_kept):
            break
    return RadialProfile(solution, rate, gradient, is_kept, residuals)


# Mean of images of a static scene.


MAX_CLIPPED = 0.01  # share of a flat field's values


def mean_image(files: Sequence[Path], channel: int) -> tuple[Floats, float]:
    """Mean (height, width) of a channel of images of one size, and the largest possible value.

    The channel is ignored for gray images.

    Raises:
        MeasurementError: no files, a file that cannot be read, a bit depth other than 8 or 16, or
            images of several sizes or bit depths.
    """
    if not files:
        raise MeasurementError("expected images, got none")
    total: Floats | None = None
    largest = 0.0
    for path in files:
        pixels = read_photo(path)
        if pixels.dtype not in (np.uint8, np.uint16):
            raise MeasurementError(f"{path}: expected 8 or 16 bits, got {pixels.dtype}")
        plane = pixels[..., min(channel, pixels.shape[2] - 1)].astype(np.float64)
        highest = 255.0 if pixels.dtype == np.uint8 else 65535.0
        if total is not None and (total.shape != plane.shape or highest != largest):
            raise MeasurementError(
                f"{path}: {plane.shape[1]} × {plane.shape[0]} px, white is {highest:g}, but "
                f"{files[0].name} has {total.shape[1]} × {total.shape[0]} px, white is "
                f"{largest:g}: expected the images of one camera"
            )
        total, largest = plane if total is None else total + plane, highest
    assert total is not None
    return total / len(files), largest


def check_unclipped(flat: Floats, largest: float, name: str) -> None:
    """Reject a flat field (height, width), the mean of images, with too many white pixels.

    Raises:
        MeasurementError: more than 1 % of the pixels are at the level `largest` of white.
    """
    clipped = float(np.mean(flat >= 0.995 * largest))
    if clipped > MAX_CLIPPED:
        raise MeasurementError(
            f"{name}: {100.0 * clipped:.0f} % of the pixels are white: expected a shorter exposure"
        )
