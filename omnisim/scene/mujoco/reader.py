"""Importer of MuJoCo models: files, and models in memory at the moment of their data."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import SceneError
from omnisim.poses import pose_from_rotation
from omnisim.scene.imported import ImportedScene, translate
from omnisim.scene.mujoco.deformables import Deformable, flexes, skins
from omnisim.scene.mujoco.geometry import Geom
from omnisim.scene.mujoco.lights import read_background, read_lighting
from omnisim.scene.mujoco.meshes import Meshes, Parts
from omnisim.scene.mujoco.names import geom_names
from omnisim.scene.parts import Instance
from omnisim.short_repr import counted

# Groups of geoms that MuJoCo's own viewer shows; others mostly are collision shapes.
VISIBLE_GROUPS = (0, 1, 2)


def read_mjcf(path: Path) -> ImportedScene:
    """Read a model's file, in its first keyframe, or else in its initial configuration.

    Raises:
        SceneError: MuJoCo cannot read it.
    """
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, mujoco.FatalError, UnicodeDecodeError) as reason:
        raise SceneError(f"cannot be read by MuJoCo: {_one_line(str(reason))}") from None
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)  # of which lights and cameras are in the tracking modes
    mujoco.mj_camlight(model, data)
    mujoco.mj_flex(model, data)
    return read_model(model, data)


def read_model(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    groups: Collection[int] = VISIBLE_GROUPS,
    bodies: Collection[int] | None = None,
) -> ImportedScene:
    """Import a model as it is at the moment of its data.

    Args:
        model, data: after mj_forward, or what of it makes the poses.
        groups: of the geoms, skins and flexible bodies that are drawn.
        bodies: whose geoms are, without skins and flexible bodies; None: all.
    """
    meshes, names = Meshes(model), geom_names(model)
    geoms = visible_geoms(model, meshes, groups)
    notices = _geom_notices(model, geoms, groups)
    if bodies is not None:
        geoms = [geom for geom in geoms if int(model.geom_bodyid[geom]) in bodies]
    instances = [
        instance
        for geom in geoms
        for instance in place_parts(
            names[geom], meshes.of_geom(geom, names[geom]), _pose(data, geom)
        )
    ]
    if bodies is None:
        soft = [one for one in (*skins(model, data), *flexes(model, data)) if one.group in groups]
        instances += _deformed(meshes, soft)
    lighting, lights = read_lighting(model, data)
    background, sky = read_background(model, meshes.materials.textures)
    return ImportedScene(
        tuple(meshes.entries),
        tuple(meshes.materials.entries),
        tuple(instances),
        [*notices, *meshes.materials.notices, *lights, *sky],
        lighting=lighting,
        background=background,
    )


def visible_geoms(model: mujoco.MjModel, meshes: Meshes, groups: Collection[int]) -> list[int]:
    """Geoms of some groups that are not wholly transparent."""
    return [
        geom
        for geom in range(model.ngeom)
        if int(model.geom_group[geom]) in groups and meshes.rgba(geom)[3] > 0.0
    ]


def place_parts(name: str, parts: Parts, pose: NDArray[np.float64]) -> Iterable[Instance]:
    """Instances of a geom's meshes, at its pose."""
    return (Instance(name, mesh, translate(pose, center), pose) for mesh, center in parts)


def _pose(data: mujoco.MjData, geom: int) -> NDArray[np.float64]:
    return pose_from_rotation(data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom])


def _deformed(meshes: Meshes, soft: Iterable[Deformable]) -> list[Instance]:
    return [
        instance
        for one in soft
        if len(one.mapped.surface.triangles)
        for instance in place_parts(
            one.name, meshes.add(one.name, one.mapped, one.material, one.rgba), np.eye(4)
        )
    ]


def _geom_notices(model: mujoco.MjModel, geoms: list[int], groups: Collection[int]) -> list[str]:
    notices = []
    hidden = sum(int(group) not in groups for group in model.geom_group)
    if hidden:
        others = sorted({int(group) for group in model.geom_group} - set(groups))
        listed = ", ".join(map(str, others))
        notices.append(f"not drawn, as in MuJoCo: {counted(hidden, 'geom')} of group {listed}")
    fields = sum(int(model.geom_type[geom]) == Geom.mjGEOM_SDF for geom in geoms)
    if fields:
        notices.append(f"drawn as meshes: {counted(fields, 'signed distance field')}")
    ropes = int((model.flex_dim == 1).sum())
    if ropes:
        notices.append(f"not drawn: {counted(ropes, 'flexible line')} without a surface")
    return notices


def _one_line(text: str) -> str:
    return " ".join(text.split())
