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

from omnisim.parameters import Table


def attribute_docs(model: type[pydantic.BaseModel]) -> dict[str, str]:
    """Strings below the fields of a model, by the fields' names."""
    docs: dict[str, str] = {}
    for kind in reversed(model.__mro__):
        if not (issubclass(kind, pydantic.BaseModel) and kind.__module__.startswith("omnisim")):
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


def tables(model: type[pydantic.BaseModel], path: str = "") -> Iterator[str]:
    """Markdown sections: one for each table that a model holds, its own keys first."""
    docs, rows, inner = attribute_docs(model), [], []
    for name, field in model.model_fields.items():
        key = field.alias or name
        found = _table_in(field.annotation)
        if found is not None:
            child, is_list = found
            below = f"{path}.{key}" if path else key
            inner.append((f"[[{below}]]" if is_list else f"[{below}]", below, child))
            continue
        default = "" if field.is_required() else _default(field)
        rows.append(f"| `{key}` | {_type(field)} | {default} | {docs.get(name, '')} |")
    if rows:
        yield "\n".join(["| key | value | default | meaning |", "| --- | --- | --- | --- |", *rows])
    for header, below, child in inner:
        yield f"## `{header}`\n\n{_summary(child)}"
        yield from tables(child, below)


def _summary(model: type[pydantic.BaseModel]) -> str:
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
    limits = []
    for rule in field.metadata:
        for sign, attribute in (("≥", "ge"), (">", "gt"), ("≤", "le"), ("<", "lt")):
            limit = getattr(rule, attribute, None)
            if isinstance(rule, annotated_types.BaseMetadata) and limit is not None:
                limits.append(f"{sign} {limit:g}")
    name = _name(field.annotation)
    return ", ".join([name, *limits]) if name != "any" else ", ".join(["see meaning", *limits])


def _name(annotation: Any) -> str:
    origin = get_origin(annotation)
    if origin is typing.Annotated:
        return _name(get_args(annotation)[0])
    if origin is typing.Literal:
        return " or ".join(f"`{word!r}`".replace("'", '"') for word in get_args(annotation))
    if origin in (typing.Union, types.UnionType):
        return " or ".join(_name(p) for p in get_args(annotation) if p is not type(None))
    if origin is tuple:
        parts = get_args(annotation)
        if parts[-1] is Ellipsis:
            return f"list of {_name(parts[0])}"
        return "[" + ", ".join(_name(part) for part in parts) + "]"
    if origin is dict:
        return f"table of {_name(get_args(annotation)[1])}"
    words = {float: "number", int: "whole number", str: "text", bool: "true or false", Any: "any"}
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
    from omnisim.scene.scene_file import LabelFile, SceneFile
    from omnisim.sensors.sensor_file import SensorFile

    kinds = {
        "sensor-file-keys": SensorFile,
        "scene-file-keys": SceneFile,
        "label-file-keys": LabelFile,
    }
    return {name: "\n\n".join(tables(model)) + "\n" for name, model in kinds.items()}
