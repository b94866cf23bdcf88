"""Plan of a sweep: one drive, varied key by key."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from omnisim.core.errors import OmnisimError, PlanError
from omnisim.core.files.parameters import AboveZero, Name, Seed, Table
from omnisim.core.files.toml_file import read_tables, read_toml, toml_text
from omnisim.evaluation.estimator_registry import estimator_named
from omnisim.sensors.sensor_registry import MOUNT_TYPES

Value = bool | int | float | str | list[Any]
BASE = "as given"  # label of the unchanged robot


class Variation(Table):
    """A key of the robot and its values, one drive each."""

    key: Name
    """Key of the robot file, with sensors by name: sensors.imu.rate_hz; keys behind a sensor's
    file are those of the file: sensors.front.file.degradation.shutter.readout_s."""
    values: Annotated[list[Value], Field(min_length=1, max_length=100)]
    """Values in place of the robot's."""
    title: str = ""
    """Label of the plot's axis; by default the key."""


class SweepPlan(Table):
    """Plan of a sweep."""

    scene: Name
    """Scene file or name."""
    robot: Name
    """Robot file."""
    path: Name
    """Path of the scene, or a file."""
    estimators: Annotated[list[Name], Field(min_length=1)]
    """Names of estimators, or commands."""
    seeds: Annotated[tuple[Seed, ...], Field(min_length=1, max_length=100)] = (0,)
    """Seeds of the drives' noise."""
    limit_s: AboveZero = 600.0
    """Time after which an estimator is ended."""
    drive: dict[str, Value] = Field(default_factory=dict)
    """Further options of `omnisim drive`, without their dashes, such as step = 0.2."""
    vary: tuple[Variation, ...] = ()
    """Variations, each on its own."""


@dataclass(frozen=True)
class SweepPoint:
    """Drive of a sweep.

    Attributes:
        variation: index of the variation; None: the unchanged robot.
        label: varied value as text.
        seed: seed of the drive.
        robot: tables of the robot file.
        files: tables of changed sensor files by the names that `robot` gives them.
    """

    variation: int | None
    label: str
    seed: int
    robot: Mapping[str, Any]
    files: Mapping[str, Mapping[str, Any]]

    @property
    def name(self) -> str:
        """Name of the point's folder."""
        part = "base" if self.variation is None else f"{self.variation}-{self.label}"
        safe = "".join(letter if letter.isalnum() or letter in ".-" else "-" for letter in part)
        return f"{safe[:60]}-seed{self.seed}"

    def write_robot(self, folder: Path) -> Path:
        """Write the robot file and the changed sensor files to a folder."""
        for name, tables in self.files.items():
            (folder / name).write_text(toml_text(tables), encoding="utf-8")
        path = folder / "robot.toml"
        path.write_text(toml_text(self.robot), encoding="utf-8")
        return path


def read_plan(path: Path) -> tuple[SweepPlan, list[SweepPoint]]:
    """Read a plan, and list the drives of the sweep.

    Raises:
        PlanError: naming file, key and value.
    """
    plan = read_toml(path, SweepPlan, PlanError)
    for name in plan.estimators:
        try:
            estimator_named(name)
        except OmnisimError as reason:
            raise PlanError(f"{path}: estimators: {reason}") from None
    robot_file = path.parent / plan.robot
    robot = _with_absolute_files(read_tables(robot_file, PlanError), robot_file.parent)
    points = []
    for variation, key, label, value in _variations(plan):
        tables, files = robot, dict[str, Mapping[str, Any]]()
        if key:
            where = f"{path}: vary.{variation}.key = {key!r}"
            tables, files = _varied(robot, key.split("."), value, where)
        points += [
            SweepPoint(variation, label, seed, _with_seed(tables, seed), files)
            for seed in plan.seeds
        ]
    return plan, points


def _variations(plan: SweepPlan) -> Iterator[tuple[int | None, str, str, Any]]:
    """Index, key, label and value of each variation; the unchanged robot comes first."""
    yield None, "", BASE, None
    for index, variation in enumerate(plan.vary):
        for value in variation.values:
            label = Path(value).stem if isinstance(value, str) else str(value)
            yield index, variation.key, label, value


def _varied(
    robot: Mapping[str, Any], keys: list[str], value: Any, where: str
) -> tuple[dict[str, Any], dict[str, Mapping[str, Any]]]:
    """Robot with another value, and the changed sensor file by name, if any.

    Raises:
        PlanError: no sensor or sensor file matches the key.
    """
    if keys[0] != "sensors":
        return _with_value(robot, keys, value), {}
    sensors = [dict(one) for one in robot.get("sensors", ())]
    named = [one for one in sensors if one.get("name") == (keys[1] if len(keys) > 2 else None)]
    if not named:
        names = ", ".join(str(one.get("name")) for one in sensors)
        raise PlanError(f"{where}: expected sensors.NAME.KEY with a sensor of the robot: {names}")
    (sensor,) = named
    inner, files = keys[2:], dict[str, Mapping[str, Any]]()
    if inner[0] == "file" and len(inner) > 1:
        if not str(sensor.get("file", "")).endswith(".toml"):
            raise PlanError(f"{where}: sensor {keys[1]!r} has no sensor file (.toml)")
        source = Path(sensor["file"])
        tables = _with_absolute_files(read_tables(source, PlanError), source.parent)
        name = f"{keys[1]}.toml"
        files[name] = _with_value(tables, inner[1:], value)
        sensor["file"] = name
    else:
        sensor.update(_with_value(sensor, inner, value))
    return {**robot, "sensors": sensors}, files


def _with_seed(robot: Mapping[str, Any], seed: int) -> dict[str, Any]:
    """Robot with the seed of the drive added to the seeds of its sensors."""
    sensors = [
        {**one, "seed": one.get("seed", 0) + seed} if _has_seed(one) else one
        for one in robot.get("sensors", ())
    ]
    return {**robot, "sensors": sensors} if sensors else dict(robot)


def _has_seed(sensor: Mapping[str, Any]) -> bool:
    kind = MOUNT_TYPES.get(str(sensor.get("type")))
    return kind is not None and "seed" in kind.model_fields


def _with_value(tables: Mapping[str, Any], keys: list[str], value: Any) -> dict[str, Any]:
    """Tables with a value at a path of keys; missing tables are added."""
    if len(keys) == 1:
        return {**tables, keys[0]: value}
    inner = tables.get(keys[0])
    return {
        **tables,
        keys[0]: _with_value(inner if isinstance(inner, Mapping) else {}, keys[1:], value),
    }


def _with_absolute_files(value: Any, folder: Path) -> Any:
    """Tables with absolute paths in place of the names of existing files in a folder."""
    if isinstance(value, Mapping):
        return {key: _with_absolute_files(one, folder) for key, one in value.items()}
    if isinstance(value, list):
        return [_with_absolute_files(one, folder) for one in value]
    if isinstance(value, str) and "." in value and (folder / value).is_file():
        return str((folder / value).absolute())
    return value
