"""Editable camera and light of the live page, as tables of TOML files, and their presets."""

from __future__ import annotations

import copy
import dataclasses
import json
import math
import tempfile
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pydantic

from omnisim.cameras import HyperbolicCamera
from omnisim.cameras.catalog.lens_catalog import PREFIX, search
from omnisim.cameras.models.field_of_view import angles_of_view
from omnisim.cameras.optics.system_file import AlignmentTable, OpticsFile
from omnisim.core.errors import OutputError, SceneError, SensorFileError, did_you_mean
from omnisim.core.files.file_keys import keys_of
from omnisim.core.files.toml_file import read_toml, toml_text
from omnisim.rendering.camera.degradations import preset, preset_names
from omnisim.rendering.camera.degradations.degradation_file import EFFECTS
from omnisim.rendering.camera.omnicamera import ExposureOption, OmniCamera
from omnisim.rendering.camera.sensor_file import DEFAULT_SENSOR_FILE, SensorFile
from omnisim.scene import Scene

SCENE_FILE = "scene.toml"  # name of a saved scene
Table = dict[str, Any]
# Required keys of a table, with clearly visible values: indoor mist.
_COMPLETE = {"fog": {"color": [0.7, 0.75, 0.8], "visibility_m": 20.0}}
# Command-line options that the tables override.
_OVERRIDDEN_BY = {"--sky": {"sky"}, "--baked": {"sky", "light"}}
FILE_NAME = "camera.toml"  # name of a saved file
SENSOR, LIGHT, SIZE = "sensor", "scene", "size_px"  # first parts of the paths of keys
SIZES_PX = (16, 2048)  # range of the shorter side
PRESETS_FILE = Path(__file__).with_name("presets.json")
PAPER, HYPERBOLIC = "paper", "hyperbolic"  # the same camera
CATALOG = "catalog"  # kind of a preset: a camera of the catalog
KINDS = ("lens", "optics", "degradation", CATALOG)
SHOWN = 12  # cameras of a search
OPTICS_CAMERA = f"{SENSOR}.optics.camera"  # table of an optical system's camera
MODEL_PATHS = (f"{SENSOR}.lens.model", f"{OPTICS_CAMERA}.model")


@dataclass(frozen=True)
class SceneInLight:
    """Scene that can be reloaded in another light."""

    source: str  # name or path of the scene
    # function of a path and tables that reads a TOML file extending the scene. The tables take
    # precedence over the command line's options
    read: Callable[[Path, Mapping[str, Any]], Scene]

    def scene(self, tables: Mapping[str, Any]) -> Scene:
        """Load the scene in the light of the tables.

        Raises:
            SceneError: an invalid value; the message names key, actual and expected value.
        """
        path = Path(self.source)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / SCENE_FILE
            source = str(path.resolve()) if path.exists() else self.source
            file.write_text(scene_text(source, tables), encoding="utf-8")
            try:
                scene = self.read(file, tables)
            except SceneError as reason:
                raise SceneError(str(reason).replace(f"{file}: ", "scene.")) from None
        return dataclasses.replace(scene, name=self.source)


def completed(tables: Table) -> Table:
    """Copy of light tables with their required keys, without an empty `light` table."""
    complete = {name: {**_COMPLETE.get(name, {}), **table} for name, table in tables.items()}
    fog = complete.get("fog", {})
    if "attenuation_per_m" in fog:  # an alternative to the visibility
        fog.pop("visibility_m", None)
    return {name: table for name, table in complete.items() if table or name != "light"}


def scene_text(source: str, tables: Mapping[str, Any]) -> str:
    """Text of a TOML file that extends a scene with tables of light."""
    return toml_text({"extends": source, **tables})


def without_overridden(arguments: Sequence[str], tables: Mapping[str, Any]) -> tuple[str, ...]:
    """Arguments of a command line without the options that the tables override."""
    remaining: list[str] = []
    at = 0
    while at < len(arguments):
        if _OVERRIDDEN_BY.get(arguments[at], set()) & tables.keys():
            at += 1  # skips the option's value as well
        else:
            remaining.append(arguments[at])
        at += 1
    return tuple(remaining)


@dataclass(frozen=True)
class CameraDocument:
    """Sensor file of a camera, the size of its image and the light of the scene.

    Paths in the table are absolute, and an optics file is embedded in the table.
    """

    sensor: Mapping[str, Any] = dataclasses.field(default_factory=dict)  # table of the sensor file
    size_px: int | None = None  # shorter side of the image; None: the sensor file's size
    # tables of a scene's TOML for its light, sky and fog; empty: the scene's own light
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
        if (optics := sensor.get("optics")) is not None and "file" in optics:
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
                is_index = name.isdecimal() and int(name) < len(current)
                current = current[int(name)] if is_index else None
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
            low, high = SIZES_PX
            if value is not None and not (type(value) is int and low <= value <= high):
                raise SensorFileError(f"size_px: expected {low} to {high} px, got {value!r}")
            return dataclasses.replace(self, size_px=value)
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

    def with_camera(self, group: str, table: Mapping[str, Any]) -> CameraDocument:
        """Copy with another mirror, lens or optical system: the table `group` of a sensor file."""
        sensor = copy.deepcopy(dict(self.sensor))
        groups = [sensor.pop(name, {}) for name in ("mirror", "lens", "optics")]
        mounting = [table_["mounting"] for table_ in groups if "mounting" in table_]
        if mounting:
            table = {**table, "mounting": mounting[0]}
        camera, kept = sensor.pop("camera", {}), ("quality", "supersampling")
        quality = {key: value for key, value in camera.items() if key in kept}
        sensor |= {group: dict(table)} if table else {}
        sensor |= {"camera": quality} if quality else {}
        return dataclasses.replace(self, sensor=sensor)

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
    if (
        table is not None
        and isinstance(file := table.get(key), str)
        and not file.startswith(PREFIX)
    ):
        table[key] = str((folder / file).resolve())


@cache
def _presets() -> dict[str, dict[str, Any]]:
    return json.loads(PRESETS_FILE.read_text(encoding="utf-8"))


def preset_lists() -> dict[str, list[str]]:
    """Names of the presets, by kind; lenses in the order of the images in page/lenses.jpg."""
    read = _presets()
    return {
        "lens": [PAPER if name == HYPERBOLIC else name for name in read["lens"]],
        "optics": list(read["optics"]),
        "degradation": preset_names(),
    }


def with_preset(document: CameraDocument, kind: str, name: str) -> CameraDocument:
    """Copy of a document with the camera, optical system or degradations of a preset.

    Raises:
        OutputError: no such kind or preset.
        CalibrationError: no such camera of the catalog.
    """
    if kind == CATALOG:
        return _with_catalog_camera(document, name)
    names = preset_lists().get(kind)
    if names is None:
        raise OutputError(f"preset {kind!r}: {did_you_mean(kind, KINDS)}")
    if name not in names:
        raise OutputError(f"preset {name!r}: {did_you_mean(name, names)}")
    if kind == "degradation":
        return document.with_degradation(name)
    if name == PAPER:
        return document.with_camera("mirror", {})
    return document.with_camera(kind, _presets()[kind][name])


def _with_catalog_camera(document: CameraDocument, name: str) -> CameraDocument:
    """Copy of a document with a camera of the catalog: its lens, and its readout if measured."""
    camera, path = OmniCamera.of_catalog(name), f"{SENSOR}.degradation.shutter"
    changed = document.with_camera("lens", CameraDocument.of_camera(camera).sensor["lens"])
    own = changed.value(path) or {}
    shutter = {key: value for key, value in own.items() if key != "readout_s"}
    if camera.degradation.shutter is not None:
        shutter["readout_s"] = camera.degradation.shutter.readout_s
    return changed if shutter == own else changed.with_value(path, shutter or None)


def found_cameras(words: str) -> dict[str, Any]:
    """Cameras of the catalog that have all words: their number, and what the page shows of some."""
    found = search(words) if words.strip() else []
    shown = []
    for entry in found[:SHOWN]:
        size = f"{entry.lens.width_px} × {entry.lens.height_px} px"
        wide, high = (f"{math.degrees(angle):.0f}°" for angle in angles_of_view(entry.lens))
        detail = f"{size}, {wide} × {high}"
        shown.append({"name": entry.name, "title": entry.title, "detail": detail})
    return {"words": words, "count": len(found), "cameras": shown}


def with_model(document: CameraDocument, path: str, model: Any) -> CameraDocument:
    """Copy of a document with the preset of another camera model.

    `path` is that of the key `model`, of a lens or of an optical system's camera, which stays where
    it is behind the surfaces.

    Raises:
        OutputError: no such model.
    """
    name = PAPER if model == HYPERBOLIC else str(model)
    table = path.rpartition(".")[0]
    if table != OPTICS_CAMERA:
        return with_preset(document, "lens", name)
    lenses = _presets()["lens"]
    if str(model) not in lenses:
        raise OutputError(f"{path}: {did_you_mean(str(model), list(lenses))}")
    own = document.value(table) or {}
    placed = {key: own[key] for key in AlignmentTable.model_fields if key in own}
    return document.with_value(table, {**lenses[str(model)], **placed})
