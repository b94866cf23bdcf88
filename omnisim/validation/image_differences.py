"""Differences between two images: PSNR, structural similarity, and displacement of contents."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from omnisim.cameras import CentralCamera
from omnisim.core.arrays import Bools, Floats
from omnisim.core.srgb import srgb_from_linear
from omnisim.plots.style import BLUE, Figure, plot, show_between

_SIGMA_PX, _REACH = 1.5, 3.5  # a window of 11 px
_C1, _C2 = 0.01**2, 0.03**2
_LUMA = np.array((0.299, 0.587, 0.114))
PATCH_PX = 24


def psnr_db(first: NDArray[np.floating], second: NDArray[np.floating], mask: Bools) -> float:
    """PSNR of two linear RGB images (height, width, 3), compared as 8-bit sRGB.

    Only pixels in the mask (height, width) count. Equal images yield infinity; rounding to 8 bits
    limits the PSNR of nearly equal images to 56 dB.
    """
    levels = (np.rint(255.0 * srgb_from_linear(values[mask])) for values in (first, second))
    return psnr_of_levels_db(*levels)


def psnr_of_levels_db(first: NDArray[Any], second: NDArray[Any]) -> float:
    """PSNR of two arrays of 8-bit levels (...), 0 to 255; infinite: all levels are equal."""
    error = float(np.mean((first.astype(np.float64) - second) ** 2))
    return math.inf if error == 0.0 else 10.0 * math.log10(255.0**2 / error)


def noise_floor_db(first: NDArray[np.floating], second: NDArray[np.floating], mask: Bools) -> float:
    """PSNR between a sampled image and a perfect one, limited by the noise alone.

    `first` and `second` are linear RGB images sampled with different seeds. They differ by the
    noise of both: twice the variance of one image, so their PSNR is 3 dB lower.
    """
    return psnr_db(first, second, mask) + 10.0 * math.log10(2.0)


def converged_psnr_db(
    image: NDArray[np.floating],
    first: NDArray[np.floating],
    second: NDArray[np.floating],
    mask: Bools,
) -> float:
    """PSNR to a converged image, estimated from two images with independent noise.

    The mean product of the differences from both has the expectation of the squared error to the
    converged image: the noise averages out. All images are linear RGB (height, width, 3), compared
    as sRGB; only pixels in the mask (height, width) count.
    """
    level, one, other = (srgb_from_linear(values[mask]) for values in (image, first, second))
    error = float(np.mean((level - one) * (level - other)))
    return math.inf if error <= 0.0 else -10.0 * math.log10(error)


def ssim(first: NDArray[np.floating], second: NDArray[np.floating], mask: Bools) -> float:
    """Mean structural similarity of the luma of two images (height, width, 3), linear RGB.

    Only pixels in the mask (height, width) count; all others are set to black.

    Source: Wang et al., "Image quality assessment: from error visibility to structural similarity",
        2004, with its Gaussian window and constants.
    """
    one, other = (
        np.where(mask, srgb_from_linear(np.clip(values, 0.0, 1.0)) @ _LUMA, 0.0)
        for values in (first, second)
    )

    def mean(values: Floats) -> Floats:
        return gaussian_filter(values, _SIGMA_PX, truncate=_REACH)

    mean_one, mean_other = mean(one), mean(other)
    variance_one, variance_other = mean(one**2) - mean_one**2, mean(other**2) - mean_other**2
    covariance = mean(one * other) - mean_one * mean_other
    levels = (2.0 * mean_one * mean_other + _C1) / (mean_one**2 + mean_other**2 + _C1)
    structure = (2.0 * covariance + _C2) / (variance_one + variance_other + _C2)
    return float((levels * structure)[mask].mean())


class Displacements(NamedTuple):
    """Displacements of an image's patches, and the patches' centers."""

    middles_px: Floats  # (n, 2)
    shifts_px: Floats  # (n, 2)


def displacements(first: Floats, second: Floats, where: Bools) -> Displacements:
    """Shift of the second image in each patch inside `where` with edges in two directions.

    Least-squares solution of brightness constancy with the mean gradient of both images, for shifts
    far below a pixel.

    Args:
        first, second: gray images (height, width), values from 0 to 255.
        where: (height, width) pixels to use.

    Source: Lucas & Kanade, "An iterative image registration technique", 1981, one step.
    """
    down, right = np.gradient(0.5 * (first + second))
    change = first - second
    products = np.stack((right * right, right * down, down * down, right * change, down * change))
    rows, columns = first.shape[0] // PATCH_PX, first.shape[1] // PATCH_PX
    area = (rows * PATCH_PX, columns * PATCH_PX)

    def patches(values: NDArray[Any]) -> NDArray[Any]:
        whole = values[..., : area[0], : area[1]]
        shape = (*whole.shape[:-2], rows, PATCH_PX, columns, PATCH_PX)
        return whole.reshape(shape).swapaxes(-3, -2).reshape(*whole.shape[:-2], rows, columns, -1)

    xx, xy, yy, xt, yt = patches(products).sum(axis=-1)
    inside = patches(where).all(axis=-1)
    weaker = 0.5 * (xx + yy - np.hypot(xx - yy, 2.0 * xy))  # smaller eigenvalue
    # edges in both directions: 8 levels per pixel on average, far above a traced image's noise
    inside &= weaker > PATCH_PX**2 * 8.0**2
    determinant = np.where(inside, xx * yy - xy * xy, 1.0)
    shifts = np.stack((yy * xt - xy * yt, xx * yt - xy * xt), axis=-1) / determinant[..., None]
    v, u = np.indices((rows, columns))
    middles = (np.stack((u, v), axis=-1) + 0.5) * PATCH_PX - 0.5
    return Displacements(middles[inside], shifts[inside])


def displacement_figure(
    title: str, camera: CentralCamera, positions_px: Floats, shifts_px: Floats
) -> Figure:
    """Figure of arrows at positions (n, 2) in an image, 300 times as long as shifts (n, 2)."""
    figure, axes = plot(title, "u in pixels", "v in pixels", 6.2, 6.2)
    axes.quiver(
        *positions_px.T, *shifts_px.T, color=BLUE,
        angles="xy", scale_units="xy", scale=1.0 / 300.0, width=0.003,
    )  # fmt: skip
    show_between(axes, (-0.5, camera.height_px - 0.5), (camera.width_px - 0.5, -0.5))
    return figure
