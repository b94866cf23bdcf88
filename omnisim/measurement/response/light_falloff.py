"""Vignetting from flat fields: an even polynomial of the image radius, and the light's gradient.

Source: Goldman, "Vignette and exposure calibration and compensation", PAMI 2010.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_erosion, median_filter

from omnisim.core.arrays import Bools, Floats
from omnisim.core.errors import MeasurementError
from omnisim.measurement.inputs import read_photo
from omnisim.measurement.quantity import Quantity
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.rendering.camera.degradations.vignetting import MAX_TERMS, Vignetting

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
    rate = min(_RATES, key=lambda one: _misfit(even[judged], squared[judged], float(one)))
    wide = _fit(light, squared, offsets, MIN_TERMS + 1, float(rate), brightest)
    profiles = [*polynomials[:2], wide, *polynomials[2:]]  # by their number of unknowns
    errors = [float(np.sqrt(np.mean(np.square(one.residuals[judged])))) for one in profiles]
    limit = max(_MAX_ERROR_RATIO * min(errors), _MIN_ERROR * brightest)
    return next(one for one, rms in zip(profiles, errors, strict=True) if rms <= limit)


def _misfit(light: Floats, squared: Floats, rate: float) -> float:
    """Sum of squared errors of a profile fitted to light (blocks,)."""
    terms = _terms(squared, MIN_TERMS + 1, rate)
    side = terms.T @ light
    return float(light @ light - side @ np.linalg.solve(terms.T @ terms, side))


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
