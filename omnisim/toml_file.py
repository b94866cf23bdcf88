"""Reading TOML into a checked model, with errors that name file, key, value and what was wanted."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args, get_origin

import pydantic

from omnisim.errors import OmnisimError

Model = TypeVar("Model", bound=pydantic.BaseModel)
Number = Annotated[float, pydantic.Field(strict=True)]  # no "11", no true; whole numbers are fine


class Table(pydantic.BaseModel):
    """A TOML table that takes its own keys only and cannot be changed once read."""

    model_config = pydantic.ConfigDict(
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
        str_strip_whitespace=True,
        defer_build=True,  # until a file is read: of most kinds none ever is
    )


def word_or(word: str, wanted: str, fits: Callable[[Any], bool]) -> pydantic.BeforeValidator:
    """A value that is one certain word, or fits; the message says both."""

    def check(value: Any) -> Any:
        if (isinstance(value, str) and value == word) or fits(value):
            return value
        raise ValueError(f"want {wanted} or {word!r}")

    return pydantic.BeforeValidator(check)


def read_toml(path: Path, model: type[Model], error: type[OmnisimError]) -> Model:
    """Read `path` as `model`.

    Raises:
        error: the file cannot be read, is not TOML, or does not fit the model; one line for each
            fault.
    """
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as reason:
        raise error(f"{path}: cannot be read: {reason.strerror}") from None
    except UnicodeDecodeError:
        raise error(f"{path}: not a text file (want TOML, UTF-8)") from None
    except tomllib.TOMLDecodeError as reason:
        raise error(f"{path}: not TOML: {reason}") from None
    return parse_table(data, model, error, str(path))


def parse_table(
    data: dict[str, Any], model: type[Model], error: type[OmnisimError], source: str
) -> Model:
    """Check `data` against `model`; `source` names it in messages.

    Raises:
        error: one line for each fault.
    """
    try:
        return model.model_validate(data)
    except pydantic.ValidationError as faults:
        told = faults.errors()
        places = [fault["loc"] for fault in told]
        lines = [
            f"{source}: {_line(fault, model)}"
            for fault in told
            if not (fault["type"] == "too_short" and _has_inner(places, fault["loc"]))
        ]
        raise error("\n".join(lines)) from None


def _has_inner(places: list[tuple[Any, ...]], place: tuple[Any, ...]) -> bool:
    """Whether one of the places is inside of a list: its faulty items do not count as items."""
    return any(len(other) > len(place) and other[: len(place)] == place for other in places)


def _line(fault: Any, model: type[pydantic.BaseModel]) -> str:
    names = [str(part) for part in fault["loc"]]
    key = ".".join(names) or "file"
    if fault["type"] == "extra_forbidden":
        known = _keys(model, names[:-1])
        near = difflib.get_close_matches(names[-1], known, n=1, cutoff=0.4)
        hint = f"did you mean {near[0]!r}?" if near else "known keys: " + ", ".join(known)
        return f"{key}: unknown key; {hint}"
    if fault["type"] == "missing":
        return f"{key}: missing"
    if fault["type"] in ("model_type", "dict_type"):
        header = f"[[{'.'.join(names[:-1])}]]" if names[-1].isdecimal() else f"[{key}]"
        return f"{key} = {fault['input']!r}: want a table, {header}"
    if fault["type"] == "tuple_type" and _holds_tables(model, names):
        return f"{key} = {fault['input']!r}: want tables, [[{key}]]"
    message = fault["msg"].removeprefix("Value error, ").replace("Input should be", "want")
    message = message.replace("a valid tuple", "a list of numbers, [x, y, z]")
    message = re.sub(r"^(String|Tuple) should have ", "want ", message)
    message = re.sub(r" after validation, not \d+$", "", message)
    if message.startswith("want"):
        return f"{key} = {fault['input']!r}: {message}"
    return f"{key}: {message}"


def _keys(model: type[pydantic.BaseModel], names: list[str]) -> list[str]:
    """Keys of the table that `names` leads to, as far as it can be followed."""
    for name in names:
        if name.isdecimal():  # which one of a list of tables
            continue
        field = model.model_fields.get(name)
        inner = _table_in(field.annotation) if field else None
        if inner is None:
            return []
        model = inner
    return list(model.model_fields)


def _holds_tables(model: type[pydantic.BaseModel], names: list[str]) -> bool:
    """Whether the key that `names` leads to is a list of tables, whose own keys may be open."""
    if _keys(model, names):
        return True
    field = model.model_fields.get(names[-1]) if len(names) == 1 else None
    return field is not None and any(get_origin(a) is dict for a in get_args(field.annotation))


def _table_in(annotation: Any) -> type[pydantic.BaseModel] | None:
    """The table that a key holds: one, one or none, or a list of them."""
    if isinstance(annotation, type) and issubclass(annotation, pydantic.BaseModel):
        return annotation
    inner = (_table_in(part) for part in get_args(annotation))
    return next((table for table in inner if table), None)
