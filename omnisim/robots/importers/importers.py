"""Importers of robots, selected by file format."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from omnisim.core.errors import RobotFileError
from omnisim.core.extras import require_extra
from omnisim.core.files.sources import SourceReader, fingerprint, source_digest
from omnisim.robots import Robot
from omnisim.robots.importers.imported_robot import ImportedRobot
from omnisim.robots.vehicle import Vehicle

Resources = Sequence[str | Path]

SUFFIXES = (".sdf", ".world", ".urdf", ".xml", ".mjcf")


def import_model(path: Path, name: str | None = None, resources: Resources = ()) -> ImportedRobot:
    """Import the robot of a model file.

    Suffixes but the `SUFFIXES` are read as MJCF. `name` is that of a model in a file with several;
    `resources` are folders of referenced models and packages.

    Raises:
        RobotFileError: the file or the model is missing, or a value is invalid.
        OmnisimError: MuJoCo is not installed.
    """
    if not path.is_file():
        raise RobotFileError(f"{path}: no such file")
    # imported on demand: robot files need none of the formats
    suffix = path.suffix.lower()
    if suffix in (".sdf", ".world"):
        from omnisim.robots.importers import gazebo_robot

        return gazebo_robot.import_model(path, name, resources)
    from omnisim.scene.formats.xml.element import is_urdf

    has_urdf = suffix == ".urdf" or is_urdf(path)
    if name is not None:
        raise RobotFileError(f"{path}: --class: expected none, as the file has one robot")
    if has_urdf:
        from omnisim.robots.importers.urdf_robot import import_urdf

        return import_urdf(path, resources)
    require_extra("mujoco", str(path))
    from omnisim.robots.importers.mjcf_robot import import_mjcf  # needs the extra

    return import_mjcf(path, resources)


class LoadedModel(NamedTuple):
    """Robot loaded from a model, without a robot file."""

    robot: Robot  # robot as parsed from the equivalent robot file
    vehicle: Vehicle  # vehicle with its body and sensors
    notices: tuple[str, ...]  # one line per omission or assumption


def load_robot_model(path: Path, resources: Resources = ()) -> LoadedModel:
    """Load a model file as a vehicle.

    Raises:
        OmnisimError: see `import_model` and `Vehicle.from_robot`.
    """
    imported = import_model(path, None, resources)
    robot = imported.robot(path)
    vehicle = Vehicle.from_robot(robot, imported.cameras)
    reader = SourceReader()
    reader.note(path)
    content = None if vehicle.body is None else fingerprint(vehicle.body)
    vehicle = vehicle.identified(source_digest(reader.digest(path.parent), content))
    return LoadedModel(robot, vehicle, imported.notices)
