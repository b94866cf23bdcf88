"""Keys of omnisim's TOML files, from the pydantic schema that checks them.

A key's help is the string below it in the schema's source, as in any Python class.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
import types
import typing
from collections.abc import Iterator
from typing import Any, get_args, get_origin

import annotated_types
import pydantic
from pydantic_core import PydanticUndefined

from omnisim.parameters import Table, table_of

_FAR = 1e9  # of limits that only keep numbers within a float32


def attribute_docs(model: type) -> dict[str, str]:
    """Strings below the fields of a model or dataclass, by the fields' names."""
    docs: dict[str, str] = {}
    for kind in reversed(model.__mro__):
        if not kind.__module__.startswith("omnisim"):
            continue
        try:
            (tree,) = ast.parse(textwrap.dedent(inspect.getsource(kind))).body
        except OSError:  # made by pydantic.create_model: its fields have no source of their own
            continue
        assert isinstance(tree, ast.ClassDef)
        for field, text in zip(tree.body, tree.body[1:], strict=False):
            if (
                isinstance(field, ast.AnnAssign)
                and isinstance(field.target, ast.Name)
                and isinstance(text, ast.Expr)
                and isinstance(text.value, ast.Constant)
                and isinstance(text.value.value, str)
            ):
                docs[field.target.id] = " ".join(text.value.value.split())
    return docs


def tables(
    model: type[pydantic.BaseModel], path: str = "", source: type | None = None
) -> Iterator[str]:
    """Markdown sections: one for each table that a model holds, its own keys first.

    Args:
        model: schema of the table.
        path: key of the table in its file.
        source: class with the keys' help, where it is not the model itself.
    """
    docs, rows, inner = attribute_docs(source or model), [], []
    for name, field in model.model_fields.items():
        key = field.alias or name
        found = _table_in(field.annotation)
        if found is not None:
            child, is_list = found
            below = f"{path}.{key}" if path else key
            inner.append((f"[[{below}]]" if is_list else f"[{below}]", below, child))
            continue
        default = "required" if field.is_required() else _default(field)
        rows.append(f"| `{key}` | {_type(field)} | {default} | {docs.get(name, '')} |")
    if rows:
        yield "\n".join(["| key | value | default | meaning |", "| --- | --- | --- | --- |", *rows])
    for header, below, child in inner:
        yield f"## `{header}`\n\n{_summary(child)}"
        yield from tables(child, below)


def _summary(model: type) -> str:
    return " ".join((inspect.getdoc(model) or "").split("\n\n")[0].split())


def _default(field: Any) -> str:
    value = field.get_default(call_default_factory=True)
    if value is PydanticUndefined or value is None or value in ((), {}):
        return ""
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, tuple):
        return f"`{list(value)}`"
    return f"`{value!r}`".replace("'", '"')


def _type(field: Any) -> str:
    """Kind of value and its tightest limits; those far beyond any use are left out."""
    rules = [*field.metadata, *_rules(field.annotation)]
    limits = []
    for tightest, strict, loose, signs in ((max, "gt", "ge", "> ≥"), (min, "lt", "le", "< ≤")):
        found = [
            (limit, sign)
            for rule in rules
            if isinstance(rule, annotated_types.BaseMetadata)
            for attribute, sign in zip((strict, loose), signs.split(), strict=True)
            if (limit := getattr(rule, attribute, None)) is not None
        ]
        limit, sign = tightest(found, default=(_FAR, ""))
        if 0.0 < limit <= 1.0 / _FAR:
            limits.append("> 0")
        elif abs(limit) < _FAR:
            limits.append(f"{sign} {limit:g}")
    return ", ".join([_name(field.annotation), *limits])


def _rules(annotation: Any) -> Iterator[Any]:
    """Limits inside a union, such as a number or none."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is typing.Annotated:
        for rule in parts[1:]:
            yield from getattr(rule, "metadata", [rule])
        yield from _rules(parts[0])
    elif origin in (typing.Union, types.UnionType):
        for part in parts:
            yield from _rules(part)


def _name(annotation: Any) -> str:
    origin = get_origin(annotation)
    if origin is typing.Annotated:
        return _name(get_args(annotation)[0])
    if origin is typing.Literal:
        return " or ".join(f"`{word!r}`".replace("'", '"') for word in get_args(annotation))
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
    words = {float: "number", int: "whole number", str: "text", bool: "true or false"}
    return words.get(annotation, getattr(annotation, "__name__", str(annotation)))


def _table_in(annotation: Any) -> tuple[type[Table], bool] | None:
    """The table that a key holds, and whether as a list."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        return annotation, False
    is_list = get_origin(annotation) in (tuple, list)
    for part in get_args(annotation):
        found = _table_in(part)
        if found is not None:
            return found[0], is_list or found[1]
    return None


def key_pages() -> dict[str, str]:
    """Markdown of the keys of each kind of file, by the name of its page."""
    from omnisim.localization.parameters import FilterParameters
    from omnisim.optics.system_file import OpticsFile
    from omnisim.robot.robot_file import RobotFile
    from omnisim.scene.scene_file import LabelFile, SceneFile
    from omnisim.sensors.sensor_file import SensorFile

    pages = {
        "sensor-file-keys": tables(SensorFile),
        "scene-file-keys": tables(SceneFile),
        "label-file-keys": tables(LabelFile),
        "robot-file-keys": (*tables(RobotFile), *_mounts()),
        "filter-file-keys": tables(FilterParameters),
        "degradation-keys": _effects(),
        "optics-file-keys": (*tables(OpticsFile), *_shapes()),
    }
    return {name: "\n\n".join(sections) + "\n" for name, sections in pages.items()}


def _mounts() -> Iterator[str]:
    from omnisim.simulation.sensors.registry import MOUNT_TYPES

    for name, mount in MOUNT_TYPES.items():
        yield f'## `[[sensors]]`, `type = "{name}"`\n\n{_summary(mount)}'
        yield from tables(mount, "sensors")


def _shapes() -> Iterator[str]:
    from omnisim.optics.surface_tables import shape_schemas

    for name, table, source in shape_schemas():
        yield f'## `[[surfaces]]`, `shape = "{name}"`\n\n{_summary(source)}'
        yield from tables(table, "surfaces", source)


def _effects() -> Iterator[str]:
    from omnisim.sensors.degradations.degradation_file import EFFECTS

    for name, effect in EFFECTS.items():
        yield f"## `[degradation.{name}]`\n\n{_summary(effect)}"
        yield from tables(table_of(effect), source=effect)
