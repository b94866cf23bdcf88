"""Messages about invalid tables, in omnisim's words instead of pydantic's."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, NamedTuple, get_args, get_origin

import pydantic
from pydantic_core import ErrorDetails

from omnisim.core.errors import did_you_mean

MIN_POSITIVE = 1e-9  # lower limit of positive numbers: stands for 0
_MAX_HEADERS = 3  # number of tables with a key; more are no useful hint
_RELATIONS = {
    "greater_than": ("a number >", "gt"),
    "greater_than_equal": ("a number ≥", "ge"),
    "less_than": ("a number <", "lt"),
    "less_than_equal": ("a number ≤", "le"),
}
_KINDS = {
    "float_type": "a number",
    "finite_number": "a finite number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "text",
    "path_type": "a path, as text",
    "bool_type": "true or false",
}


class InnerTable(NamedTuple):
    """Table in the table of a key."""

    model: type[pydantic.BaseModel]  # schema of the inner table
    is_list: bool  # True if the key holds a list of such tables


def table_in(annotation: Any) -> InnerTable | None:
    """Table in the table of a key with this annotation, or None."""
    if isinstance(annotation, type):
        if issubclass(annotation, pydantic.BaseModel):
            return InnerTable(annotation, False)
        if hasattr(annotation, "file_table"):  # of `Parameters`
            return InnerTable(annotation.file_table(), False)
    is_list = get_origin(annotation) in (tuple, list)
    for part in get_args(annotation):
        table = table_in(part)
        if table is not None:
            return InnerTable(table.model, is_list or table.is_list)
    return None


def fault_lines(fault: ErrorDetails, model: type[pydantic.BaseModel], at: str) -> Iterator[str]:
    """Message lines for an error of pydantic: key, expected value and actual value.

    `at` is the key of the table in its file; empty: the file itself.
    """
    names = [str(part) for part in fault["loc"]]
    key = ".".join([at, *names] if at else names)
    if fault["type"] == "extra_forbidden":
        yield f"{key}: unknown key; {_hint(model, names)}"
    elif fault["type"] == "missing":
        yield f"{key}: missing"
    elif expected := _expected(fault, model, names, key):
        yield f"{key or 'file'}: expected {expected}, got {fault['input']!r}"
    else:
        own = getattr(_table_at(model, names), "model_fields", {})
        for line in fault["msg"].removeprefix("Value error, ").split("\n"):
            # a rule of a whole table that begins with the key at fault
            is_of_key = re.split(r"[.:]", line, maxsplit=1)[0] in own
            yield ".".join(filter(None, (key, line))) if is_of_key else f"{key or 'file'}: {line}"


def _hint(model: type[pydantic.BaseModel], names: list[str]) -> str:
    """Hint: the table to which an unknown key belongs, else the nearest key of its own table."""
    table = _table_at(model, names[:-1])
    known = list(table.model_fields) if table else []
    word = getattr(table, "synonyms", {}).get(names[-1], names[-1])
    headers = list(dict.fromkeys(headers_with(model, word)))
    if word in known or len(headers) > _MAX_HEADERS:
        return did_you_mean(word, known, "known keys:")
    if word in model.model_fields:
        inner = table_in(model.model_fields[word].annotation)
        if inner is None:
            return "expected above the first table"
        headers.insert(
            0, f"a table of its own, {'[[' + word + ']]' if inner.is_list else '[' + word + ']'}"
        )
    if headers:
        return f"expected in {' or '.join(headers)}"
    return did_you_mean(word, known, "known keys:")


def _expected(
    fault: ErrorDetails, model: type[pydantic.BaseModel], names: list[str], key: str
) -> str:
    """Expected value in a message; empty if the message is complete without it."""
    kind, message = fault["type"], fault["msg"].removeprefix("Value error, ")
    if kind in ("model_type", "dict_type"):
        is_item = bool(names) and names[-1].isdecimal()
        return f"a table, [[{key.rpartition('.')[0]}]]" if is_item else f"a table, [{key}]"
    if kind == "tuple_type":
        table = _table_at(model, names[:-1])
        field = table.model_fields.get(names[-1]) if table else None
        annotation = field.annotation if field else None
        is_open = len(names) == 1 and any(
            get_origin(argument) is dict for argument in get_args(annotation)
        )
        if is_open or _table_at(model, names) is not None:
            return f"tables, [[{key}]]"
        if _are_words(annotation):
            return 'a list of strings, ["a", "b"]'
        pair = "[u, v]" if key.endswith("_px") else "[x, y]"
        return f"a list of numbers, {pair if _is_pair(annotation) else '[x, y, z]'}"
    if kind in _RELATIONS:
        relation, name = _RELATIONS[kind]
        limit = fault["ctx"][name]
        is_positive = name == "ge" and 0.0 < limit <= MIN_POSITIVE
        return "a number > 0" if is_positive else f"{relation} {limit:g}"
    if kind in _KINDS:
        return _KINDS[kind]
    begin = r"^(expected|Input should be|(String|Tuple) should have) "
    expected = re.sub(begin, "", message)
    if expected == message or ", got " in message:
        return ""
    return re.sub(r" after validation, not \d+$", "", expected)


def _table_at(model: type[pydantic.BaseModel], names: list[str]) -> type[pydantic.BaseModel] | None:
    """Schema of the table at the path `names`, or None if the path cannot be followed."""
    for name in names:
        if name.isdecimal():  # index into a list of tables
            continue
        field = model.model_fields.get(name)
        inner = table_in(field.annotation) if field else None
        if inner is None:
            return None
        model = inner.model
    return model


def headers_with(model: type[pydantic.BaseModel], key: str, path: str = "") -> Iterator[str]:
    """Headers of inner tables that have a key, such as `[light]` and `[[lamps]]`.

    `path` is that of the outer table in its file; empty: the file itself.
    """
    for name, field in model.model_fields.items():
        inner = table_in(field.annotation)
        if inner is None:
            continue
        below = f"{path}.{name}" if path else name
        if key in inner.model.model_fields:
            yield f"[[{below}]]" if inner.is_list else f"[{below}]"
        yield from headers_with(inner.model, key, below)


def _is_pair(annotation: Any) -> bool:
    parts = get_args(annotation)
    is_tuple = get_origin(annotation) is tuple and Ellipsis not in parts
    return (is_tuple and len(parts) == 2) or any(map(_is_pair, parts))


def _are_words(annotation: Any) -> bool:
    return annotation is str or any(map(_are_words, get_args(annotation)))
