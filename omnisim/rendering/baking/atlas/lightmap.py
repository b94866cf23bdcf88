"""Lightmap: light of the patches as atlas pixels, filling the rectangles of the charts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.baking.atlas.patches import NEIGHBORS, Patches
from omnisim.rendering.baking.sampling import Floats

_MAX_STEPS = 24  # in texels; deeper texels are inside of something and invisible


def lightmap(patches: Patches, light: Floats, is_valid: NDArray[np.bool_]) -> Floats:
    """Pixels (height, width, 3): light (p, 3) of the patches in the atlas.

    Texels without light, and those around a chart in its rectangle, take the light of their
    neighbors, so that interpolation between texels is right.
    """
    width, height = patches.size_px
    used = np.flatnonzero(is_valid & (patches.places < width * height))
    places = patches.atlas_places[used]
    counts = np.bincount(places, minlength=width * height).astype(np.float32)
    pixels = np.stack(
        [
            np.bincount(places, weights=light[used, channel], minlength=width * height)
            for channel in range(3)
        ],
        axis=1,
    ).astype(np.float32)
    pixels /= np.maximum(counts, 1.0)[:, None]
    known = (counts > 0.0).reshape(height, width)
    return _spread(pixels.reshape(height, width, 3), known, patches.charts)


def _spread(pixels: Floats, known: NDArray[np.bool_], charts: NDArray[np.int32]) -> Floats:
    """Pixels (height, width, 3), unknown ones filled stepwise with means of known neighbors."""
    for _ in range(_MAX_STEPS):
        sums, counts = np.zeros_like(pixels), np.zeros(known.shape, dtype=np.float32)
        for to, of in NEIGHBORS:
            some = known[of] & (charts[to] == charts[of])
            sums[to] += np.where(some[..., None], pixels[of], 0.0)
            counts[to] += some
        filled = ~known & (counts > 0.0)
        if not filled.any():
            break
        pixels[filled] = sums[filled] / counts[filled][:, None]
        known = known | filled
    return pixels
