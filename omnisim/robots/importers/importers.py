"""Importers of robots, by the formats of their models."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from omnisim.core.errors import RobotFileError
from omnisim.core.extras import require_extra
from omnisim.core.files.fingerprint import fingerprint
from omnisim.core.files.sources import note_file, recorded_sources, source_digest
from omnisim.robots import Robot
from omnisim.robots.importers.imported_robot import ImportedRobot
from omnisim.robots.vehicle import Vehicle

_GAZEBO, _MJCF = (".sdf", ".world"), (".xml", ".mjcf")
SUFFIXES = (*_GAZEBO, ".urdf", *_MJCF)


def import_model(
    path: Path, name: str | None = None, resources: Sequence[str | Path] = ()
) -> ImportedRobot:
    """Import the robot of a model.

    Args:
        path: of Gazebo, URDF or MuJoCo.
        name: of the model, in a file of several.
        resources: folders of models and packages that it names.

    Raises:
        RobotFileError: no such file or model, or values that are none.
        OmnisimError: MuJoCo is not installed.
    """
    if not path.is_file():
        raise RobotFileError(f"{path}: no such file")
    # drives of robot files import none of these
    if path.suffix.lower() in _GAZEBO:
        from omnisim.robots.importers.gazebo.gazebo_robot import import_model as import_gazebo_model

        return import_gazebo_model(path, name, resources)
    if name is not None:
        raise RobotFileError(f"{path}: --class: expected none, as the file has one robot")
    from omnisim.scene.formats.urdf.document import is_urdf

    if path.suffix.lower() == ".urdf" or is_urdf(path):
        from omnisim.robots.importers.urdf_robot import import_urdf

        return import_urdf(path, resources)
    require_extra("mujoco", str(path))
    from omnisim.robots.importers.mjcf_robot import import_mjcf  # of the extra

    return import_mjcf(path, resources)


class LoadedModel(NamedTuple):
    """Robot of a model, without a robot file.

    Attributes:
        robot: of the table that a robot file would have.
        vehicle: with its body and sensors.
        notices: one line each.
    """

    robot: Robot
    vehicle: Vehicle
    notices: tuple[str, ...]


def load_robot_model(path: Path, resources: Sequence[str | Path] = ()) -> LoadedModel:
    """Load the robot of a model.

    Raises:
        OmnisimError: as `import_model` and `Vehicle.from_robot` do.
    """
    imported = import_model(path, None, resources)
    robot = imported.robot(path)
    vehicle = Vehicle.from_robot(robot, imported.cameras)
    with recorded_sources() as sources:
        note_file(path)
    content = None if vehicle.body is None else fingerprint(vehicle.body)
    vehicle = vehicle.identified(source_digest(sources.digest(path.parent), content))
    return LoadedModel(robot, vehicle, imported.notices)
