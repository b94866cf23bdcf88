"""Channels in colours that an eye can read: for looking at, not for measuring."""

from __future__ import annotations

import colorsys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.ground_truth.labels import Labels, distinct_color
from omnisim.srgb import srgb8_from_linear

_NOTHING = np.array([0, 0, 0], dtype=np.uint8)
# From near to far: yellow, orange, red, violet, dark blue.
_NEAR_TO_FAR = np.array(
    [[253, 250, 160], [251, 176, 51], [226, 84, 62], [142, 36, 106], [56, 22, 100], [12, 10, 44]]
)
_FATES = {0: (60, 150, 90), 1: (220, 60, 50), 2: (235, 190, 60)}  # visible, hidden, outside
_OFF_M = 0.37  # floors and walls like to be at whole metres, where the pattern jumps
_HUES = np.array([colorsys.hsv_to_rgb(hue / 256, 1.0, 1.0) for hue in range(257)])


def preview(name: str, values: NDArray[Any], labels: Labels | None = None) -> NDArray[np.uint8]:
    """A channel as colours (height, width, 3) uint8, sRGB; black where there is nothing.

    Range: logarithmic from the 1st percentile, bright, to the 99th, dark. z: white at 0, red above
    and blue below. Position: a pattern of metres. Normals: x, y, z as red, green, blue. Flow:
    direction as hue, root of the length as saturation, full at the 95th percentile. Occlusion:
    green visible, red hidden, yellow outside.
    """
    makers = {
        "range": _distances,
        "z": _signed,
        "position": _positions,
        "normals": _normals,
        "normals_camera": _normals,
        "albedo": srgb8_from_linear,
        "semantic": lambda ids: _class_colors(ids, labels),
        "instance": _numbers,
        "flow": _flow,
        "occluded": _fates,
        "valid": lambda valid: np.repeat(255 * valid[..., None], 3, axis=-1).astype(np.uint8),
    }
    return makers[name](values)


def _distances(distances: NDArray[np.float32]) -> NDArray[np.uint8]:
    seen = np.isfinite(distances) & (distances > 0.0)
    colors = np.zeros((*distances.shape, 3), dtype=np.uint8)
    if seen.any():
        logarithms = np.log(distances[seen].astype(np.float64))
        near, far = np.percentile(logarithms, (1.0, 99.0))
        share = np.clip((logarithms - near) / max(far - near, 1e-6), 0.0, 1.0)
        places = np.linspace(0.0, 1.0, len(_NEAR_TO_FAR))
        for channel in range(3):
            colors[seen, channel] = np.rint(np.interp(share, places, _NEAR_TO_FAR[:, channel]))
    return colors


def _signed(values: NDArray[np.float32]) -> NDArray[np.uint8]:
    seen = np.isfinite(values)
    colors = np.zeros((*values.shape, 3), dtype=np.uint8)
    if seen.any():
        largest = max(float(np.percentile(np.abs(values[seen]), 99.0)), 1e-6)
        share = np.clip(values[seen] / largest, -1.0, 1.0)[:, None]
        taken = np.where(share > 0.0, (20.0, 200.0, 220.0), (220.0, 160.0, 20.0))
        colors[seen] = np.rint(255.0 - np.abs(share) * taken)
    return colors


def _positions(positions: NDArray[np.float64]) -> NDArray[np.uint8]:
    seen = np.isfinite(positions).all(axis=-1)
    colors = np.zeros(positions.shape, dtype=np.uint8)
    colors[seen] = np.rint(255.0 * np.mod(positions[seen] + _OFF_M, 1.0)).astype(np.uint8)
    return colors


def _normals(normals: NDArray[np.float32]) -> NDArray[np.uint8]:
    seen = np.any(normals != 0.0, axis=-1)
    colors = np.rint(127.5 * (np.clip(normals, -1.0, 1.0) + 1.0)).astype(np.uint8)
    colors[~seen] = _NOTHING
    return colors


def _class_colors(ids: NDArray[np.integer], labels: Labels | None) -> NDArray[np.uint8]:
    return _numbers(ids) if labels is None else labels.class_colors[ids]


def _numbers(ids: NDArray[np.integer]) -> NDArray[np.uint8]:
    there, places = np.unique(ids, return_inverse=True)
    colors = np.array([_NOTHING if number == 0 else distinct_color(number) for number in there])
    return colors.astype(np.uint8)[places.reshape(ids.shape)]


def _flow(flow_px: NDArray[np.float32]) -> NDArray[np.uint8]:
    known = ~np.isnan(flow_px).any(axis=-1)
    colors = np.zeros((*known.shape, 3), dtype=np.uint8)
    if known.any():
        u, v = flow_px[known].astype(np.float64).T
        lengths = np.hypot(u, v)
        longest = max(float(np.percentile(lengths, 95.0)), 1e-6)
        share = np.sqrt(np.clip(lengths / longest, 0.0, 1.0))
        hue = np.rint(256.0 * (np.arctan2(v, u) / (2.0 * np.pi) % 1.0)).astype(np.intp)
        colors[known] = np.rint(255.0 * (1.0 - share[:, None] * (1.0 - _HUES[hue])))
    return colors


def _fates(fates: NDArray[np.uint8]) -> NDArray[np.uint8]:
    table = np.zeros((256, 3), dtype=np.uint8)
    for fate, color in _FATES.items():
        table[fate] = color
    return table[fates]
