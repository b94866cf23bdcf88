"""Names of a MuJoCo model's elements, and of the instances made from its geoms."""

from __future__ import annotations

from collections import Counter

import mujoco

_TYPES = {
    mujoco.mjtGeom.mjGEOM_PLANE: "plane",
    mujoco.mjtGeom.mjGEOM_HFIELD: "hfield",
    mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_BOX: "box",
    mujoco.mjtGeom.mjGEOM_MESH: "mesh",
    mujoco.mjtGeom.mjGEOM_SDF: "sdf",
}
_WORLD = 0


def body_name(model: mujoco.MjModel, body: int) -> str:
    """Name of a body; an unnamed one is named by index, such as body_7."""
    return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body) or f"body_{body}"


def geom_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Unique names of all geoms: body/geom; geoms of the world lack the "world/" prefix.

    An unnamed geom is named after its mesh, or else after its type.
    """
    counts: Counter[str] = Counter()
    names = []
    for geom in range(model.ngeom):
        name = _own_name(model, geom)
        body = int(model.geom_bodyid[geom])
        if body != _WORLD:
            name = f"{body_name(model, body)}/{name}"
        while counts[name]:
            counts[name] += 1
            name = f"{name}_{counts[name]}"
        counts[name] = 1
        names.append(name)
    return tuple(names)


def _own_name(model: mujoco.MjModel, geom: int) -> str:
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom)
    kind = int(model.geom_type[geom])
    if not name and kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = int(model.geom_dataid[geom])
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_MESH, mesh)
    return name or _TYPES[mujoco.mjtGeom(kind)]
