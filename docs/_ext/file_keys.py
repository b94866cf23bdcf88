"""Pages of the keys of omnisim's TOML files, in Markdown."""

from __future__ import annotations

import types
import typing
from collections.abc import Iterator
from datetime import datetime
from enum import EnumType
from typing import Any, get_args, get_origin

import pydantic

from omnisim.core.files import file_keys
from omnisim.core.files.parameters import table_of


def tables(model: type[pydantic.BaseModel], path: str = "") -> Iterator[str]:
    """Markdown sections: one for each table that a model holds, its own keys first.

    Args:
        model: schema of the table.
        path: key of the table in its file.
    """
    rows, inner = [], []
    for key in file_keys.keys_of(model):
        if key.inner is not None:
            child, is_list = key.inner
            below = f"{path}.{key.name}" if path else key.name
            inner.append((f"[[{below}]]" if is_list else f"[{below}]", below, child))
            continue
        default = "required" if key.field.is_required() else _default(key)
        rows.append(f"| `{key.name}` | {_type(key)} | {default} | {key.help} |")
    if rows:
        yield "\n".join(["| key | value | default | meaning |", "| --- | --- | --- | --- |", *rows])
    for header, below, child in inner:
        yield f"## `{header}`\n\n{file_keys.summary(child)}"
        yield from tables(child, below)


def _default(key: file_keys.Key) -> str:
    value = key.default
    if value is None or value in ((), {}):
        return ""
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, tuple):
        return f"`{list(value)}`"
    return f"`{value!r}`".replace("'", '"')


def _type(key: file_keys.Key) -> str:
    """Kind of value and its limits."""
    words = [_name(key.field.annotation)]
    for limit, open_sign, closed_sign in ((key.low, ">", "≥"), (key.high, "<", "≤")):
        if limit is not None:
            words.append(f"{open_sign if limit.is_open else closed_sign} {limit.value:g}")
    return ", ".join(words)


def _name(annotation: Any) -> str:
    origin = get_origin(annotation)
    if origin is typing.Annotated:
        return _name(get_args(annotation)[0])
    if origin is typing.Literal or isinstance(annotation, EnumType):
        words = get_args(annotation) or [one.value for one in annotation]
        return " or ".join(f"`{word!r}`".replace("'", '"') for word in words)
    if origin in (typing.Union, types.UnionType):
        names = [_name(part) for part in get_args(annotation) if part is not type(None)]
        if "number" in names:  # whole ones are numbers
            names = [name for name in names if name != "whole number"]
        return " or ".join(names)
    if origin is tuple:
        parts = get_args(annotation)
        if parts[-1] is Ellipsis:
            return "tables" if get_origin(parts[0]) is dict else f"list of {_name(parts[0])}"
        return "[" + ", ".join(_name(part) for part in parts) + "]"
    if origin is dict:
        value = get_args(annotation)[1]
        return "table" if value is Any else f"table of {_name(value)}"
    kinds = {
        float: "number",
        int: "whole number",
        str: "text",
        bool: "true or false",
        datetime: "time",
    }
    return kinds.get(annotation, getattr(annotation, "__name__", str(annotation)))


def key_pages() -> dict[str, str]:
    """Markdown of the keys of each kind of file, by the name of its page."""
    from omnisim.cameras.optics.system_file import OpticsFile
    from omnisim.datasets.generate.plan import Plan
    from omnisim.evaluation.calibration_error import CalibrationComparison
    from omnisim.evaluation.sweep_plan import SweepPlan
    from omnisim.perception.localization.filter import FilterParameters
    from omnisim.rendering.camera.sensor_file import SensorFile
    from omnisim.robots.robot_file import RobotFile
    from omnisim.scene.files.scene_file import LabelFile, SceneFile

    pages = {
        "sensor-file-keys": tables(SensorFile),
        "scene-file-keys": tables(SceneFile),
        "label-file-keys": tables(LabelFile),
        "robot-file-keys": (*tables(RobotFile), *_mounts()),
        "filter-file-keys": tables(table_of(FilterParameters)),
        "plan-file-keys": tables(Plan),
        "sweep-file-keys": tables(SweepPlan),
        "calibration-error-keys": tables(CalibrationComparison),
        "degradation-keys": _effects(),
        "optics-file-keys": (*tables(OpticsFile), *_shapes()),
    }
    return {name: "\n\n".join(sections) + "\n" for name, sections in pages.items()}


def _mounts() -> Iterator[str]:
    from omnisim.sensors.sensor_registry import SENSOR_TYPES

    for name, mount in SENSOR_TYPES.items():
        yield f'## `[[sensors]]`, `type = "{name}"`\n\n{file_keys.summary(mount)}'
        yield from tables(mount, "sensors")


def _shapes() -> Iterator[str]:
    from omnisim.cameras.optics.system_file import shape_schemas

    for name, table in shape_schemas().items():
        yield f'## `[[surfaces]]`, `shape = "{name}"`\n\n{file_keys.summary(table)}'
        yield from tables(table, "surfaces")


def _effects() -> Iterator[str]:
    from omnisim.rendering.camera.degradations.degradation_file import EFFECTS

    for name, effect in EFFECTS.items():
        yield f"## `[degradation.{name}]`\n\n{file_keys.summary(effect)}"
        yield from tables(table_of(effect))
