"""Perceived differences of colors.

Source: Sharma, Wu and Dalal, "The CIEDE2000 color-difference formula", 2005; CIE 15 (L*a*b*).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_XYZ_FROM_RGB = np.array(  # sRGB, IEC 61966-2-1
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)
_WHITE = _XYZ_FROM_RGB.sum(axis=1)
_FAR = 25.0**7


def lab_from_linear(rgb: NDArray[np.floating]) -> NDArray[np.float64]:
    """L*a*b* (..., 3) of linear sRGB (..., 3), clipped to [0, 1]."""
    shares = np.clip(rgb, 0.0, 1.0) @ _XYZ_FROM_RGB.T / _WHITE
    roots = np.where(
        shares > 216.0 / 24389.0, np.cbrt(shares), (24389.0 / 27.0 * shares + 16) / 116
    )
    x, y, z = np.moveaxis(roots, -1, 0)
    return np.stack((116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)), axis=-1)


def ciede2000(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """CIEDE2000 color difference ΔE₀₀ (...) between two arrays of L*a*b* colors (..., 3)."""
    (l1, a1, b1), (l2, a2, b2) = np.moveaxis(one, -1, 0), np.moveaxis(other, -1, 0)
    chroma7 = (0.5 * (np.hypot(a1, b1) + np.hypot(a2, b2))) ** 7
    stretch = 1.5 - 0.5 * np.sqrt(chroma7 / (chroma7 + _FAR))
    c1, c2 = np.hypot(a1 * stretch, b1), np.hypot(a2 * stretch, b2)
    h1, h2 = (np.degrees(np.arctan2(b, a * stretch)) % 360.0 for a, b in ((a1, b1), (a2, b2)))
    is_gray = c1 * c2 == 0.0
    turn = np.where(is_gray, 0.0, (h2 - h1 + 180.0) % 360.0 - 180.0)
    hue_step = 2.0 * np.sqrt(c1 * c2) * np.sin(np.radians(0.5 * turn))
    far_apart = np.abs(h1 - h2) > 180.0
    hue = np.where(is_gray, h1 + h2, 0.5 * (h1 + h2) + np.where(far_apart, 180.0, 0.0))
    light, chroma = 0.5 * (l1 + l2), 0.5 * (c1 + c2)
    weight = (
        1.0
        - 0.17 * np.cos(np.radians(hue - 30.0))
        + 0.24 * np.cos(np.radians(2.0 * hue))
        + 0.32 * np.cos(np.radians(3.0 * hue + 6.0))
        - 0.20 * np.cos(np.radians(4.0 * hue - 63.0))
    )
    off = (light - 50.0) ** 2
    of_light = (l2 - l1) / (1.0 + 0.015 * off / np.sqrt(20.0 + off))
    of_chroma = (c2 - c1) / (1.0 + 0.045 * chroma)
    of_hue = hue_step / (1.0 + 0.015 * chroma * weight)
    blue = np.radians(60.0 * np.exp(-(((hue - 275.0) / 25.0) ** 2)))
    rotation = -2.0 * np.sqrt(chroma**7 / (chroma**7 + _FAR)) * np.sin(blue)
    squared = of_light**2 + of_chroma**2 + of_hue**2 + rotation * of_chroma * of_hue
    difference: NDArray[np.float64] = np.sqrt(np.maximum(squared, 0.0))
    return difference
