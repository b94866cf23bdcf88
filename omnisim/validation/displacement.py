"""Displacement between the contents of two images."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera
from omnisim.plots.style import BLUE, Figure, plot

PATCH_PX = 24


class Displacements(NamedTuple):
    """Displacements of an image's patches, and the patches' centers."""

    middles_px: NDArray[np.float64]  # (n, 2)
    shifts_px: NDArray[np.float64]  # (n, 2)


def displacements(
    one: NDArray[np.float64], other: NDArray[np.float64], where: NDArray[np.bool_]
) -> Displacements:
    """Shift of `other` relative to `one` in each patch inside `where` with edges in two directions.

    Least-squares solution of brightness constancy with the mean gradient of both images, for shifts
    far below a pixel.

    Args:
        one, other: gray images (height, width), values from 0 to 255.
        where: (height, width) pixels to use.

    Source: Lucas & Kanade, "An iterative image registration technique", 1981, one step.
    """
    down, right = np.gradient(0.5 * (one + other))
    change = one - other
    products = np.stack((right * right, right * down, down * down, right * change, down * change))
    rows, columns = one.shape[0] // PATCH_PX, one.shape[1] // PATCH_PX
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
    title: str,
    camera: CentralCamera,
    positions_px: NDArray[np.float64],
    shifts_px: NDArray[np.float64],
) -> Figure:
    """Figure of arrows at positions (n, 2) in an image, 300 times as long as shifts (n, 2)."""
    figure, axes = plot(title, "u in pixels", "v in pixels", 6.2, 6.2)
    axes.quiver(
        *positions_px.T, *shifts_px.T, color=BLUE,
        angles="xy", scale_units="xy", scale=1.0 / 300.0, width=0.003,
    )  # fmt: skip
    axes.set_xlim(-0.5, camera.width_px - 0.5)
    axes.set_ylim(camera.height_px - 0.5, -0.5)
    axes.set_aspect("equal")
    return figure
