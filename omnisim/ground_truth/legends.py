"""Legends for the false colors of channels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.ground_truth.channels import CHANNELS, CLASSES, RANGES
from omnisim.ground_truth.label_names import Labels, distinct_color
from omnisim.ground_truth.previews import NEAR_TO_FAR, OCCLUSION, range_limits, signed_limit

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
        near, far = range_limits(values)
        colors = [_hex(color) for color in NEAR_TO_FAR.tolist()]
        return _ramp(near, far, CHANNELS[name].unit, colors, "logarithmic")
    if name == "z":
        largest = signed_limit(values)
        colors = [_hex((35, 95, 235)), "#ffffff", _hex((235, 55, 35))]
        return _ramp(-largest, largest, CHANNELS[name].unit, colors, "linear")
    if name in CLASSES and labels is not None:
        names = {one.id: one.name for one in labels.classes}
        palette = {one.id: _hex(one.color) for one in labels.classes}
        return _items(values, names, palette)
    if name == "instance" and labels is not None:
        names = {one.id: one.name for one in labels.instances}
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
    items = [{"name": names[one], "color": colors[one]} for one in listed[:MAX_ITEMS]]
    return {"kind": "list", "items": items, "more": max(0, len(listed) - MAX_ITEMS)}


def _hex(color: Any) -> str:
    red, green, blue = (int(part) for part in color)
    return f"#{red:02x}{green:02x}{blue:02x}"
