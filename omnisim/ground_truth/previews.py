"""False-color previews of channels, for display only, not for measurement."""

from __future__ import annotations

import colorsys
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Bytes, Floats
from omnisim.core.srgb import srgb8_from_linear
from omnisim.ground_truth.channels import CHANNELS, CLASSES, RANGES
from omnisim.ground_truth.label_names import Labels, distinct_color

_NOTHING = (0, 0, 0)
# From near to far: yellow, orange, red, violet, dark blue.
NEAR_TO_FAR = np.array(
    [[253, 250, 160], [251, 176, 51], [226, 84, 62], [142, 36, 106], [56, 22, 100], [12, 10, 44]]
)
OCCLUSION = {0: (60, 150, 90), 1: (220, 60, 50), 2: (235, 190, 60)}  # visible, occluded, outside
_OFF_M = 0.37  # offset of the pattern's jumps from whole meters, where floors and walls often are
_HUES = np.array([colorsys.hsv_to_rgb(hue / 256, 1.0, 1.0) for hue in range(257)])


def preview(name: str, values: NDArray[Any], labels: Labels | None = None) -> Bytes:
    """False colors (height, width, 3) uint8, sRGB, of a channel; black without a value.

    Range: logarithmic from the 1st percentile, bright, to the 99th, dark. z: white at 0, red above
    and blue below. Position: x, y, z modulo 1 m as red, green, blue. Normals: x, y, z as red,
    green, blue. Roughness and metalness: dark at 0, white at 1. Emitted light: as in the image,
    clipped. Flow: direction as hue, square root of the length as saturation, full at the 95th
    percentile. Scene flow: x, y, z as red, green, blue, gray at rest, full at the 99th percentile.
    Occlusion: green visible, red occluded, yellow outside.
    """
    if name in CLASSES and labels is not None:
        return labels.class_colors.take(values, axis=0)
    return _PREVIEWS[name](values)


def _log_limits(distances: NDArray[Any]) -> Floats:
    """Logarithms of the ranges with the brightest and the darkest preview color; 0 if none."""
    seen = np.isfinite(distances) & (distances > 0.0)
    if not seen.any():
        return np.zeros(2)
    logarithms = np.log(distances[seen].astype(np.float64))
    return np.percentile(logarithms, (1.0, 99.0))


def signed_limit(values: NDArray[Any]) -> float:
    """Magnitude shown at full color in the preview of z; 1 if no value is finite."""
    seen = np.isfinite(values)
    if not seen.any():
        return 1.0
    return max(float(np.percentile(np.abs(values[seen]), 99.0)), 1e-6)


def _distances(distances: NDArray[Any]) -> Bytes:
    seen = np.isfinite(distances) & (distances > 0.0)
    colors = np.zeros((*distances.shape, 3), dtype=np.uint8)
    if seen.any():
        logarithms = np.log(distances[seen].astype(np.float64))
        near, far = _log_limits(distances)
        share = np.clip((logarithms - near) / max(far - near, 1e-6), 0.0, 1.0)
        stops = np.linspace(0.0, 1.0, len(NEAR_TO_FAR))
        for channel in range(3):
            colors[seen, channel] = np.rint(np.interp(share, stops, NEAR_TO_FAR[:, channel]))
    return colors


def _signed(values: NDArray[Any]) -> Bytes:
    seen = np.isfinite(values)
    colors = np.zeros((*values.shape, 3), dtype=np.uint8)
    if seen.any():
        share = np.clip(values[seen] / signed_limit(values), -1.0, 1.0)[:, None]
        taken = np.where(share > 0.0, (20.0, 200.0, 220.0), (220.0, 160.0, 20.0))
        colors[seen] = np.rint(255.0 - np.abs(share) * taken)
    return colors


def _positions(positions: NDArray[Any]) -> Bytes:
    seen = np.isfinite(positions).all(axis=-1)
    colors = np.zeros(positions.shape, dtype=np.uint8)
    colors[seen] = np.rint(255.0 * np.mod(positions[seen] + _OFF_M, 1.0)).astype(np.uint8)
    return colors


def _normals(normals: NDArray[Any]) -> Bytes:
    seen = np.any(normals != 0.0, axis=-1)
    scaled = 127.5 * (np.clip(normals, -1.0, 1.0) + 1.0)
    colors: Bytes = np.rint(scaled).astype(np.uint8)
    colors[~seen] = _NOTHING
    return colors


def _shares(shares: NDArray[Any]) -> Bytes:
    # black is reserved for missing values
    gray = np.where(np.isnan(shares), 0.0, 40.0 + 215.0 * np.clip(shares, 0.0, 1.0))
    return np.repeat(np.rint(gray)[..., None], 3, axis=-1).astype(np.uint8)


def _ids(ids: NDArray[Any]) -> Bytes:
    present, indices = np.unique(ids, return_inverse=True)
    palette = [_NOTHING if number == 0 else distinct_color(number) for number in present.tolist()]
    return np.array(palette, dtype=np.uint8).take(indices.reshape(ids.shape), axis=0)


def _flow(flow_px: NDArray[Any]) -> Bytes:
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


def _vectors(vectors: NDArray[Any]) -> Bytes:
    lengths = np.linalg.norm(vectors, axis=-1)
    known = ~np.isnan(lengths)
    colors = np.zeros(vectors.shape, dtype=np.uint8)
    if known.any():
        moving = lengths[known & (lengths > 0.0)]  # static points would dominate the percentile
        longest = float(np.percentile(moving, 99.0)) if moving.size else 1.0
        share = np.clip(vectors[known] / max(longest, 1e-6), -1.0, 1.0)
        colors[known] = np.rint(127.5 + 112.0 * share)  # black is reserved for missing values
    return colors


def _occlusion(codes: NDArray[Any]) -> Bytes:
    table = np.zeros((256, 3), dtype=np.uint8)
    for code, color in OCCLUSION.items():
        table[code] = color
    return table.take(codes, axis=0)


_PREVIEWS: dict[str, Callable[[NDArray[Any]], Bytes]] = {
    "range": _distances, "range_through": _distances, "z": _signed, "position": _positions,
    "normals": _normals, "normals_camera": _normals, "albedo": srgb8_from_linear,
    "roughness": _shares, "metallic": _shares,
    "emissive": lambda light: srgb8_from_linear(np.clip(light, 0.0, 1.0)), "semantic": _ids,
    "semantic_through": _ids, "instance": _ids, "flow": _flow, "occluded": _occlusion,
    "flow_backward": _flow, "occluded_backward": _occlusion, "scene_flow": _vectors,
    "scene_flow_camera": _vectors,
    "valid": lambda valid: np.repeat(255 * valid[..., None], 3, axis=-1).astype(np.uint8),
}  # fmt: skip


# Legends for the false colors of channels.


MAX_ITEMS = 14  # items in a list, largest areas first
Legend = dict[str, Any]
_AXES = {
    "position": "x, y, z modulo 1 m as red, green, blue",
    "normals": "x, y, z of the world as red, green, blue",
    "normals_camera": "x, y, z of the camera as red, green, blue",
    "albedo": "base color without light",
    "flow": "direction as hue, length as saturation",
    "flow_backward": "direction as hue, length as saturation",
    "scene_flow": "x, y, z as red, green, blue; gray at rest",
    "scene_flow_camera": "x, y, z as red, green, blue; gray at rest",
}
_OCCLUSION_NAMES = {0: "visible", 1: "hidden", 2: "outside"}


def legend(name: str, values: NDArray[Any], labels: Labels | None = None) -> Legend:
    """Legend of a channel's preview, as JSON-compatible values.

    `kind` is "ramp", with `low`, `high`, `unit`, `colors` from low to high, and `scale`; "list",
    with `items` of a name and a color, largest areas first, and `more`, the number of further
    items; or "text", with `text`.
    """
    if name in RANGES:
        near, far = np.exp(_log_limits(values)).tolist()
        colors = [_hex(color) for color in NEAR_TO_FAR.tolist()]
        return _ramp(near, far, CHANNELS[name].unit, colors, "logarithmic")
    if name == "z":
        largest = signed_limit(values)
        colors = [_hex((35, 95, 235)), "#ffffff", _hex((235, 55, 35))]
        return _ramp(-largest, largest, CHANNELS[name].unit, colors, "linear")
    if name in CLASSES and labels is not None:
        names = {label.id: label.name for label in labels.classes}
        palette = {label.id: _hex(label.color) for label in labels.classes}
        return _items(values, names, palette)
    if name == "instance" and labels is not None:
        names = {label.id: label.name for label in labels.instances}
        return _items(values, names, {id_: _hex(distinct_color(id_)) for id_ in names})
    if name in ("occluded", "occluded_backward"):
        return _items(values, _OCCLUSION_NAMES, {k: _hex(c) for k, c in OCCLUSION.items()})
    if name == "valid":
        return _items(values, {1: "has a ray", 0: "none"}, {1: "#ffffff", 0: "#000000"})
    return {"kind": "text", "text": _AXES.get(name, CHANNELS[name].about)}


def _ramp(low: float, high: float, unit: str, colors: list[str], scale: str) -> Legend:
    return {
        "kind": "ramp", "low": low, "high": high, "unit": unit, "colors": colors, "scale": scale,
    }  # fmt: skip


def _items(ids: NDArray[Any], names: dict[int, str], colors: dict[int, str]) -> Legend:
    present, counts = np.unique(ids, return_counts=True)
    order = np.argsort(-counts, kind="stable")
    listed = [int(present[at]) for at in order if int(present[at]) in names]
    items = [{"name": names[number], "color": colors[number]} for number in listed[:MAX_ITEMS]]
    return {"kind": "list", "items": items, "more": max(0, len(listed) - MAX_ITEMS)}


def _hex(color: Any) -> str:
    red, green, blue = (int(part) for part in color)
    return f"#{red:02x}{green:02x}{blue:02x}"
