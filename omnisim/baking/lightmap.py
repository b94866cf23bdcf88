"""Lightmap of patches: their light as pixels of an atlas, spread beyond the charts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.baking.patches import Patches
from omnisim.baking.sampling import Floats

_AROUND_PX = 2  # charts
_MOST_STEPS = 24  # within charts, in texels; what lies deeper inside of something is not seen


def lightmap(patches: Patches, light: Floats, is_valid: NDArray[np.bool_]) -> Floats:
    """Pixels (height, width, 3): light (p, 3) of the patches in the atlas.

    Texels without a light have that of their
    neighbours, and so have those around the charts: pixels between texels are then right.
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
    charts = np.zeros(width * height, dtype=np.bool_)
    charts[patches.atlas_places[patches.places < width * height]] = True
    return _spread(pixels.reshape(height, width, 3), known, charts.reshape(height, width))


def _spread(pixels: Floats, known: NDArray[np.bool_], charts: NDArray[np.bool_]) -> Floats:
    """Pixels with those that are not known as means of their neighbours, step by step."""
    pixels, known = np.pad(pixels, ((1, 1), (1, 1), (0, 0))), np.pad(known, 1)
    in_chart = np.pad(charts, 1).ravel()
    width = known.shape[1]
    flat, is_known = pixels.reshape(-1, 3), known.ravel()
    around = np.array([-width - 1, -width, -width + 1, -1, 1, width - 1, width, width + 1])
    edge = np.ones_like(known)
    edge[1:-1, 1:-1] = False
    inner = ~edge.ravel()
    for step_index in range(_MOST_STEPS):
        near = np.zeros_like(is_known)
        rim = np.flatnonzero(is_known)
        for step in around:
            near[rim + step] = True
        some = np.flatnonzero(near & ~is_known & (inner if step_index < _AROUND_PX else in_chart))
        if not len(some):
            break
        neighbours = some[:, None] + around
        weights = is_known[neighbours].astype(np.float32)
        flat[some] = np.einsum("nk,nkc->nc", weights, flat[neighbours])
        flat[some] /= weights.sum(axis=1)[:, None]
        is_known[some] = True
    spread: Floats = np.ascontiguousarray(pixels[1:-1, 1:-1])
    return spread
