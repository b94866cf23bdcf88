"""Plan of a sweep: one drive, and the keys to vary."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, model_validator

from omnisim.core.errors import OmnisimError, PlanError, did_you_mean
from omnisim.core.files.atomic_file import write_text
from omnisim.core.files.parameters import AboveZero, Name, Seed, Table, parse_table
from omnisim.core.files.sources import fingerprint
from omnisim.core.files.toml_file import (
    extended,
    read_tables,
    read_toml,
    toml_text,
    with_absolute_files,
)
from omnisim.core.package_files import SWEEPS, sweep_names
from omnisim.evaluation.calibration_error import CalibrationComparison
from omnisim.evaluation.estimator_registry import estimator_named
from omnisim.robots.robot_file import find_robot
from omnisim.sensors.sensor_registry import SENSOR_TYPES

Value = bool | int | float | str | list[Any] | dict[str, Any]
Keys = tuple[str, ...]
BASE = "as given"  # label of the unchanged drive
MAX_LABEL = 24  # characters of a value's label


class Variation(Table):
    """Variation of one or more keys, with one drive per value."""

    key: Name | Annotated[tuple[Name, ...], Field(min_length=1)]
    """Key of the robot file, or several that change together. Sensors have their names, or a
    pattern: sensors.imu.rate_hz. Keys after a sensor's file are keys of the sensor file:
    sensors.cam_*.file.degradation.shutter.readout_s. scene and path replace the scene or the path;
    scene.KEY is a key of the scene file, drive.KEY an option of `omnisim drive`.
    calibration.SENSOR.KEY is a calibration error, which only the estimators see."""
    values: Annotated[tuple[Value, ...], Field(min_length=1, max_length=100)]
    """Values of the key; with several keys, each value is a list with an entry per key."""
    labels: tuple[Name, ...] = ()
    """Labels of the values in the report; by default the values."""
    title: str = ""
    """Label of the plot's axis; by default the key."""

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys that change together."""
        return (self.key,) if isinstance(self.key, str) else self.key

    @property
    def value_labels(self) -> tuple[str, ...]:
        """Labels of the values, in order."""
        return self.labels or tuple(_text(value) for value in self.values)

    @model_validator(mode="after")
    def _check(self) -> Variation:
        if self.labels and len(self.labels) != len(self.values):
            raise ValueError(f"labels: expected {len(self.values)}, one for each value")
        if len(set(self.value_labels)) < len(self.values):
            raise ValueError("labels: expected a different one for each value")
        if not isinstance(self.key, str):
            for value in self.values:
                if not isinstance(value, list) or len(value) != len(self.key):
                    raise ValueError(f"values: expected lists of {len(self.key)}, one for each key")
        return self


def _text(value: Any) -> str:
    text = Path(value).stem if isinstance(value, str) and "/" not in value[:1] else str(value)
    return text if len(text) <= MAX_LABEL else text[: MAX_LABEL - 1] + "…"


class SweepPlan(Table):
    """Plan of a sweep."""

    scene: Name
    """Scene file or name."""
    robot: Name
    """Robot file or name."""
    path: Name
    """Path of the scene, or a file."""
    estimators: Annotated[tuple[Name, ...], Field(min_length=1)]
    """Names of estimators, or commands."""
    title: str = ""
    """Heading of the report."""
    seeds: Annotated[tuple[Seed, ...], Field(min_length=1, max_length=100)] = (0,)
    """Seeds of the drives' noise."""
    limit_s: AboveZero = 600.0
    """Time limit of an estimator."""
    drive: dict[str, Value] = Field(default_factory=dict)
    """Options of `omnisim drive`, without their dashes, such as step = 0.2."""
    vary: tuple[Variation, ...] = ()
    """Variations, each applied alone."""


@dataclass(frozen=True)
class SweepPoint:
    """Point of a sweep: a drive, and the calibration errors of its estimators."""

    variation: int | None  # index of the variation; None: the unchanged drive
    label: str  # label of the varied value
    seed: int  # seed of the drive
    drive: SweptDrive  # drive to record; points that differ in calibration only share it
    # calibration errors by the name of the sensor
    calibration: Mapping[str, CalibrationComparison] = field(default_factory=dict)


def find_plan(source: Path) -> Path:
    """Find a plan by its path, or a built-in plan by its name.

    Raises:
        PlanError: no such file or built-in plan.
    """
    if source.suffix == ".toml" or source.exists():
        return source
    if str(source) in sweep_names():
        return SWEEPS / f"{source}.toml"
    hint = did_you_mean(str(source), sweep_names(), "built-in plans:")
    raise PlanError(f"{source}: no such run or built-in plan; {hint}")


def read_plan(path: Path) -> tuple[SweepPlan, list[SweepPoint]]:
    """Read a plan, and list the points of the sweep.

    Raises:
        PlanError: the plan is invalid; names file, key and value.
    """
    plan = read_toml(path, SweepPlan, PlanError)
    for name in plan.estimators:
        try:
            estimator_named(name)
        except OmnisimError as reason:
            raise PlanError(f"{path}: estimators: {reason}") from None
    points = []
    given = _given_point(path, plan)
    for seed in plan.seeds:
        points.append(_seeded(given, seed))
    for index, variation in enumerate(plan.vary):
        for number, value in enumerate(variation.values):
            point = replace(given, variation=index, label=variation.value_labels[number])
            values = value if isinstance(value, list) and len(variation.keys) > 1 else [value]
            for key, part in zip(variation.keys, values, strict=True):
                where = f"{path}: vary.{index}.key = {key!r}"
                point = _varied(point, key.split("."), part, where, path.parent)
            points += [_seeded(point, seed) for seed in plan.seeds]
    return plan, points


def _given_point(path: Path, plan: SweepPlan) -> SweepPoint:
    """Point of the unchanged drive, with seed 0."""
    folder = path.parent
    source = folder / plan.robot
    if not source.is_file():
        try:
            source = find_robot(plan.robot)
        except OmnisimError:
            raise PlanError(
                f"{path}: robot = {plan.robot!r}: no such file, and no built-in robot"
            ) from None
    tables = extended(read_tables(source, PlanError), str(source), PlanError, find_robot)
    robot = with_absolute_files(tables, source.parent)
    scene, route = _found(folder, plan.scene), _found(folder, plan.path)
    return SweepPoint(None, BASE, 0, SweptDrive(scene, route, robot, plan.drive))


def _found(folder: Path, name: str) -> str:
    """Absolute path of a file, or the name of a built-in scene or a scene's path."""
    is_path = "/" in name or bool(Path(name).suffix)
    return str((folder / name).absolute()) if is_path else name


def _varied(point: SweepPoint, keys: list[str], value: Any, where: str, folder: Path) -> SweepPoint:
    """Point with another value of a key."""
    drive = point.drive
    root, rest = keys[0], keys[1:]
    if keys in (["scene"], ["path"]):
        if not isinstance(value, str):
            raise PlanError(f"{where}: expected names or files as values, got {value!r}")
        found = _found(folder, value)
        other = replace(drive, scene=found) if root == "scene" else replace(drive, path=found)
        return replace(point, drive=other)
    for name in missing_files(value, keys[-1], folder):
        raise PlanError(f"{where}: {name}: no such file beside the plan")
    value = with_absolute_files(value, folder)
    if root == "calibration":
        return _with_error(point, rest, value, where)
    if root in ("scene", "drive") and rest:
        if root == "scene":
            tables = with_value(drive.scene_tables, rest, value, where)
            return replace(point, drive=replace(drive, scene_tables=tables))
        options = with_value(drive.options, rest, value, where)
        return replace(point, drive=replace(drive, options=options))
    robot, files = varied_robot(drive.robot, drive.files, keys, value, where)
    return replace(point, drive=replace(drive, robot=robot, files=files))


def _with_error(point: SweepPoint, keys: list[str], value: Any, where: str) -> SweepPoint:
    """Point with another calibration error of one or more sensors."""
    names = matching_sensors(point.drive.robot, keys[0] if len(keys) == 2 else "", where)
    errors = dict(point.calibration)
    for name in names:
        before = errors.get(name, CalibrationComparison()).model_dump(exclude_defaults=True)
        error = parse_table({**before, keys[1]: value}, CalibrationComparison, PlanError, where)
        errors[name] = error
        if not error.model_dump(exclude_defaults=True):
            del errors[name]  # no error
    return replace(point, calibration=errors)


def _seeded(point: SweepPoint, seed: int) -> SweepPoint:
    robot = with_seed(point.drive.robot, seed)
    return replace(point, seed=seed, drive=replace(point.drive, robot=robot, seed=seed))


def shown_points(
    points: list[SweepPoint], variation: int | None
) -> Iterator[tuple[str, list[SweepPoint]]]:
    """Label and points, one per seed, of each value of a variation in order.

    The unchanged drive comes first, unless it equals one of the values.
    """
    own = [point for point in points if point.variation == variation]
    made = {(point.drive.name, str(point.calibration)) for point in own}
    base = [point for point in points if point.variation is None]
    if (
        variation is not None
        and not {(point.drive.name, str(point.calibration)) for point in base} <= made
    ):
        own = base + own
    for label in dict.fromkeys(point.label for point in own):
        yield label, [point for point in own if point.label == label]


# Drive of a sweep: its settings, and the input files of `omnisim drive`.


ROBOT, SCENE = "robot.toml", "scene.toml"


@dataclass(frozen=True)
class SweptDrive:
    """Drive of a sweep."""

    scene: str  # absolute path of a scene file, or name of a built-in scene
    path: str  # absolute path of a file, or name of one of the scene's paths
    robot: Mapping[str, Any]  # tables of the robot file
    # options of `omnisim drive`, without their dashes
    options: Mapping[str, Any] = field(default_factory=dict)
    # tables of the changed sensor files, by their file names in `robot`
    files: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    # tables of a scene file that extends `scene`; empty: none
    scene_tables: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0  # seed of the drive

    @cached_property
    def name(self) -> str:
        """Folder name of the drive; equal drives, of equal files, have equal names."""
        robot = re.sub(r"[^A-Za-z0-9-]+", "-", str(self.robot.get("name", "robot")))[:30]
        given = (self.scene, self.path, self.robot, self.options, self.files, self.scene_tables)
        digest = fingerprint(json.dumps(_plain(given), sort_keys=True))
        return f"{robot}-seed{self.seed}-{digest[:8]}"

    def write(self, folder: Path) -> list[str]:
        """Write robot, scene and sensor files to a folder.

        Returns:
            Arguments of `omnisim drive` that record the drive.

        Raises:
            OutputError: a file cannot be written.
        """
        for name, tables in self.files.items():
            write_text(folder / name, toml_text(tables))
        write_text(folder / ROBOT, toml_text(self.robot))
        scene = self.scene
        if self.scene_tables:
            write_text(folder / SCENE, toml_text({"extends": scene, **self.scene_tables}))
            scene = str((folder / SCENE).absolute())
        arguments = [scene, "--robot", str((folder / ROBOT).absolute()), "--path", self.path]
        arguments += ["--seed", str(self.seed)]
        for key, value in self.options.items():
            flag = f"--{key.replace('_', '-')}"
            if value is not False:
                arguments += [flag] if value is True else [flag, str(value)]
        return arguments


def _plain(value: Any) -> Any:
    """JSON value with integers as floats, so that 1 and 1.0 give the same name.

    The absolute path of a file is followed by a hash of its contents.
    """
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, str) and value.startswith("/") and Path(value).is_file():
        return [value, fingerprint(Path(value).read_bytes().hex())]
    if isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    return value if value is None or isinstance(value, bool | float | str) else str(value)


# Changes of keys in the tables of scene, robot and sensor files.


Tables = Mapping[str, Any]


def varied_robot(
    robot: Tables, files: Mapping[str, Tables], keys: list[str], value: Any, where: str
) -> tuple[dict[str, Any], dict[str, Tables]]:
    """Robot with a changed value, and all changed sensor files by name.

    Args:
        robot: tables of the robot file.
        files: tables of sensor files that are already changed, by their file names in `robot`.
        keys: key path. A sensor's keys follow "sensors" and its name, or a pattern of names; keys
            after its "file" are keys of the sensor file.
        value: new value.
        where: file and key, for messages.

    Raises:
        PlanError: no such sensor or table, or a sensor file that cannot be read.
    """
    changed = dict(files)
    if keys[0] != "sensors":
        return with_value(robot, keys, value, where), changed
    names = matching_sensors(robot, keys[1] if len(keys) > 2 else "", where)
    sensors = []
    for sensor in robot["sensors"]:
        if sensor.get("name") not in names:
            sensors.append(sensor)
        elif keys[2] == "file" and len(keys) > 3:
            file = f"{sensor['name']}.toml"
            tables = changed.get(file)
            if tables is None:
                tables = _sensor_file(sensor, where)
            other = with_value(tables, keys[3:], value, where)
            if file not in changed and other == tables:  # the value is unchanged
                sensors.append(sensor)
                continue
            changed[file] = other
            sensors.append({**sensor, "file": file})
        else:
            sensors.append(with_value(sensor, keys[2:], value, where))
    return {**robot, "sensors": sensors}, changed


def matching_sensors(robot: Tables, pattern: str, where: str) -> list[str]:
    """Names of the robot's sensors that match a pattern such as cam_*.

    Raises:
        PlanError: no sensor matches.
    """
    names = [str(sensor.get("name")) for sensor in robot.get("sensors", ())]
    matches = [name for name in names if pattern and fnmatchcase(name, pattern)]
    if not matches:
        raise PlanError(
            f"{where}: expected a sensor of the robot, and one of its keys; sensors: "
            f"{', '.join(names) or 'none'}"
        )
    return matches


def _sensor_file(sensor: Tables, where: str) -> dict[str, Any]:
    if not str(sensor.get("file", "")).endswith(".toml"):
        raise PlanError(f"{where}: sensor {sensor['name']!r} has no sensor file (.toml)")
    source = Path(sensor["file"])
    tables = extended(read_tables(source, PlanError), str(source), PlanError)
    return with_absolute_files(tables, source.parent)


def with_seed(robot: Tables, seed: int) -> dict[str, Any]:
    """Robot with `seed` added to the seeds of its sensors."""
    seeded = [name for name, kind in SENSOR_TYPES.items() if "seed" in kind.model_fields]
    sensors = [
        {**sensor, "seed": sensor.get("seed", 0) + seed} if sensor.get("type") in seeded else sensor
        for sensor in robot.get("sensors", ())
    ]
    return {**robot, "sensors": sensors} if sensors else dict(robot)


def with_value(tables: Tables, keys: list[str], value: Any, where: str) -> dict[str, Any]:
    """Tables with a new value at a key path; missing tables on the path are added.

    Raises:
        PlanError: a key of the path is not a table.
    """
    if len(keys) == 1:
        return {**tables, keys[0]: value}
    inner = tables.get(keys[0], {})
    if not isinstance(inner, Mapping):
        raise PlanError(f"{where}: {keys[0]!r} is not a table: it has no key {keys[1]!r}")
    return {**tables, keys[0]: with_value(inner, keys[1:], value, where)}


def missing_files(value: Any, key: str, folder: Path) -> Iterator[str]:
    """Values of `file` keys that are neither files in a folder nor absolute paths."""
    if isinstance(value, Mapping):
        for inner, item in value.items():
            yield from missing_files(item, inner, folder)
    elif isinstance(value, list):
        for item in value:
            yield from missing_files(item, key, folder)
    elif key == "file" and not (isinstance(value, str) and (folder / value).is_file()):
        yield str(value)
