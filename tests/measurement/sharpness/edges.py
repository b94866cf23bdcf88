"""Analytic edges: line spreads of known transfer, integrated over square pixels."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import j1

STEP_PX = 0.005


@dataclass(frozen=True)
class Spread:
    """Line spread along an edge's normal, and its modulation transfer."""

    density: object  # of the distance, px
    transfer: object  # of the frequency, cycles per pixel


def gaussian(sigma_px):
    return Spread(
        lambda x: np.exp(-0.5 * (x / sigma_px) ** 2),
        lambda f: np.exp(-2.0 * (np.pi * sigma_px * f) ** 2),
    )


def disc(radius_px):
    return Spread(
        lambda x: np.sqrt(np.maximum(radius_px**2 - x**2, 0.0)),
        lambda f: np.where(
            f > 0.0,
            2.0 * j1(2.0 * np.pi * radius_px * f) / np.maximum(2.0 * np.pi * radius_px * f, 1e-12),
            1.0,
        ),
    )


def motion(length_px):
    return Spread(
        lambda x: (np.abs(x) <= 0.5 * length_px).astype(float), lambda f: np.sinc(length_px * f)
    )


def edge_levels(spread, normal, reach_px=45.0):
    """Distances and levels of an edge, seen by square pixels."""
    x = np.arange(-reach_px, reach_px + STEP_PX, STEP_PX)
    density = spread.density(x)
    levels = np.cumsum(density) - 0.5 * density
    levels /= density.sum()
    for width in np.abs(normal):  # a pixel's footprint: two boxes
        if width > 10.0 * STEP_PX:
            total = np.concatenate(([0.0], np.cumsum(levels) * STEP_PX))
            at = np.arange(len(total)) * STEP_PX
            ends = (np.arange(len(x)) + 0.5) * STEP_PX
            low, high = ends - 0.5 * width, ends + 0.5 * width
            upper = np.interp(high, at, total) + np.maximum(high - at[-1], 0.0)
            levels = (upper - np.interp(low, at, total)) / width
    return x, levels


def edge_image(spread, slant_deg, size=(80, 80), shift_px=0.0, dark=0.1, bright=0.8, point=None):
    """Image (height, width) of an edge through a point, bright where the angle's normal points."""
    angle = np.radians(slant_deg)
    normal = np.array((np.cos(angle), np.sin(angle)))
    width, height = size
    point = (0.5 * width + 0.13, 0.5 * height - 0.21) if point is None else point
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    distance = (u - point[0]) * normal[0] + (v - point[1]) * normal[1] - shift_px
    return dark + (bright - dark) * np.interp(distance, *edge_levels(spread, normal))


def true_mtf50(spread, slant_deg):
    """Frequency along the normal at which optics and pixel leave half of the modulation."""
    angle = np.radians(slant_deg)

    def excess(frequency):
        pixel = np.sinc(frequency * np.cos(angle)) * np.sinc(frequency * np.sin(angle))
        return float(pixel * spread.transfer(frequency)) - 0.5

    frequencies = np.arange(0.005, 0.9, 0.005)
    first = next(f for f in frequencies if excess(f) < 0.0)
    return brentq(excess, first - 0.005, first)
