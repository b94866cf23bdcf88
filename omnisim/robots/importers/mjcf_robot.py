"""Import of MuJoCo robots: wheels by their joints, cameras and IMUs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import mujoco
import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import OmnisimError, RobotFileError
from omnisim.core.poses import pose_from_rotation
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.robots.importers.imported_robot import (
    ImportedRobot,
    ImportedSensor,
    Mechanics,
    Wheel,
    imported_robot,
    is_across,
    load_body,
)
from omnisim.scene.formats.imported_scene import unique_name
from omnisim.scene.formats.mjcf import reader
from omnisim.sensors.sensor_table import folder_name

_SHOWN = 4  # maximum number of names in a message
_INERTIAL = (mujoco.mjtSensor.mjSENS_GYRO, mujoco.mjtSensor.mjSENS_ACCELEROMETER)
_OBJECTS = mujoco.mjtObj


def import_mjcf(path: Path, resources: Sequence[str | Path] = ()) -> ImportedRobot:
    """Import the robot of a model: its only top-level body.

    MuJoCo resolves its own paths, without the `resources`.
    """
    notices: list[str] = []
    try:
        model, data, _ = reader.load_model(path)
        mechanics = _mechanics(model, data, path, notices)
    except RobotFileError:
        raise
    except OmnisimError as reason:
        raise RobotFileError(f"{path}: {reason}") from None
    except UnicodeDecodeError as reason:
        raise RobotFileError(
            f"{path}: expected names in UTF-8, got {bytes(reason.object)!r:.40}"
        ) from None
    body = load_body(path, resources, notices)
    if body is not None:
        body = reader.without_world(body, path)
    return imported_robot(mechanics, path, body, (), notices)


def _mechanics(
    model: mujoco.MjModel, data: mujoco.MjData, path: Path, notices: list[str]
) -> Mechanics:
    root = _root(model, path, notices)
    if not (np.isfinite(data.xpos).all() and np.isfinite(data.subtree_com).all()):
        raise RobotFileError(f"{path}: expected bodies at finite positions")
    wheels = list(_wheels(model, data, root))
    sensors = [*_cameras(model, data, notices), *_imus(model, data)]
    others = [int(kind) for kind in model.sensor_type if int(kind) not in _INERTIAL]
    if others:
        kinds = sorted({mujoco.mjtSensor(other).name[len("mjSENS_") :].lower() for other in others})
        notices.append(f"left out, as omnisim has no such sensor: {_listed(kinds)}")
    mass_kg, center_m = float(model.body_subtreemass[root]), np.array(data.subtree_com[root])
    return Mechanics(reader.body_name(model, root), wheels, mass_kg, center_m, sensors, {})


def _root(model: mujoco.MjModel, path: Path, notices: list[str]) -> int:
    """Index of the robot's root body; a notice lists the world's own geoms, which are left out."""
    roots = [body for body in range(1, model.nbody) if model.body_parentid[body] == 0]
    others = [
        name
        for geom, name in enumerate(reader.geom_names(model))
        if model.geom_bodyid[geom] == 0 and int(model.geom_group[geom]) in reader.VISIBLE_GROUPS
    ]
    if len(roots) != 1:
        shown = _listed([reader.body_name(model, body) for body in roots])
        raise RobotFileError(f"{path}: expected the model of one robot, got {shown or 'no body'}")
    if others:
        notices.append(f"left out, as they belong to the world: {_listed(others)}")
    return roots[0]


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:_SHOWN]) + (", …" if len(names) > _SHOWN else "")


def _wheels(model: mujoco.MjModel, data: mujoco.MjData, root: int) -> Iterator[Wheel]:
    """Wheels: bodies on unlimited hinges about y, fixed to the robot's root body."""
    for joint in range(model.njnt):
        body = int(model.jnt_bodyid[joint])
        parent = int(model.body_parentid[body])
        while parent not in (0, root) and model.body_dofnum[parent] == 0:
            parent = int(model.body_parentid[parent])
        is_hinge = int(model.jnt_type[joint]) == mujoco.mjtJoint.mjJNT_HINGE
        if not is_hinge or model.jnt_limited[joint] or model.body_dofnum[body] != 1:
            continue
        if parent != root or not is_across(data.xaxis[joint]):
            continue
        first = int(model.body_geomadr[body])
        geoms = range(first, first + int(model.body_geomnum[body]))
        tires = [tire for geom in geoms if (tire := _tire(model, data, geom))]
        if tires:
            middle_m, radius_m = max(tires, key=lambda tire: tire[1])
            name = _name(model, _OBJECTS.mjOBJ_JOINT, joint) or reader.body_name(model, body)
            yield Wheel(name, middle_m, radius_m)


def _name(model: mujoco.MjModel, kind: mujoco.mjtObj, number: int) -> str:
    return mujoco.mj_id2name(model, kind, number) or ""


def _tire(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> tuple[Floats, float] | None:
    """Center (3,) and radius of a round geom or a mesh; None for other shapes."""
    kinds, kind = mujoco.mjtGeom, int(model.geom_type[geom])
    middle_m = np.array(data.geom_xpos[geom])
    if kind in (kinds.mjGEOM_CYLINDER, kinds.mjGEOM_SPHERE, kinds.mjGEOM_ELLIPSOID):
        return middle_m, float(model.geom_size[geom][0])
    if kind != kinds.mjGEOM_MESH:
        return None
    center_m, half_m = model.geom_aabb[geom][:3], model.geom_aabb[geom][3:]
    middle_m = middle_m + data.geom_xmat[geom].reshape(3, 3) @ center_m
    return middle_m, float(np.median(half_m))


def _cameras(
    model: mujoco.MjModel, data: mujoco.MjData, notices: list[str]
) -> Iterator[ImportedSensor]:
    """Cameras with lenses of their own; cameras fixed to the world are skipped."""
    used_names: set[str] = set()
    for number in range(model.ncam):
        name = _name(model, _OBJECTS.mjOBJ_CAMERA, number)
        if not name or model.cam_bodyid[number] == 0:
            why = "is the world's" if name else "has no name"
            notices.append(f"left out: camera {name or number} {why}")
            continue
        try:
            camera = OmniCamera(reader.lens_of(model, name), polygons=None)
        except OmnisimError as reason:
            notices.append(f"left out: {reason}")
            continue
        pose = reader.tracked_pose(data.cam_xpos[number], data.cam_xmat[number])
        unique = unique_name(folder_name(name), used_names)
        yield ImportedSensor.at(unique, "omnicamera", pose, {}, camera)


def _imus(model: mujoco.MjModel, data: mujoco.MjData) -> Iterator[ImportedSensor]:
    sites = {
        int(model.sensor_objid[number])
        for number in range(model.nsensor)
        if int(model.sensor_type[number]) in _INERTIAL
    }
    for number, site in enumerate(sorted(sites)):
        name = folder_name(_name(model, _OBJECTS.mjOBJ_SITE, site) or f"imu_{number}")
        pose = pose_from_rotation(data.site_xmat[site].reshape(3, 3), data.site_xpos[site])
        yield ImportedSensor.at(name, "imu", pose, {"device": "ideal"})
