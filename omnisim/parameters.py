"""Parameters, checked alike in files and in Python by their annotations.

A `Table` is a table of a file, which `parse_table` checks. `Parameters` is the base of frozen
dataclasses that check themselves when they are made:

    @dataclass(frozen=True)
    class LaserScanner(Parameters, name="scanner"):
        range_min_m: NotNegative = 0.1
        range_max_m: Positive = 8.19

        def _check(self) -> None:  # what single annotations cannot say
            if not self.range_min_m < self.range_max_m:
                raise self._error("range_min_m", f"less than range_max_m = {self.range_max_m:g}")

    LaserScanner(range_min_m=-1)  # OpticsError: scanner.range_min_m: expected a number ≥ 0, got -1
    parse_table(read, table_of(LaserScanner), SensorFileError, "my.toml")  # my.toml: range_min_m: …

A subclass inherits the name that messages begin with, and extends `_check` by `super()._check()`.
Numbers are stored as floats and lists as tuples.
"""  # fmt: skip

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
import pydantic
from pydantic import Field
from pydantic_core import ErrorDetails

from omnisim.errors import OmnisimError, OpticsError, did_you_mean

SMALLEST, LARGEST = 1e-9, 1e9  # products and quotients of a few stay within float32, as on the GPU

Number = Annotated[float, Field(strict=True)]  # no "11", no true; whole numbers are fine
IntOrFloat = pydantic.StrictInt | pydantic.StrictFloat  # a number as it was written
NotNegative = Annotated[Number, Field(ge=0.0, le=LARGEST)]
Positive = Annotated[Number, Field(ge=SMALLEST, le=LARGEST)]
Signed = Annotated[Number, Field(ge=-LARGEST, le=LARGEST)]
Fraction = Annotated[Number, Field(ge=0.0, le=1.0)]


class Table(pydantic.BaseModel):
    """A table of a file: takes its own keys only, and cannot be changed once read."""

    synonyms: ClassVar[Mapping[str, str]] = {}  # other programs' names of keys

    model_config = pydantic.ConfigDict(
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
        str_strip_whitespace=True,
        defer_build=True,  # until a file is read: of most kinds none ever is
    )


Model = TypeVar("Model", bound=pydantic.BaseModel)


class Parameters:
    """Base of frozen dataclasses that check their fields against their annotations.

    Raises:
        OpticsError: one line for each fault, naming the key, what was expected and what was got.
    """

    __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]
    _name: ClassVar[str] = ""

    def __init_subclass__(cls, name: str | None = None):
        if name is not None:
            cls._name = name

    def __post_init__(self) -> None:
        given = {key.name: _plain(getattr(self, key.name)) for key in dataclasses.fields(self)}
        checked = parse_table(given, table_of(type(self)), OpticsError, at=self._name)
        for key in given:
            object.__setattr__(self, key, getattr(checked, key))
        self._check()

    def _check(self) -> None:
        """Refuse values that do not fit each other."""

    def _error(self, key: str, expected: str) -> OpticsError:
        value = getattr(self, key)
        got = f"{value:g}" if isinstance(value, float) else repr(value)
        return OpticsError(f"{self._name}.{key}: expected {expected}, got {got}")


def _plain(value: Any) -> Any:
    """NumPy's scalars as Python's numbers, alone or in a list or tuple."""
    if isinstance(value, np.generic):
        return value.item()
    return tuple(map(_plain, value)) if isinstance(value, list | tuple) else value


_TABLES: dict[type[Parameters], type[Table]] = {}


def table_of(kind: type[Parameters]) -> type[Table]:
    """The table of a file with the fields of a parameter class, without its `_check`."""
    if kind not in _TABLES:
        _TABLES[kind] = _make_table(kind)
    return _TABLES[kind]


def _make_table(kind: type[Parameters]) -> type[Table]:
    hints = get_type_hints(kind, include_extras=True)
    fields: dict[str, Any] = {}
    for field in dataclasses.fields(kind):
        default = ... if field.default is dataclasses.MISSING else field.default
        fields[field.name] = (hints[field.name], default)
    return pydantic.create_model(kind.__name__, __base__=Table, **fields)


def described(expected: str) -> pydantic.WrapValidator:
    """One message for all faults of a union, such as `Literal["auto"] | Number`."""

    def check(value: Any, parse: pydantic.ValidatorFunctionWrapHandler) -> Any:
        try:
            return parse(value)
        except pydantic.ValidationError:
            raise ValueError(f"expected {expected}") from None

    return pydantic.WrapValidator(check)


def parse_table(
    data: Mapping[str, Any],
    model: type[Model],
    error: type[OmnisimError],
    source: str = "",
    at: str = "",
) -> Model:
    """Check `data` against `model`.

    Args:
        data: keys and values.
        model: what they are checked against.
        error: raised where they do not fit.
        source: names the file in messages.
        at: key of the table in its file; empty: the file itself.

    Raises:
        error: one line for each fault.
    """
    try:
        return model.model_validate(data)
    except pydantic.ValidationError as reason:
        faults = reason.errors()
    keys = [fault["loc"] for fault in faults]
    raise error(
        "\n".join(
            (f"{source}: " if source else "") + _line(fault, model, at)
            for fault in faults
            # faulty items of a list do not count as items
            if not (fault["type"] == "too_short" and _has_inner(keys, fault["loc"]))
        )
    )


def _has_inner(keys: list[tuple[int | str, ...]], outer: tuple[int | str, ...]) -> bool:
    return any(len(key) > len(outer) and key[: len(outer)] == outer for key in keys)


_RELATIONS = {
    "greater_than": ("a number >", "gt"),
    "greater_than_equal": ("a number ≥", "ge"),
    "less_than": ("a number <", "lt"),
    "less_than_equal": ("a number ≤", "le"),
}


def _line(fault: ErrorDetails, model: type[pydantic.BaseModel], at: str) -> str:
    names = [str(part) for part in fault["loc"]]
    key = ".".join([at, *names] if at else names) or "file"
    if fault["type"] == "extra_forbidden":
        table = _table_at(model, names[:-1])
        known = list(table.model_fields) if table else []
        synonyms = table.synonyms if table and issubclass(table, Table) else {}
        name = synonyms.get(names[-1], names[-1])
        return f"{key}: unknown key; {did_you_mean(name, known, 'known keys:')}"
    if fault["type"] == "missing":
        return f"{key}: missing"
    expected = _expected(fault, model, names, key)
    if expected:
        return f"{key}: expected {expected}, got {fault['input']!r}"
    return f"{key}: {fault['msg'].removeprefix('Value error, ')}"


def _expected(
    fault: ErrorDetails, model: type[pydantic.BaseModel], names: list[str], key: str
) -> str:
    """Expected value of a fault; empty: the message says all."""
    kind, message = fault["type"], fault["msg"].removeprefix("Value error, ")
    if kind in ("model_type", "dict_type"):
        is_item = bool(names) and names[-1].isdecimal()
        return f"a table, [[{key.rpartition('.')[0]}]]" if is_item else f"a table, [{key}]"
    if kind == "tuple_type" and _holds_tables(model, names):
        return f"tables, [[{key}]]"
    if kind == "tuple_type":
        return "a list of numbers, [x, y, z]"
    if kind in _RELATIONS:
        words, limit = _RELATIONS[kind]
        return f"{words} {fault['ctx'][limit]:g}"
    begin = r"^(expected|Input should be|(String|Tuple) should have) "
    expected = re.sub(begin, "", message)
    if expected == message or ", got " in message:
        return ""
    return re.sub(r" after validation, not \d+$", "", expected)


def _table_at(model: type[pydantic.BaseModel], names: list[str]) -> type[pydantic.BaseModel] | None:
    """The table that `names` leads to; None where it cannot be followed."""
    for name in names:
        if name.isdecimal():  # an index into a list of tables
            continue
        field = model.model_fields.get(name)
        inner = _table_in(field.annotation) if field else None
        if inner is None:
            return None
        model = inner
    return model


def _holds_tables(model: type[pydantic.BaseModel], names: list[str]) -> bool:
    """Tell whether `names` leads to a list of tables, whose own keys may be open."""
    field = model.model_fields.get(names[-1]) if len(names) == 1 else None
    is_open = field is not None and any(get_origin(a) is dict for a in get_args(field.annotation))
    return is_open or _table_at(model, names) is not None


def _table_in(annotation: Any) -> type[pydantic.BaseModel] | None:
    """The table that a key holds: one, one or none, or a list of them."""
    if isinstance(annotation, type) and issubclass(annotation, pydantic.BaseModel):
        return annotation
    inner = (_table_in(part) for part in get_args(annotation))
    return next((table for table in inner if table), None)
