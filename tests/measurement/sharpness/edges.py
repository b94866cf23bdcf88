"""Edges blurred by known line spreads, sampled by square pixels."""

import numpy as np
from scipy.special import j1

from omnisim.core.arrays import Floats
from omnisim.validation.checks.measured.sharpness import LineSpread

STEP_PX = 0.005  # of the line spread's samples


def disc(radius_px: float) -> LineSpread:
    """Line spread of an even blur disc, as from defocus with a round aperture."""
    return LineSpread(
        lambda x: np.sqrt(np.maximum(radius_px**2 - x**2, 0.0)),
        lambda f: float(j1(2.0 * np.pi * radius_px * f) / (np.pi * radius_px * f)),
    )


def motion(length_px: float) -> LineSpread:
    """Line spread of motion along the normal, at constant speed."""
    return LineSpread(
        lambda x: (np.abs(x) <= 0.5 * length_px).astype(np.float64),
        lambda f: float(np.sinc(length_px * f)),
    )


def edge_levels(spread: LineSpread, angle_deg: float, reach_px: float) -> tuple[Floats, Floats]:
    """Distances (n,) in px, up to `reach_px` from an edge, and pixel levels there, from 0 to 1.

    `angle_deg` is the direction of the edge's normal, from +u to +v.
    """
    x = np.arange(-reach_px, reach_px + STEP_PX, STEP_PX)
    density = spread.density(x)
    levels = (np.cumsum(density) - 0.5 * density) / density.sum()
    angle = np.radians(angle_deg)
    # along the normal, a pixel is the convolution of two boxes
    for width in (abs(float(np.cos(angle))), abs(float(np.sin(angle)))):
        if width < 10.0 * STEP_PX:
            continue
        total = np.concatenate(([0.0], np.cumsum(levels) * STEP_PX))
        at = x[0] + (np.arange(len(total)) - 0.5) * STEP_PX
        high = np.interp(x + 0.5 * width, at, total) + np.maximum(x + 0.5 * width - at[-1], 0.0)
        levels = (high - np.interp(x - 0.5 * width, at, total)) / width
    return x, levels


def edge_image(
    spread: LineSpread,
    angle_deg: float,
    size_px: tuple[int, int] = (80, 80),
    point_px: tuple[float, float] | None = None,
    dark: float = 0.1,
    bright: float = 0.8,
) -> Floats:
    """Image (height, width) of an edge.

    Args:
        spread: line spread along the normal.
        angle_deg: direction of the normal, from +u to +v, toward the bright side.
        size_px: width and height.
        point_px: (u, v) on the edge; None: near the middle.
        dark, bright: linear values of the two sides.
    """
    width, height = size_px
    point = (0.5 * width + 0.13, 0.5 * height - 0.21) if point_px is None else point_px
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    angle = np.radians(angle_deg)
    distance = (u - point[0]) * np.cos(angle) + (v - point[1]) * np.sin(angle)
    levels = np.interp(distance, *edge_levels(spread, angle_deg, float(width + height)))
    return dark + (bright - dark) * levels
