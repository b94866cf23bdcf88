"""Vignetting from flat fields: an even polynomial of the image radius, and the light's gradient.

Source: Goldman, "Vignette and exposure calibration and compensation", PAMI 2010.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion

from omnisim.core.errors import MeasurementError
from omnisim.measurement.quantity import Quantity
from omnisim.measurement.response.radial_profile import fit_profile
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.rendering.camera.degradations.vignetting import Vignetting

Floats = NDArray[np.float64]
BLOCKS = 60  # along the image's shorter side
MIN_BLOCK_PX, MAX_BLOCK_PX = 4, 16
MAX_RESIDUAL = 0.02  # share of the light: more is no evenly lit surface
MAX_GRADIENT = 0.25  # of the light across the image
MIN_LIGHT = 0.02  # of the brightest block: darker ones are outside of the image circle


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
            without the gradient, and the fitted profile.
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


def _covariance(design: Floats, residuals: Floats) -> Floats:
    """Covariance (parameters, parameters) of a linear fit's parameters."""
    freedom = max(len(residuals) - design.shape[1], 1)
    scale = np.linalg.norm(design, axis=0)
    inverse = np.linalg.pinv((design / scale).T @ (design / scale))
    variance = float(residuals @ residuals) / freedom
    covariance: Floats = inverse * variance / np.outer(scale, scale)
    return covariance
