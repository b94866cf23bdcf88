"""Vignetting from flat fields: an even polynomial of the image radius, and the light's gradient.

Source: Goldman, "Vignette and exposure calibration and compensation", PAMI 2010.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion, median_filter

from omnisim.core.errors import MeasurementError
from omnisim.measurement.quantity import Quantity
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.rendering.camera.degradations.vignetting import MAX_TERMS, Vignetting

Floats = NDArray[np.float64]
BLOCKS = 60  # along the image's shorter side
MIN_BLOCK_PX, MAX_BLOCK_PX = 4, 16
MAX_RESIDUAL = 0.02  # share of the light: more is no evenly lit surface
MAX_GRADIENT = 0.25  # of the light across the image
MIN_LIGHT = 0.02  # of the brightest block: darker ones are outside of the image circle
MIN_TERMS = 3
_LEAST_ERROR = 5e-5  # of the light: smaller errors are as good
_RING = 31  # blocks of about the same radius
_LEAST_SPREAD = 2.5e-4  # of the light: what is off by less than four of it is no outlier
_AS_GOOD = 1.005  # times the error of all terms
_ROUNDS, _MIN_ROUNDS = 6, 2  # polynomial and gradient converge in two


@dataclass(frozen=True, eq=False)
class MeasuredVignetting:
    """Vignetting measured from a flat field.

    Attributes:
        vignetting: degradation for the sensor file, with the fitted coefficients.
        quantities: the coefficients, and the relative light at the largest fitted radius.
        gradient: (2,) relative change of the illumination over the image's width and height.
        residual: root mean square error of the fit, as a share of the light in the middle.
        middle: light in the middle of the image, in the units of the flat field.
        radii, light, fitted: (blocks,) radius in units of half the shorter side, relative light
            without the gradient, and the fitted polynomial.
    """

    vignetting: Vignetting
    quantities: tuple[Quantity, ...]
    gradient: Floats
    residual: float
    middle: float
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
        flat: (height, width) linear light, without black level; NaN: invalid.
        center_px: principal point; None: the middle of the image.
        name: name of the images, for messages.

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
    fits = [
        _fit(light, squared, np.stack((x, y), axis=1), count, brightest)
        for count in range(MIN_TERMS, MAX_TERMS + 1)
    ]
    # judged at one set of blocks: too few powers would take the corners for outliers
    judged = fits[-1].is_kept
    errors = [float(np.sqrt(np.mean(np.square(one.residuals[judged])))) for one in fits]
    limit = max(_AS_GOOD * errors[-1], _LEAST_ERROR * brightest)
    fit = next(one for one, rms in zip(fits, errors, strict=True) if rms <= limit)
    solution, gradient, is_kept, residuals = fit.solution, fit.gradient, fit.is_kept, fit.residuals
    terms = squared[:, None] ** np.arange(len(solution))
    even = terms @ solution
    slope = 1.0 + x * gradient[0] + y * gradient[1]
    residual = fit.rms / float(solution[0])
    _check(name, residual, gradient, float(is_kept.mean()))
    design = np.column_stack((terms * slope[:, None], even * x, even * y))
    sigmas = _sigmas(design[is_kept], residuals[is_kept])
    coefficients = solution[1:] / solution[0]
    edge = float(np.sqrt(squared[is_kept].max()))
    vignetting = Vignetting(tuple(coefficients.tolist()))
    basis = f"{is_kept.sum()} blocks of {block_px} × {block_px} px, to a radius of {edge:.2f}"
    quantities = [
        Quantity(f"coefficients.{index}", float(value), float(sigma / solution[0]), "", basis)
        for index, (value, sigma) in enumerate(
            zip(coefficients, sigmas[1 : len(solution)], strict=True)
        )
    ]
    at_edge = float(edge ** (2.0 * np.arange(len(solution))) @ solution / solution[0])
    quantities.append(Quantity("light_at_edge", at_edge, residual, "", basis))
    relative = light / slope / solution[0]
    return MeasuredVignetting(
        vignetting,
        tuple(quantities),
        gradient,
        residual,
        float(solution[0]),
        np.sqrt(squared),
        relative,
        even / solution[0],
    )


class _Fit(NamedTuple):
    """Polynomial of the squared radius, and the light's gradient.

    Attributes:
        solution: (terms,) coefficients, from r⁰.
        gradient: (2,) relative change of the light over the image's width and height.
        is_kept: (blocks,) False: outliers.
        residuals: (blocks,) measured minus fitted light.
        rms: root mean square of the residuals of the kept blocks.
    """

    solution: Floats
    gradient: Floats
    is_kept: NDArray[np.bool_]
    residuals: Floats
    rms: float


def _fit(light: Floats, squared: Floats, offsets: Floats, count: int, brightest: float) -> _Fit:
    """Fit (a + b r² + c r⁴ + …) (1 + g · (x, y)): polynomial and g in turn, without outliers.

    Args:
        light: (blocks,) light.
        squared: (blocks,) squared radius, in units of half the shorter side.
        offsets: (blocks, 2) x and y from the center, as shares of the image's width and height.
        count: number of powers of r², without the constant.
        brightest: light of the brightest blocks.
    """
    terms = squared[:, None] ** np.arange(count + 1)
    is_kept: NDArray[np.bool_] = np.ones(len(light), dtype=bool)
    gradient: Floats = np.zeros(2)
    solution: Floats = np.zeros(count + 1)
    for number in range(_ROUNDS):
        design = terms * (1.0 + offsets @ gradient)[:, None]
        solution[:] = np.linalg.lstsq(design[is_kept], light[is_kept], rcond=None)[0]
        even = terms @ solution
        tilt = even[:, None] * offsets
        gradient[:] = np.linalg.lstsq(tilt[is_kept], (light - even)[is_kept], rcond=None)[0]
        residuals = light - even * (1.0 + offsets @ gradient)
        before = is_kept
        deviations = np.abs(residuals - _ring_medians(residuals, squared))
        spread = 1.4826 * float(np.median(deviations[is_kept]))
        is_kept = deviations <= 4.0 * max(spread, _LEAST_SPREAD * brightest)
        if number >= _MIN_ROUNDS and np.array_equal(before, is_kept):
            break
    rms = float(np.sqrt(np.mean(np.square(residuals[is_kept]))))
    return _Fit(solution, gradient, is_kept, residuals, rms)


def _ring_medians(residuals: Floats, squared: Floats) -> Floats:
    """Median residual (blocks,) of the blocks of about the same radius.

    What the polynomial misses is the same all around, and so is no outlier. Otherwise the corners
    of wide fields would be left out, where the polynomial then rises at will.
    """
    order = np.argsort(squared, kind="stable")
    medians = np.empty_like(residuals)
    medians[order] = median_filter(residuals[order], size=_RING, mode="nearest")
    return medians


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
    """Reject a surface that is not evenly lit; `kept` is the share of blocks without outliers.

    Raises:
        MeasurementError: the gradient or the residual is too large, or too many blocks are
            outliers.
    """
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


def _sigmas(design: Floats, residuals: Floats) -> Floats:
    """Standard deviations (parameters,) of a linear fit's parameters."""
    freedom = max(len(residuals) - design.shape[1], 1)
    scale = np.linalg.norm(design, axis=0)
    inverse = np.linalg.pinv((design / scale).T @ (design / scale))
    variance = float(residuals @ residuals) / freedom
    sigmas: Floats = np.sqrt(np.diagonal(inverse) * variance) / scale
    return sigmas
