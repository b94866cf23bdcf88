"""Pictures drawn with PIL, smoothed by drawing them larger than they are wanted."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from PIL import Image, ImageDraw

Color = tuple[float, float, float]
OVERSAMPLING = 3


def painted(
    width: int, height: int, paint: Callable[[ImageDraw.ImageDraw, float], None]
) -> tuple[np.ndarray, np.ndarray]:
    """Run a painter on an enlarged canvas; color and coverage at the wanted size.

    The painter gets the canvas and its width in pixels.
    """
    big = (width * OVERSAMPLING, height * OVERSAMPLING)
    canvas = Image.new("RGBA", big, (0, 0, 0, 0))
    paint(ImageDraw.Draw(canvas), float(big[0]))
    pixels = np.asarray(canvas.resize((width, height), Image.Resampling.BOX), float) / 255
    return pixels[..., :3], pixels[..., 3:]


def rgb(color: Color) -> tuple[int, int, int]:
    """A color in 0..1 as PIL wants it."""
    return tuple(round(255 * channel) for channel in color)
