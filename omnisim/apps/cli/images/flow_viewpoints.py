"""Viewpoints before and after a frame, for optical flow."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection
from typing import Any

from omnisim.apps.cli.images.requests import FlowOptions
from omnisim.apps.cli.inputs import Viewpoint
from omnisim.core.errors import OutputError
from omnisim.ground_truth import CHANNELS

DEFAULT_ADVANCE_M = 0.1  # forward motion between frames for flow without --next


def check_channel_options(options: FlowOptions, channels: Collection[str]) -> None:
    """Raise an error for options of channels that are not requested.

    Raises:
        OutputError: names the option and the channel that it requires.
    """
    others = {CHANNELS[name].other for name in channels}
    for other, channel in (("next", "flow"), ("previous", "flow_backward")):
        for option, value in _other_options(options, other).items():
            if value is not None and other not in others:
                raise OutputError(f"{option}: requires --also {channel}")
    if options.preview and not channels:
        raise OutputError("--preview: requires --also")


def other_viewpoints(
    options: FlowOptions, current: Viewpoint, channels: Collection[str]
) -> dict[str, Viewpoint]:
    """Viewpoints of the "next" and "previous" frames that the channels require.

    Args:
        options: viewpoints and headings of the two frames.
        current: viewpoint of this frame.
        channels: requested ground-truth channels.
    """
    others = {CHANNELS[name].other for name in channels}
    advances_m = {"next": DEFAULT_ADVANCE_M, "previous": -DEFAULT_ADVANCE_M}
    return {
        other: _other_viewpoint(current, advance_m, *_other_options(options, other).values())
        for other, advance_m in advances_m.items()
        if other in others
    }


def _other_options(options: FlowOptions, other: str) -> dict[str, Any]:
    """Viewpoint and heading of the next or previous frame, by option; None: not set."""
    if other == "next":
        return {"--next": options.next_at, "--next-yaw": options.next_yaw_deg}
    return {"--previous": options.previous_at, "--previous-yaw": options.previous_yaw_deg}


def _other_viewpoint(
    current: Viewpoint,
    advance_m: float,
    at: tuple[float, float, float] | None,
    given_yaw_deg: float | None,
) -> Viewpoint:
    """Viewpoint of another frame: from the options, else displaced along the heading."""
    yaw_deg = current.yaw_deg if given_yaw_deg is None else given_yaw_deg
    turned = dataclasses.replace(current, yaw_deg=yaw_deg)
    if at is not None:
        return dataclasses.replace(turned, position_m=at)
    if given_yaw_deg is not None:
        return turned
    x, y, z = (current.position_m + advance_m * current.pose[:3, 0]).tolist()
    return dataclasses.replace(current, position_m=(x, y, z))


def flow_summary(options: FlowOptions, other: str, viewpoint: Viewpoint) -> str:
    """End of the summary line: the other viewpoint of flow, and whether it is assumed."""
    flow, side = ("flow", "ahead") if other == "next" else ("backward flow", "behind")
    is_default = all(value is None for value in _other_options(options, other).values())
    reason = f", {DEFAULT_ADVANCE_M:g} m {side} as no --{other} says" if is_default else ""
    return f"; {flow} to {viewpoint}{reason}"
