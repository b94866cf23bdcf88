"""Gazebo's drive plugins for wheeled robots, as tables of a robot file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from omnisim.scene.formats.features import part_notices, xml_parts
from omnisim.scene.formats.xml.element import XmlElement

_PLUGINS = ("diff-drive", "diff_drive", "DiffDrive", "skid_steer")
_SKIDS = "skid_steer"
# Key, element of the plugin, default in the plugin's unit, factor from its unit to the key's.
_LIMITS = (
    ("max_speed_mps", "max_linear_velocity", 1.0, 1.0),
    ("max_turn_rate_degps", "max_angular_velocity", np.radians(90.0), np.degrees(1.0)),
    ("max_acceleration_mps2", "max_linear_acceleration", 1.0, 1.0),
    ("max_turn_acceleration_degps2", "max_angular_acceleration", np.pi, np.degrees(1.0)),
)


def is_wheel_drive(plugin: XmlElement) -> bool:
    """True for a plugin that drives a robot on two or four wheels."""
    names = plugin.attribute("filename") + plugin.attribute("name")
    return any(word in names for word in _PLUGINS)


def drive_table(plugin: XmlElement, notices: list[str]) -> dict[str, Any]:
    """Convert a drive plugin to a `[kinematics]` table."""
    notices += part_notices("drive", xml_parts(plugin.element, "drive"))
    wheel_m = 2.0 * plugin.number("wheel_radius", 0.0)
    wheel_m = wheel_m or plugin.number("wheel_diameter", plugin.number("wheelDiameter", 0.0))
    track_m = plugin.number("wheel_separation", plugin.number("wheelSeparation", 0.0))
    skids = _SKIDS in plugin.attribute("filename") + plugin.attribute("name")
    return {
        "type": "skid_steer" if skids else "differential",
        "track_m": track_m if track_m > 0.0 else None,
        "wheel_diameter_m": wheel_m if wheel_m > 0.0 else None,
        **limits(stated_limits(plugin), notices),
    }


def stated_limits(plugin: XmlElement) -> dict[str, float]:
    """Limits that a plugin states, in the units of a robot file."""
    stated = {key: plugin.number(path, 0.0) * scale for key, path, _, scale in _LIMITS}
    return {key: value for key, value in stated.items() if value > 0.0}


def limits(stated: Mapping[str, float], notices: list[str]) -> dict[str, float]:
    """Complete the stated limits with assumed defaults, which a notice lists."""
    assumed = {key: default * scale for key, _, default, scale in _LIMITS if key not in stated}
    if assumed:
        listed = ", ".join(f"{key} = {value:g}" for key, value in assumed.items())
        notices.append(f"not stated, but assumed: {listed}")
    return {key: round(float({**assumed, **stated}[key]), 9) for key, *_ in _LIMITS}
