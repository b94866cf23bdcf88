"""Editable camera of the live page: the table of its sensor file."""

from __future__ import annotations

import copy
import dataclasses
import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pydantic

from omnisim.apps.live.scene_in_light import completed
from omnisim.cameras import HyperbolicCamera
from omnisim.cameras.optics.system_file import OpticsFile
from omnisim.core.errors import SensorFileError
from omnisim.core.files.file_keys import keys_of
from omnisim.core.files.toml_file import read_toml, toml_text
from omnisim.rendering.camera.degradations import preset
from omnisim.rendering.camera.degradations.degradation_file import EFFECTS
from omnisim.rendering.camera.omnicamera import ExposureOption, OmniCamera
from omnisim.rendering.camera.sensor_file import DEFAULT_SENSOR_FILE, SensorFile

FILE_NAME = "camera.toml"  # name of a saved file
SENSOR, LIGHT, SIZE = "sensor", "scene", "size_px"  # first parts of the paths of keys
SIZES_PX = (16, 2048)  # range of the shorter side
Table = dict[str, Any]


@dataclass(frozen=True)
class CameraDocument:
    """Sensor file of a camera, the size of its image and the light of the scene.

    Paths in the table are absolute, and an optics file is embedded in the table.

    Attributes:
        sensor: table of the sensor file.
        size_px: shorter side of the image; None: the sensor file's size.
        light: tables of a scene's TOML for its light, sky and fog; empty: the scene's own light.
    """

    sensor: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    size_px: int | None = None
    light: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    @classmethod
    def of_sensor_file(cls, path: Path) -> CameraDocument:
        """Document of a sensor file, including its optics file.

        Raises:
            SensorFileError: an invalid file; the message names file, key, actual and expected
                value.
        """
        OmniCamera.from_file(path)
        sensor, folder = _read(path), path.resolve().parent
        _make_absolute(sensor.get("lens"), "calibration", folder)
        degradation = sensor.get("degradation", {})
        if degradation.get("preset", "").endswith(".toml"):
            _make_absolute(degradation, "preset", folder)
        for name, effect in EFFECTS.items():
            for key in effect.files:
                _make_absolute(degradation.get(name), key, folder)
        optics = sensor.get("optics")
        if optics is not None and "file" in optics:
            sensor["optics"] = optics | _read_optics(folder / optics.pop("file"))
        elif optics is not None:
            _make_optics_absolute(optics, folder)
        return cls(sensor)

    @classmethod
    def of_optics_file(cls, path: Path) -> CameraDocument:
        """Document of an optics file.

        Raises:
            SensorFileError: an invalid file; the message names file, key, actual and expected
                value.
        """
        read_toml(path, OpticsFile, SensorFileError)
        return cls({"optics": _read_optics(path)})

    @classmethod
    def of_camera(cls, camera: OmniCamera) -> CameraDocument:
        """Document of a camera, without keys at their defaults.

        If the mirror's rim fills the image, focal length and principal point are left out, so that
        the rim still fills the image after the mirror's parameters change.
        """
        sensor = tomllib.loads(camera.to_toml())
        if isinstance(camera.model, HyperbolicCamera):
            model, table = camera.model, sensor["camera"]
            fitted = model.framed_on_rim(model.mirror, model.width_px, model.height_px)
            if fitted.focal_length_px == model.focal_length_px:
                del table["focal_length_px"]
            if fitted.principal_point_px == model.principal_point_px:
                del table["principal_point_px"]
        return cls(_without_defaults(sensor, SensorFile))

    def camera(self) -> OmniCamera:
        """Camera that the document describes.

        Raises:
            SensorFileError: an invalid value; the message names key, actual and expected value.
            OpticsError: an invalid image size.
        """
        camera = OmniCamera.from_table(dict(self.sensor), FILE_NAME)
        return camera if self.size_px is None else camera.resized(self.size_px)

    @property
    def text(self) -> str:
        """Text of the sensor file."""
        return toml_text(self.sensor)

    def checked_text(self) -> str:
        """Text of the sensor file to save, after a check that `--sensor` can read it.

        An empty document yields the default sensor file.

        Raises:
            SensorFileError: an invalid value; the message names key, actual and expected value.
        """
        text = self.text or DEFAULT_SENSOR_FILE.read_text(encoding="utf-8")
        OmniCamera.from_table(tomllib.loads(text), FILE_NAME)
        return text

    def value(self, path: str) -> Any:
        """Value at a path, such as `sensor.optics.surfaces.0.k`; None: not set."""
        current: Any = {SENSOR: self.sensor, LIGHT: self.light, SIZE: self.size_px}
        for name in path.split("."):
            if isinstance(current, list):
                current = (
                    current[int(name)] if name.isdecimal() and int(name) < len(current) else None
                )
            else:
                current = current.get(name) if isinstance(current, Mapping) else None
        return current

    def with_value(self, path: str, value: Any) -> CameraDocument:
        """Copy with another value at a path; None removes the key.

        Raises:
            SensorFileError: the path is not that of a key in a table, or the size is out of range.
        """
        root, *names = path.split(".")
        if root == SIZE and not names:
            return self._with_size(value)
        if root not in (SENSOR, LIGHT) or not names:
            raise SensorFileError(f"{path}: expected a key of the camera's or the scene's file")
        is_light = root == LIGHT
        table = copy.deepcopy(dict(self.light if is_light else self.sensor))
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
        if is_light:
            return dataclasses.replace(self, light=completed(table))
        return dataclasses.replace(self, sensor=table)

    def with_lens(self, parameters: Mapping[str, Any]) -> CameraDocument:
        """Copy with a camera model in place of a mirror, lens or optical system."""
        return self._with_group("lens", dict(parameters))

    def with_mirror(self) -> CameraDocument:
        """Copy with the paper's mirror and camera in place of a lens or optical system."""
        return self._with_group("mirror", {})

    def with_optics(self, optics: Mapping[str, Any]) -> CameraDocument:
        """Copy with an optical system in place of a mirror or lens."""
        return self._with_group("optics", dict(optics))

    def with_degradation(self, name: str) -> CameraDocument:
        """Copy with the degradations of a preset in place of all others.

        Raises:
            SensorFileError: no such preset.
        """
        tables = json.loads(json.dumps(preset(name).tables()))  # with lists, as in a file
        return self.with_value(f"{SENSOR}.degradation", tables or None)

    def with_exposure(self, exposure: ExposureOption) -> CameraDocument:
        """Copy with a fixed exposure, EV, or with automatic exposure.

        Raises:
            SensorFileError: the document describes no valid camera.
        """
        changed = self.camera().with_exposure(exposure).degradation.exposure
        assert changed is not None
        return self.with_value(f"{SENSOR}.degradation.exposure", changed.to_table(full=True))

    def _with_size(self, value: Any) -> CameraDocument:
        low, high = SIZES_PX
        if value is not None and not (type(value) is int and low <= value <= high):
            raise SensorFileError(f"size_px: expected {low} to {high} px, got {value!r}")
        return dataclasses.replace(self, size_px=value)

    def _with_group(self, group: str, table: Table) -> CameraDocument:
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
        return dataclasses.replace(self, sensor=sensor)


def _without_defaults(table: Table, model: type[pydantic.BaseModel]) -> Table:
    """Copy of a table without the values that equal the defaults of its schema `model`."""
    kept: Table = {}
    keys = {key.name: key for key in keys_of(model)}
    for name, value in table.items():
        key = keys.get(name)
        if key and key.inner and isinstance(value, dict):
            value = _without_defaults(value, key.inner.model)
            if not value and name != "lens":
                continue
        elif key and not key.field.is_required():
            default = key.default
            if value == (list(default) if isinstance(default, tuple) else default):
                continue
        kept[name] = value
    return kept


def _read(path: Path) -> Table:
    return tomllib.loads(path.read_text(encoding="utf-8-sig"))


def _read_optics(path: Path) -> Table:
    table = _read(path)
    _make_optics_absolute(table, path.resolve().parent)
    return table


def _make_optics_absolute(table: Table, folder: Path) -> None:
    _make_absolute(table.get("camera"), "calibration", folder)
    for surface in table.get("surfaces", ()):
        _make_absolute(surface, "file", folder)


def _make_absolute(table: Table | None, key: str, folder: Path) -> None:
    if table is not None and isinstance(table.get(key), str):
        table[key] = str((folder / table[key]).resolve())
