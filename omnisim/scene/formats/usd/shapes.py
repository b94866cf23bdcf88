"""Parametric shapes of USD: cubes, spheres, cylinders, cones, capsules, planes."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from pxr import Usd, UsdGeom

from omnisim.core.errors import SceneError
from omnisim.scene import primitives
from omnisim.scene.primitives import Surface

_MAX_SIZE = 1e12
# Rotations of a shape around z to each axis; columns are the shape's axes.
_FROM_Z = {
    "X": np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]),
    "Y": np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]),
    "Z": np.eye(3),
}


def read_shape(prim: Usd.Prim, time: Usd.TimeCode, meters_per_unit: float) -> Surface:
    """Triangles of a shape in stage units, with a resolution that suits its size in meters.

    Raises:
        SceneError: an invalid size.
    """
    surface = _SHAPES[str(prim.GetTypeName())](prim, time, meters_per_unit)
    axis = prim.GetAttribute("axis")
    turn = _FROM_Z.get(str(axis.Get(time)) if axis else "Z", np.eye(3))
    return Surface(
        surface.positions @ turn.T / meters_per_unit,
        surface.triangles,
        None if surface.normals is None else surface.normals @ turn.T,
    )


def is_shape(prim: Usd.Prim) -> bool:
    """True for a parametric shape."""
    return str(prim.GetTypeName()) in _SHAPES


def _cube(prim: Usd.Prim, time: Usd.TimeCode, unit: float) -> Surface:
    return primitives.box(np.full(3, 0.5 * _size(prim, "size", time, unit)))


def _sphere(prim: Usd.Prim, time: Usd.TimeCode, unit: float) -> Surface:
    return primitives.ellipsoid(np.full(3, _size(prim, "radius", time, unit)))


def _plane(prim: Usd.Prim, time: Usd.TimeCode, unit: float) -> Surface:
    """Plane that faces +axis; its width is along x, or along z if it faces x."""
    width, length = (0.5 * _size(prim, key, time, unit) for key in ("width", "length"))
    sizes = {"X": (length, width), "Y": (length, width), "Z": (width, length)}
    return primitives.rectangle(*sizes[str(UsdGeom.Plane(prim).GetAxisAttr().Get(time))])


def _cylinder(prim: Usd.Prim, time: Usd.TimeCode, unit: float) -> Surface:
    half_length = 0.5 * _size(prim, "height", time, unit)
    bottom, top = _radii(prim, time, unit)
    if bottom == top:
        return primitives.cylinder(bottom, half_length)
    return _frustum(bottom, top, half_length)


def _cone(prim: Usd.Prim, time: Usd.TimeCode, unit: float) -> Surface:
    half_length = 0.5 * _size(prim, "height", time, unit)
    return _frustum(_size(prim, "radius", time, unit), 0.0, half_length)


def _capsule(prim: Usd.Prim, time: Usd.TimeCode, unit: float) -> Surface:
    bottom, top = _radii(prim, time, unit)
    if bottom != top:
        raise SceneError(f"{prim.GetPath()}: expected a capsule of one radius, got two")
    return primitives.capsule(bottom, 0.5 * _size(prim, "height", time, unit))


_SHAPES: dict[str, Callable[[Usd.Prim, Usd.TimeCode, float], Surface]] = {
    "Cube": _cube, "Sphere": _sphere, "Plane": _plane, "Cylinder": _cylinder,
    "Cylinder_1": _cylinder, "Cone": _cone, "Capsule": _capsule, "Capsule_1": _capsule,
}  # fmt: skip


def _frustum(bottom_m: float, top_m: float, half_length_m: float) -> Surface:
    """Cylinder around z with its ends scaled to two radii."""
    whole = primitives.cylinder(max(bottom_m, top_m), half_length_m)
    assert whole.normals is not None
    radii = np.where(whole.positions[:, 2] < 0.0, bottom_m, top_m) / max(bottom_m, top_m, 1e-300)
    positions, normals = whole.positions.copy(), whole.normals.copy()
    positions[:, :2] *= radii[:, None]
    side = np.abs(normals[:, 2]) < 0.5
    normals[side, 2] = (bottom_m - top_m) / max(2.0 * half_length_m, 1e-300)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    corners = positions[whole.triangles]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    return Surface(positions, whole.triangles[areas > 0.0], normals)


def _radii(prim: Usd.Prim, time: Usd.TimeCode, unit: float) -> tuple[float, float]:
    """Radii at the bottom and at the top."""
    if prim.GetAttribute("radiusBottom"):
        return _size(prim, "radiusBottom", time, unit), _size(prim, "radiusTop", time, unit)
    radius = _size(prim, "radius", time, unit)
    return radius, radius


def _size(prim: Usd.Prim, key: str, time: Usd.TimeCode, unit: float) -> float:
    """Size attribute converted to meters."""
    value = prim.GetAttribute(key).Get(time)
    if not isinstance(value, float) or not (math.isfinite(value) and 0.0 <= value < _MAX_SIZE):
        raise SceneError(f"{prim.GetPath()}.{key} = {value!r:.40}: expected a number ≥ 0")
    return value * unit
