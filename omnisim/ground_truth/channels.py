"""Ground-truth channels by name: contents, units, and layers in files.

Each value belongs to the ray of the pixel's center, which begins at the effective viewpoint, if
there is one. It is exact: unlike the image's colors, it is never averaged over the pixel or blended
with its neighbors.

A surface with an alpha mask counts except at its holes. An alpha-blended surface counts where its
alpha is at least 0.5. Panes that transmit light, and mirrors, are surfaces as well: only
`range_through` and `semantic_through` see through and by them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from omnisim.core.errors import OutputError, did_you_mean

ChannelName = Literal[
    "range", "range_through", "z", "position", "normals", "normals_camera",
    "albedo", "roughness", "metallic", "emissive",
    "semantic", "semantic_through", "instance",
    "flow", "occluded", "flow_backward", "occluded_backward", "scene_flow", "scene_flow_camera",
    "valid",
]  # fmt: skip


@dataclass(frozen=True)
class Channel:
    """One ground-truth channel.

    Attributes:
        layers: layer names in an EXR file, one per component.
        unit: unit of the values; empty: no unit.
        about: description of the contents, including values without a hit.
        empty: value of pixels without a ray.
        other: other image required by the channel: "next", "previous" or empty.
    """

    name: ChannelName
    layers: tuple[str, ...]
    dtype: str
    unit: str
    about: str
    empty: float = 0.0
    other: str = ""


def _xyz(name: str) -> tuple[str, ...]:
    return tuple(f"{name}.{axis}" for axis in "XYZ")


CHANNELS: dict[str, Channel] = {
    channel.name: channel
    for channel in (
        Channel(
            "range", ("range",), "float32", "m",
            "length of the ray from the effective viewpoint, or in optics without one from the "
            "origin of the ray on the last surface; +inf: nothing is hit",
            math.inf,
        ),
        Channel(
            "range_through", ("range_through",), "float32", "m",
            "length of the ray's path, through panes and after mirrors, to the first other "
            "surface; +inf: nothing is hit",
            math.inf,
        ),
        Channel(
            "z", ("Z",), "float32", "m",
            "coordinate along the optical frame's z, not a distance: negative behind its plane, "
            "and a mirror's optical frame looks up into the mirror; +inf: nothing is hit",
            math.inf,
        ),
        Channel(
            "position", _xyz("position"), "float64", "m",
            "where the ray hits, world frame (x, y on the ground, z up); NaN: nothing is hit",
            math.nan,
        ),
        Channel(
            "normals", _xyz("normal"), "float32", "",
            "unit normal of the side that is seen, as it is lit, world frame; 0: nothing is hit",
        ),
        Channel(
            "normals_camera", _xyz("normal_camera"), "float32", "",
            "the same in the optical frame (x right, y down, z forward)",
        ),
        Channel(
            "albedo", tuple(f"albedo.{color}" for color in "RGB"), "float32", "",
            "base color without any light, linear RGB; 0: nothing is hit",
        ),
        Channel(
            "roughness", ("roughness",), "float32", "",
            "roughness of glTF's materials, maps applied: 0 smooth, 1 rough, as are matte "
            "surfaces; NaN: nothing is hit",
            math.nan,
        ),
        Channel(
            "metallic", ("metallic",), "float32", "",
            "metalness of glTF's materials, maps applied: 0 dielectric, 1 metal; "
            "NaN: nothing is hit",
            math.nan,
        ),
        Channel(
            "emissive", tuple(f"emissive.{color}" for color in "RGB"), "float32", "",
            "light that the surface emits, maps applied, linear RGB: 1 is white, whatever the "
            "exposure; 0: nothing is hit",
        ),
        Channel(
            "semantic", ("semantic",), "uint16", "",
            "number of the class, see the label table; 0: nothing is hit",
        ),
        Channel(
            "semantic_through", ("semantic_through",), "uint16", "",
            "number of the class of range_through's surface; 0: nothing is hit",
        ),
        Channel(
            "instance", ("instance",), "uint32", "",
            "number of the instance, see the label table; 0: nothing is hit",
        ),
        Channel(
            "flow", ("flow.U", "flow.V"), "float32", "px",
            "from the pixel to where its point is in the next image, u right, v down; where "
            "nothing is hit, for a point at infinity; NaN: the next image's lens cannot see it",
            math.nan, "next",
        ),
        Channel(
            "occluded", ("occluded",), "uint8", "",
            "the point in the next image: 0 visible, 1 hidden, 2 outside it, 255 the pixel "
            "sees nothing",
            255, "next",
        ),
        Channel(
            "flow_backward", ("flow_backward.U", "flow_backward.V"), "float32", "px",
            "from the pixel to where its point was in the previous image, otherwise as flow",
            math.nan, "previous",
        ),
        Channel(
            "occluded_backward", ("occluded_backward",), "uint8", "",
            "the point in the previous image, otherwise as occluded",
            255, "previous",
        ),
        Channel(
            "scene_flow", _xyz("scene_flow"), "float32", "m",
            "motion of the point until the next image, world frame: 0 on the static scene; "
            "NaN: nothing is hit",
            math.nan, "next",
        ),
        Channel(
            "scene_flow_camera", _xyz("scene_flow_camera"), "float32", "m",
            "the same relative to the camera: the point in the next image's optical frame, less "
            "the point in this one's",
            math.nan, "next",
        ),
        Channel(
            "valid", ("valid",), "uint8", "",
            "1: the pixel's center has a ray; 0: it is outside the lens or the mirror",
        ),
    )
}  # fmt: skip
# Optical flow always comes with its occlusion channel.
FLOWS = {"flow": "occluded", "flow_backward": "occluded_backward"}
# Channels of the first surface, and of the one behind glass and after mirrors.
RANGES, CLASSES = ("range", "range_through"), ("semantic", "semantic_through")
THROUGH = frozenset(("range_through", "semantic_through"))
# Alternative names.
_SYNONYMS = {
    "depth": "range", "normal": "normals", "class": "semantic", "semantics": "semantic",
    "forward_flow": "flow", "flow_forward": "flow", "backward_flow": "flow_backward",
    "metalness": "metallic", "emission": "emissive",
}  # fmt: skip


def parse_channels(text: str) -> tuple[str, ...]:
    """Channel names from a comma-separated list such as "range,normals"; "all": every channel.

    Raises:
        OutputError: an unknown name, with the nearest valid one, or an empty list.
    """
    names = [name.strip().lower() for name in text.split(",") if name.strip()]
    if not names:
        raise OutputError(
            f"--also {text!r}: expected names with commas: {','.join(CHANNELS)}, or all"
        )
    everything = CHANNELS if "all" in names else ()
    return check_channels([*everything, *(name for name in names if name != "all")])


def check_channels(names: Iterable[str]) -> tuple[str, ...]:
    """Distinct channels by name, in the order of `CHANNELS`; flow adds its occlusion.

    Raises:
        OutputError: an unknown name, with the nearest valid one, or a text instead of names.
    """
    if isinstance(names, str):  # iterating would split it into letters
        raise OutputError(f"channels {names!r}: expected a list of names, such as ['range']")
    requested = set(names)
    for name in sorted(requested - CHANNELS.keys()):
        hint = did_you_mean(_SYNONYMS.get(name, name), CHANNELS)
        raise OutputError(f"channel {name!r}: there is no such channel; {hint}")
    for pair in FLOWS.items():
        if requested.intersection(pair):
            requested.update(pair)
    return tuple(name for name in CHANNELS if name in requested)
