"""Keys of omnisim's TOML files, derived from the schemas that validate them.

A key's help is the string below its field in the source, as in any Python class. The reference
documentation, JSON Schema and the controls of the live page are generated from it.
"""

from __future__ import annotations

import inspect
import json
import math
import types
import typing
from collections.abc import Iterator
from typing import Any, NamedTuple, get_args, get_origin

import annotated_types
import pydantic
from pydantic.fields import FieldInfo
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import PydanticUndefined

from omnisim.core.files.attribute_docs import attribute_docs
from omnisim.core.files.parameters import Typical
from omnisim.core.files.table_faults import InnerTable, table_in

FAR = 1e9  # larger limits only keep numbers within float32


class Limit(NamedTuple):
    """Limit of a number."""

    value: float  # the limit
    is_open: bool  # True if the limit itself is excluded


class Key(NamedTuple):
    """Key of a table."""

    name: str  # its name
    field: FieldInfo  # its type, rules and default
    help: str  # its help, with the usual range
    default: Any  # its default; None: it has none
    inner: InnerTable | None  # schema of the tables that it holds; None: it holds values
    # low, high: tightest limits; limits far beyond any use are left out
    low: Limit | None
    high: Limit | None
    typical: Typical | None  # usual range; None: not stated


def keys_of(model: type[pydantic.BaseModel]) -> Iterator[Key]:
    """Keys of a table, in the order of their fields."""
    docs = attribute_docs(model)
    for name, field in model.model_fields.items():
        rules = [*field.metadata, *_rules(field.annotation)]
        typical = next((rule for rule in rules if isinstance(rule, Typical)), None)
        text = docs.get(name, "")
        if typical is not None:
            text = f"{text.removesuffix('.')}; {typical}."
        default = field.get_default(call_default_factory=True)
        default = None if default is PydanticUndefined else default
        low, high = _tightest(rules, "gt", "ge", True), _tightest(rules, "lt", "le", False)
        inner, key = table_in(field.annotation), field.alias or name
        yield Key(key, field, text, default, inner, low, high, typical)


def summary(model: type) -> str:
    """First paragraph of a class's docstring, in one line."""
    return " ".join((inspect.getdoc(model) or "").split("\n\n")[0].split())


def _tightest(rules: list[Any], strict: str, loose: str, is_lower: bool) -> Limit | None:
    candidates = [
        Limit(float(limit), attribute == strict)
        for rule in rules
        if isinstance(rule, annotated_types.BaseMetadata)
        for attribute in (strict, loose)
        if (limit := getattr(rule, attribute, None)) is not None
    ]
    if not candidates:
        return None
    tightest = max(candidates) if is_lower else min(candidates)
    if is_lower and 0.0 < tightest.value <= 1.0 / FAR:
        return Limit(0.0, True)
    return tightest if abs(tightest.value) < FAR else None


def _rules(annotation: Any) -> Iterator[Any]:
    """Limits inside a union, such as a number or None."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is typing.Annotated:
        for rule in parts[1:]:
            yield from getattr(rule, "metadata", [rule])
        yield from _rules(parts[0])
    elif origin in (typing.Union, types.UnionType):
        for part in parts:
            yield from _rules(part)


class _JsonSchema(GenerateJsonSchema):
    """JSON Schema with each key's help, for editors."""

    def model_schema(self, schema: Any) -> dict[str, Any]:
        made = super().model_schema(schema)
        model: type[pydantic.BaseModel] = schema["cls"]
        made["title"] = model.__name__.strip("_").removesuffix("Table")
        made["description"] = summary(model)
        for key in keys_of(model):
            made["properties"][key.name]["description"] = key.help
        return made

    def nullable_schema(self, schema: Any) -> dict[str, Any]:
        return self.generate_inner(schema["schema"])  # TOML has no null

    def default_schema(self, schema: Any) -> dict[str, Any]:
        made, default = self.generate_inner(schema["schema"]), schema.get("default")
        is_plain = isinstance(default, bool | int | str) or _are_finite(default)
        return made | ({"default": json.loads(json.dumps(default))} if is_plain else {})

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False

    def handle_invalid_for_json_schema(self, schema: Any, error_info: str) -> dict[str, Any]:
        return {}  # any value: a type that only omnisim can check


def _are_finite(value: Any) -> bool:
    if isinstance(value, tuple) and value:
        return all(map(_are_finite, value))
    return isinstance(value, int | float) and math.isfinite(value)


def json_schema(model: type[pydantic.BaseModel], folder: str = "") -> Any:
    """JSON Schema of a file, as editors use it to complete and check keys.

    In references, `folder` is the path between `$defs` and the names of its inner tables.
    """
    references = f"#/$defs/{folder}{{model}}"
    schema = model.model_json_schema(ref_template=references, schema_generator=_JsonSchema)
    return {"$schema": GenerateJsonSchema.schema_dialect, **schema}
