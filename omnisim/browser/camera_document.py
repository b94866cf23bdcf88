"""Camera of the live page as the tables of its files, which are edited, saved and read back."""

from __future__ import annotations

import copy
import dataclasses
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omnisim.cameras import CentralCamera, HyperbolicCamera, NonCentralCamera
from omnisim.errors import SensorFileError
from omnisim.optics.system_file import OpticsFile, parse_optics
from omnisim.sensors import OmniCamera
from omnisim.sensors.degradations import preset
from omnisim.simulation.sensor_toml import sensor_toml
from omnisim.toml_file import read_toml, toml_text

SENSOR_NAME, OPTICS_NAME = "camera.toml", "optics.toml"  # of saved files
SENSOR, OPTICS, SIZE = "sensor", "optics", "size_px"  # first parts of a key's path
SIZES_PX = (16, 2048)  # of the shorter side: what a page shows
Table = dict[str, Any]


@dataclass(frozen=True)
class CameraDocument:
    """Sensor file and optics file of a camera, and the size of its picture.

    Paths in them are absolute.

    Attributes:
        sensor: table of the sensor file; without one in `optics`, it says which camera it is.
        optics: table of the optics file, in place of mirror or lens; None: no optical system.
        size_px: of the shorter side; None: as the files have it.
    """

    sensor: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    optics: Mapping[str, Any] | None = None
    size_px: int | None = None

    @classmethod
    def of_sensor_file(cls, path: Path) -> CameraDocument:
        """Document of a sensor file, with its optics file, if it has one.

        Raises:
            SensorFileError: naming file, key, value and what was expected.
        """
        OmniCamera.from_file(path)
        sensor = _read(path)
        folder = path.resolve().parent
        _make_absolute(sensor.get("lens"), "calibration", folder)
        name = sensor.get("degradation", {}).get("preset", "")
        if name.endswith(".toml"):
            _make_absolute(sensor["degradation"], "preset", folder)
        if "optics" not in sensor:
            return cls(sensor)
        optics = cls.of_optics_file(folder / sensor["optics"]["file"]).optics
        sensor["optics"]["file"] = OPTICS_NAME
        return cls(sensor, optics)

    @classmethod
    def of_optics_file(cls, path: Path) -> CameraDocument:
        """Document of an optics file.

        Raises:
            SensorFileError: naming file, key, value and what was expected.
        """
        read_toml(path, OpticsFile, SensorFileError)
        optics, folder = _read(path), path.resolve().parent
        _make_absolute(optics["camera"], "calibration", folder)
        for surface in optics["surfaces"]:
            _make_absolute(surface, "file", folder)
        return cls({"optics": {"file": OPTICS_NAME}}, optics)

    @classmethod
    def of_lens(cls, model: CentralCamera) -> CameraDocument:
        """Document of a camera model with its parameters."""
        if isinstance(model, HyperbolicCamera):  # a mirror and its camera
            return cls.of_camera(OmniCamera(model, polygons=None))
        return cls({"lens": model.parameters()})

    @classmethod
    def of_camera(cls, camera: OmniCamera) -> CameraDocument:
        """Document of a sensor, with every key.

        Raises:
            SensorFileError: an optical system, whose parameters only its file has.
        """
        if isinstance(camera.model, NonCentralCamera):
            raise SensorFileError("camera: expected a mirror or a lens, got an optical system")
        return cls(tomllib.loads(sensor_toml(camera)))

    def camera(self) -> OmniCamera:
        """The sensor that the files describe.

        Raises:
            SensorFileError: naming key, value and what was expected.
            OpticsError: a size that cannot be.
        """
        if self.optics is None:
            camera = OmniCamera.from_table(dict(self.sensor), SENSOR_NAME)
        else:
            system = parse_optics(self.optics, OPTICS_NAME)
            table = {key: value for key, value in self.sensor.items() if key != "optics"}
            mounting = self.sensor.get("optics", {}).get("mounting")
            if mounting is not None:
                table["mirror"] = {"mounting": mounting}
            camera = OmniCamera.from_table(table, SENSOR_NAME)
            camera = dataclasses.replace(camera, model=system)
        return camera if self.size_px is None else camera.resized(self.size_px)

    def files(self) -> dict[str, str]:
        """Texts of the files by name."""
        files = {SENSOR_NAME: toml_text(self.sensor)}
        if self.optics is not None:
            files[OPTICS_NAME] = toml_text(self.optics)
        return files

    def value(self, path: str) -> Any:
        """Value at a path, such as `sensor.mirror.k` or `optics.surfaces.0.k`; None: not given."""
        found: Any = {SENSOR: self.sensor, OPTICS: self.optics, SIZE: self.size_px}
        for name in path.split("."):
            if isinstance(found, list):
                found = found[int(name)] if name.isdecimal() and int(name) < len(found) else None
            else:
                found = found.get(name) if isinstance(found, Mapping) else None
        return found

    def with_value(self, path: str, value: Any) -> CameraDocument:
        """Document with another value at a path; None takes the key away.

        Raises:
            SensorFileError: a path into something that is no table.
        """
        root, *names = path.split(".")
        if root == SIZE and not names:
            return self._with_size(value)
        whole = {SENSOR: self.sensor, OPTICS: self.optics}
        if root not in whole or not names or whole[root] is None:
            raise SensorFileError(f"{path}: expected a key of the camera's files")
        table = copy.deepcopy(dict(whole[root] or {}))
        at: Any = table
        for name in names[:-1]:
            if isinstance(at, list) and name.isdecimal() and int(name) < len(at):
                at = at[int(name)]
            elif isinstance(at, dict):
                at = at.setdefault(name, {})
            else:
                at = None
        if not isinstance(at, dict):
            raise SensorFileError(f"{path}: expected a key of a table")
        if value is None:
            at.pop(names[-1], None)
        else:
            at[names[-1]] = value
        if root == OPTICS:
            return dataclasses.replace(self, optics=table)
        return dataclasses.replace(self, sensor=table)

    def with_lens(self, parameters: Mapping[str, Any]) -> CameraDocument:
        """Document with a camera model in place of mirror, lens or optical system."""
        return self._with_group("lens", dict(parameters), None)

    def with_mirror(self) -> CameraDocument:
        """Document with the paper's mirror and camera in place of lens or optical system."""
        return self._with_group("mirror", {}, None)

    def with_optics(self, optics: Mapping[str, Any]) -> CameraDocument:
        """Document with an optical system in place of mirror or lens."""
        return self._with_group("optics", {"file": OPTICS_NAME}, dict(optics))

    def with_degradation(self, name: str) -> CameraDocument:
        """Document with the effects of a preset, each with its keys, in place of its own.

        Raises:
            SensorFileError: there is no such preset.
        """
        return self.with_value(f"{SENSOR}.degradation", preset(name).tables() or None)

    def _with_size(self, value: Any) -> CameraDocument:
        low, high = SIZES_PX
        if value is not None and not (type(value) is int and low <= value <= high):
            raise SensorFileError(f"size_px: expected {low} to {high} px, got {value!r}")
        return dataclasses.replace(self, size_px=value)

    def _with_group(
        self, group: str, table: Table, optics: Mapping[str, Any] | None
    ) -> CameraDocument:
        sensor = copy.deepcopy(dict(self.sensor))
        groups = [sensor.pop(name, {}) for name in ("mirror", "lens", "optics")]
        mounting = [one["mounting"] for one in groups if "mounting" in one]
        if mounting:
            table = {**table, "mounting": mounting[0]}
        quality = {
            key: value
            for key, value in sensor.pop("camera", {}).items()
            if key in ("quality", "supersampling")
        }
        sensor |= {group: table} if table else {}
        sensor |= {"camera": quality} if quality else {}
        return dataclasses.replace(self, sensor=sensor, optics=optics)


def _read(path: Path) -> Table:
    return tomllib.loads(path.read_text(encoding="utf-8-sig"))


def _make_absolute(table: Table | None, key: str, folder: Path) -> None:
    if table is not None and isinstance(table.get(key), str):
        table[key] = str((folder / table[key]).resolve())
