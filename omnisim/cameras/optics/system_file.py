"""Optics files: a camera and the surfaces in front of it, in TOML."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from omnisim.cameras import CAMERA_MODELS, CentralCamera
from omnisim.cameras.camera_table import camera_from_calibration, camera_from_table
from omnisim.cameras.optics.surface_tables import AlignmentTable, SurfaceTable
from omnisim.cameras.optics.system import ORIENTATIONS, OpticalSystem
from omnisim.core.errors import OmnisimError, SensorFileError
from omnisim.core.files.extended_tables import extended
from omnisim.core.files.parameters import Number, Table, described, overriding, parse_table
from omnisim.core.files.toml_file import read_tables
from omnisim.core.poses import POSE_TOLERANCE, is_rotation

_OF_SENSORS = ("mounting", "polygons")  # keys of [optics] in a sensor file
_Direction = tuple[Number, Number, Number]
_Looking = Annotated[
    Literal["up", "ahead", "down"] | tuple[_Direction, _Direction, _Direction],
    described("up, ahead, down, or a rotation, a 3 × 3 matrix"),
]


class CameraTable(AlignmentTable):
    """Central camera behind the surfaces.

    It is either a model with its parameters as additional keys, or a calibration file.
    """

    model: str | None = None
    """Name of the camera model; its parameters are additional keys of this table."""
    calibration: str | None = None
    """Calibration file, relative to this file, instead of model."""
    camera: str | None = None
    """Name of a camera in the calibration file; default: the first."""

    def make_camera(self, source: str, key: str) -> CentralCamera:
        """Build the camera.

        Args:
            source: file name, for messages.
            key: key of this table in the file.

        Raises:
            SensorFileError: the table is invalid; names the key and the expected value.
        """
        extra = dict(self.__pydantic_extra__ or {})
        if self.calibration is not None:
            keys = extra if self.model is None else {"model": self.model, **extra}
            return camera_from_calibration(self.calibration, self.camera, keys, source, key)
        parameters = {"model": self.model, **extra}
        width, height = extra.get("width_px"), extra.get("height_px")
        model = CAMERA_MODELS.get(self.model or "")
        has_center = model is not None and "principal_point_px" in model.__dataclass_fields__
        if has_center:
            sizes = [one if isinstance(one, int) else 1 for one in (width, height)]
            middle = [0.5 * (one - 1) for one in sizes]
            parameters.setdefault("principal_point_px", middle)
        return camera_from_table(parameters, source, key)


@overriding(
    OpticalSystem,
    *("medium", "looking", "origin_m", "color", "chromatic", "camera", "surfaces", "obstacles"),
    defaults={},
    are_first=True,
)
class OpticsFile(Table):
    """A complete optics file."""

    looking: _Looking | None = None
    """Direction of the camera's axis in a level rig, or the rotation from the system's frame to it;
    default: up into a mirror, else as the camera itself."""
    camera: CameraTable
    surfaces: Annotated[tuple[SurfaceTable, ...], Field(min_length=1, max_length=16)]

    def orientation(self, where: str) -> NDArray[np.float64] | None:
        """Rotation (3, 3) of `looking`, or None; `where` names the key in messages.

        Raises:
            SensorFileError: the matrix is not a rotation.
        """
        if self.looking is None or isinstance(self.looking, str):
            return None if self.looking is None else ORIENTATIONS[self.looking]
        matrix = np.array(self.looking)
        if not is_rotation(matrix, POSE_TOLERANCE):
            raise SensorFileError(f"{where}: expected a rotation, got {matrix.tolist()}")
        return matrix


class OpticsTables(NamedTuple):
    """Table of an optical system in a file."""

    table: dict[str, Any]  # keys of an optics file
    source: str  # file that has them, to which paths are relative
    at: str  # key of the table in the file; empty: the file itself


def read_optics_tables(path: str | Path) -> OpticsTables:
    """Read the table of an optics file or of a sensor file with `[optics]`, without validation.

    Raises:
        SensorFileError: a file cannot be read, or is not TOML.
    """
    if Path(path).suffix.lower() == ".csv":
        raise SensorFileError(
            f"{path}: a mirror's profile: expected an optics file, .toml, with a surface of "
            'shape = "table" that names it, as `omnisim optics design -o mirror.toml` writes'
        )
    table = extended(read_tables(Path(path), SensorFileError), str(path), SensorFileError)
    in_sensor = table.get("optics")
    if "surfaces" in table or not isinstance(in_sensor, dict):
        return OpticsTables(table, str(path), "")
    if isinstance(in_sensor.get("file"), str):
        file = Path(path).parent / in_sensor["file"]
        return OpticsTables(read_tables(file, SensorFileError), str(file), "")
    own = {key: value for key, value in in_sensor.items() if key not in _OF_SENSORS}
    return OpticsTables(own, str(path), "optics")


def read_optics_file(path: str | Path) -> OpticalSystem:
    """Read an optical system from an optics file or from a sensor file with `[optics]`.

    Raises:
        SensorFileError: the file is invalid; names file, key, actual and expected value.
    """
    return parse_optics(*read_optics_tables(path))


def parse_optics(table: Mapping[str, Any], source: str = "optics", at: str = "") -> OpticalSystem:
    """Build the optical system from a table with the keys of an optics file.

    Args:
        table: a system's `parameters()`, or the content of an optics file.
        source: file name, for messages; paths are relative to its folder.
        at: key of the table in the file; empty: the file itself.

    Raises:
        SensorFileError: the table is invalid; names `source`, key, actual and expected value.
    """
    if table.get("model") == OpticalSystem.model_name:
        table = {key: value for key, value in table.items() if key != "model"}
    return _make_system(parse_table(table, OpticsFile, SensorFileError, source, at), source, at)


def _make_system(file: OpticsFile, source: str, at: str = "") -> OpticalSystem:
    below = f"{at}." if at else ""
    surfaces = [
        surface
        for number, table in enumerate(file.surfaces)
        for surface in table.make_surfaces(source, f"{below}surfaces.{number}")
    ]
    camera = file.camera.make_camera(source, f"{below}camera")
    orientation = file.orientation(f"{source}: {below}looking")
    try:
        return file.build(
            OpticalSystem,
            camera=camera,
            surfaces=tuple(surfaces),
            system_from_camera=file.camera.system_from_part((0.0, 0.0, 0.0)),
            orientation=orientation,
        )
    except OmnisimError as reason:
        raise SensorFileError(f"{source}: {below}{reason}") from None


def input_files(path: Path) -> dict[str, Path]:
    """Optics file and its profile files, by their names in messages.

    Raises:
        SensorFileError: the file cannot be read.
    """
    files = {"the optics file": path}
    table = read_tables(path, SensorFileError)
    in_sensor = table.get("optics")
    if "surfaces" not in table and isinstance(in_sensor, dict):
        table = in_sensor
        if isinstance(in_sensor.get("file"), str):
            path = path.parent / in_sensor["file"]
            files["the sensor's optics file"] = path
            table = read_tables(path, SensorFileError)
    surfaces = table.get("surfaces")
    for number, surface in enumerate(surfaces if isinstance(surfaces, list) else []):
        if isinstance(surface, dict) and isinstance(surface.get("file"), str):
            files[f"the profile of surfaces.{number}"] = path.parent / surface["file"]
    return files
