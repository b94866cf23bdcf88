"""Reading TOML into a checked model, with errors that name file, key, value and what was wanted."""

from __future__ import annotations

import difflib
import tomllib
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args

import pydantic

from omnisim.errors import OmnisimError

Model = TypeVar("Model", bound=pydantic.BaseModel)
Number = Annotated[float, pydantic.Field(strict=True)]  # no "11", no true; whole numbers are fine


class Table(pydantic.BaseModel):
    """A TOML table that takes its own keys only and cannot be changed once read."""

    model_config = pydantic.ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, str_strip_whitespace=True
    )


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
        lines = [f"{source}: {_line(fault, model)}" for fault in faults.errors()]
        raise error("\n".join(lines)) from None


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
    if fault["type"] == "model_type":
        return f"{key} = {fault['input']!r}: want a table, [{key}]"
    if fault["type"] == "tuple_type" and _keys(model, names):
        return f"{key} = {fault['input']!r}: want tables, [[{key}]]"
    message = fault["msg"].removeprefix("Value error, ").replace("Input should be", "want")
    message = message.replace("a valid tuple", "a list of numbers, [x, y, z]")
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


def _table_in(annotation: Any) -> type[pydantic.BaseModel] | None:
    """The table that a key holds: one, one or none, or a list of them."""
    if isinstance(annotation, type) and issubclass(annotation, pydantic.BaseModel):
        return annotation
    inner = (_table_in(part) for part in get_args(annotation))
    return next((table for table in inner if table), None)
