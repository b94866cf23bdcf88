"""Sharpness of one edge anywhere in an image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.measurement.sharpness.edge_fit import (
    EdgeLine,
    FittedEdge,
    Flaw,
    Floats,
    UnusableEdge,
    fit_edge,
)
from omnisim.measurement.sharpness.edge_spread import (
    FREQUENCIES,
    crossings,
    deviation,
    edge_spread,
    half_modulation,
    modulation_transfer,
    shifts,
)

GREEN = 1
_NARROWER = 0.6  # of the reach, for a second try beside other edges


@dataclass(frozen=True, eq=False)
class EdgeSharpness:
    """Sharpness of an edge.

    Attributes:
        image: number of the image.
        center_px: (2,) position (u, v) in the image.
        normal: (2,) unit vector from the dark to the bright side.
        length_px, slant_deg: length, and angle to the pixel rows or columns, the smaller.
        mtf50, mtf50_sigma: frequency at which the modulation is one half, cycles per pixel.
        rise_px, rise_sigma_px: distance from 10 to 90 % of the edge.
        asymmetry: distance from 10 to 50 % minus distance from 50 to 90 %, over their sum.
        transfer: (frequencies,) modulation transfer at `FREQUENCIES`.
        shifts_px, shift_sigmas_px: (2,) distances of the red and of the blue edge from the green
            one, toward the bright side; NaN: a gray image.
    """

    image: int
    center_px: Floats
    normal: Floats
    length_px: float
    slant_deg: float
    mtf50: float
    mtf50_sigma: float
    rise_px: float
    rise_sigma_px: float
    asymmetry: float
    transfer: Floats
    shifts_px: Floats
    shift_sigmas_px: Floats

    @property
    def variance_px2(self) -> float:
        """Variance of the optics' blur along `normal`, as a normal distribution.

        Together with square pixels it gives the same MTF50. Negative if the edge is sharper than
        square pixels alone would make it.
        """
        return self._variance_px2(self.mtf50)

    @property
    def variance_sigma_px2(self) -> float:
        """Standard deviation of `variance_px2`."""
        step = 1e-4
        rate = self._variance_px2(self.mtf50 + step) - self._variance_px2(self.mtf50 - step)
        return abs(rate) / (2.0 * step) * self.mtf50_sigma

    def _variance_px2(self, mtf50: float) -> float:
        pixel = pixel_transfer(mtf50, self.normal)
        return float(np.log(2.0 * pixel) / (2.0 * np.pi**2 * mtf50**2))


def pixel_transfer(frequency: float, normal: Floats) -> float:
    """Modulation transfer of a square pixel along a direction."""
    return float(np.prod(np.sinc(frequency * normal)))


def measure_edge(
    light: NDArray[np.float64], clipped: NDArray[np.bool_], line: EdgeLine, image: int = 0
) -> EdgeSharpness:
    """Measure the sharpness of an edge.

    Args:
        light: (height, width, 1 or 3) linear values, 1: white.
        clipped: (height, width) True: the pixel is at a limit of its values.
        line: approximate ends of the edge.
        image: number of the image.

    Raises:
        UnusableEdge: the edge has a flaw.
    """
    main = light[..., GREEN if light.shape[2] == 3 else 0]
    try:
        edge = fit_edge(main, clipped, line)
    except UnusableEdge as reason:
        if reason.args[0] is not Flaw.UNEVEN:
            raise
        narrower = EdgeLine(line.start_px, line.end_px, _NARROWER * line.reach_px)
        edge = fit_edge(main, clipped, narrower)
    spread = edge_spread(main[edge.rows, edge.columns], edge)
    low, middle, high = (crossings(spread, level) for level in (0.1, 0.5, 0.9))
    transfer = modulation_transfer(spread, float(high[0] - low[0]))
    mtf50 = half_modulation(transfer)
    shift, shift_sigma = np.full(2, np.nan), np.full(2, np.nan)
    if light.shape[2] == 3:
        for index, channel in enumerate((0, 2)):
            other = edge_spread(light[edge.rows, edge.columns, channel], edge)
            estimates = shifts(spread, other, float(high[0] - low[0]))
            shift[index], shift_sigma[index] = estimates[0], deviation(estimates)
    return EdgeSharpness(
        image=image,
        center_px=edge.center_px,
        normal=edge.normal,
        length_px=edge.length_px,
        slant_deg=edge.slant_deg,
        mtf50=float(mtf50[0]),
        mtf50_sigma=deviation(mtf50),
        rise_px=float(high[0] - low[0]),
        rise_sigma_px=deviation(high - low),
        asymmetry=float((2.0 * middle[0] - low[0] - high[0]) / (high[0] - low[0])),
        transfer=transfer[0],
        shifts_px=shift,
        shift_sigmas_px=shift_sigma,
    )


__all__ = ["FREQUENCIES", "EdgeSharpness", "FittedEdge", "measure_edge", "pixel_transfer"]
