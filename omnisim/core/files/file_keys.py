"""Keys of omnisim's TOML files, from the pydantic schemas that validate them.

A key's help is the string below it in the schema's source, as in any Python class. The reference
documentation and the controls of the live page are generated from it.
"""

from __future__ import annotations

import inspect
import types
import typing
from collections.abc import Iterator
from typing import Any, NamedTuple, get_args, get_origin

import annotated_types
from pydantic.fields import FieldInfo

FAR = 1e9  # larger limits only keep numbers within float32


class Limit(NamedTuple):
    """Limit of a number.

    Attributes:
        value: the limit.
        is_open: True if the limit itself is excluded.
    """

    value: float
    is_open: bool


def summary(model: type) -> str:
    """First paragraph of a class's docstring, in one line."""
    return " ".join((inspect.getdoc(model) or "").split("\n\n")[0].split())


def limits(field: FieldInfo) -> tuple[Limit | None, Limit | None]:
    """Tightest lower and upper limit of a key; limits far beyond any use are left out."""
    rules = [*field.metadata, *_rules(field.annotation)]
    low = _tightest(rules, "gt", "ge", is_lower=True)
    high = _tightest(rules, "lt", "le", is_lower=False)
    return low, high


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
