"""Features of URDF."""

from __future__ import annotations

from xml.etree.ElementTree import Element

from omnisim.scene.formats.features import Feature, Support

_APPLIED, _LEFT_OUT, _IGNORED = Support.APPLIED, Support.LEFT_OUT, Support.IGNORED


def _has_looks(extension: Element) -> bool:
    """True for a Gazebo extension that changes materials or adds visuals or lights."""
    return any(one.tag in ("material", "visual", "light") for one in extension.iter())


def _has_offset(mimic: Element) -> bool:
    return mimic.get("offset", "0").strip() not in ("0", "0.0", "")


URDF_FEATURES = (
    Feature("link, visual, geometry, @name, @version, @xmlns", _APPLIED, "one instance a visual"),
    Feature("mesh, @filename, @scale", _APPLIED, "every format of scenes, by `package://` too"),
    Feature("box, sphere, cylinder, @size, @radius, @length", _APPLIED, "round to 0.02 %"),
    Feature("capsule", _APPLIED, "which some tools write"),
    Feature(
        "material, color, texture, @rgba", _APPLIED,
        "color (sRGB) and texture, also by name; it replaces that of a mesh, with a note, unless "
        '`robot_materials = "mesh"`',
    ),
    Feature("origin, @xyz, @rpy", _APPLIED, "of visuals and joints"),
    Feature(
        "joint, parent, child, @link, @type, axis, limit, @lower, @upper", _APPLIED,
        "joints rest at 0, or in the middle of limits that exclude 0",
    ),
    Feature("mimic", _LEFT_OUT, "offsets of mimicking joints are not applied", "joint", _has_offset),
    Feature("gazebo", _LEFT_OUT, "Gazebo's materials and visuals are not drawn", "extension", _has_looks),
    Feature(
        "collision, inertial, transmission, dynamics, safety_controller, calibration, contact, "
        "sensor, ros2_control, plugin, limit@effort, limit@velocity, @id, verbose, self_collision_checking, "
        "collision_checking, joint_properties, group, link@type",
        _IGNORED, "they show nothing",
    ),
)  # fmt: skip
