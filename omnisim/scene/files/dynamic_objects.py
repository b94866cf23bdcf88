"""Dynamic objects of a scene's TOML file: their shapes and motions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, assert_never

import numpy as np

from omnisim.core.errors import SceneError, TrajectoryError
from omnisim.core.files.toml_file import find_beside
from omnisim.core.poses import pose_from_rotation, rotation_from_yaw
from omnisim.scene.files.scene_file import (
    ObjectPathTable,
    ObjectTable,
    ObjectTrajectoryTable,
)
from omnisim.scene.model import DynamicObject, Scene
from omnisim.scene.motion.object_motion import Along, FreeBody, Orbit, Rest, Rolling, Shuttle

if TYPE_CHECKING:
    from omnisim.core.trajectories import Trajectory


# Loader of an object's shape from a file, with an up axis and an animation.
LoadShape = Callable[[Path, str | None, str | None], Scene]


def load_objects(
    tables: tuple[ObjectTable, ...], folder: Path, load_shape: LoadShape
) -> tuple[DynamicObject, ...]:
    """Load the dynamic objects of a scene's TOML file.

    Args:
        tables: validated object tables.
        folder: folder of the TOML file, the base of relative paths.
        load_shape: loader for a mesh file or a scene TOML file.

    Raises:
        SceneError: an object is invalid; names object, key, actual and expected value.
    """
    return tuple(_load_object(table, folder, load_shape) for table in tables)


def _load_object(table: ObjectTable, folder: Path, load_shape: LoadShape) -> DynamicObject:
    where = f"object {table.name!r}"
    path = find_beside(folder, table.file, f"{where}: file", SceneError)
    # the name enters fingerprints, so it must not depend on this machine's paths
    shape = load_shape(path, table.up_axis, table.animation)
    shape = shape.altered("", name=table.file)
    if shape.objects:
        raise SceneError(f"{where}: file = {table.file!r}: expected no [[objects]] in an object")
    try:
        motion = _motion(table, folder)
    except TrajectoryError as reason:
        raise SceneError(f"{where}: {reason}") from None
    if table.rolling_radius_m is not None and not isinstance(motion, Rest):
        return DynamicObject(table.name, shape, Rolling(motion, table.rolling_radius_m))
    return DynamicObject(table.name, shape, motion)


def _motion(table: ObjectTable, folder: Path) -> Along | Orbit | Shuttle | Rest:
    match table.motion:
        case None:
            return table.build(Rest if table.mass_kg is None else FreeBody)
        case ObjectPathTable() as path:
            return Along(_trajectory(path), path.repeats)
        case ObjectTrajectoryTable() as along:
            from omnisim.core.trajectories import read_trajectory

            return Along(read_trajectory(folder / along.file), along.repeats)
        case Orbit() | Shuttle() as motion:
            return motion
        case other:
            assert_never(other)


def _trajectory(path: ObjectPathTable) -> Trajectory:
    from omnisim.core.trajectories import Trajectory

    yaw_deg = path.yaw_deg or (0.0,) * len(path.times_s)
    for key, values in (("positions_m", path.positions_m), ("yaw_deg", yaw_deg)):
        if len(values) != len(path.times_s):
            raise TrajectoryError(
                f"path.{key}: expected {len(path.times_s)}, one for each of times_s, "
                f"got {len(values)}"
            )
    poses = pose_from_rotation(rotation_from_yaw(np.radians(yaw_deg)), np.array(path.positions_m))
    return Trajectory(np.array(path.times_s), poses)
