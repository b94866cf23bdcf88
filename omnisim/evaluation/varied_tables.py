"""Changes of keys in the tables of scene, robot and sensor files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from omnisim.core.errors import PlanError
from omnisim.core.files.extended_tables import extended, with_absolute_files
from omnisim.core.files.toml_file import read_tables
from omnisim.sensors.sensor_registry import SENSOR_TYPES

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
    names = [str(one.get("name")) for one in robot.get("sensors", ())]
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
    sensors = [
        {**one, "seed": one.get("seed", 0) + seed} if _has_seed(one) else one
        for one in robot.get("sensors", ())
    ]
    return {**robot, "sensors": sensors} if sensors else dict(robot)


def _has_seed(sensor: Tables) -> bool:
    kind = SENSOR_TYPES.get(str(sensor.get("type")))
    return kind is not None and "seed" in kind.model_fields


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
        for inner, one in value.items():
            yield from missing_files(one, inner, folder)
    elif isinstance(value, list):
        for one in value:
            yield from missing_files(one, key, folder)
    elif key == "file" and not (isinstance(value, str) and (folder / value).is_file()):
        yield str(value)
