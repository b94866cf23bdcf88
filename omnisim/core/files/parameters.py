"""Parameters that are validated by their annotations, equally in files and in Python.

A `Table` is a table in a file, validated by `parse_table`. `Parameters` is the base of frozen
dataclasses that validate themselves on construction:

    @dataclass(frozen=True)
    class LaserScanner(Parameters, name="scanner"):
        range_min_m: NotNegative = 0.1
        range_max_m: Positive = 8.19

        def _check(self) -> None:  # rules that single annotations cannot express
            if not self.range_min_m < self.range_max_m:
                raise self._error("range_min_m", f"less than range_max_m = {self.range_max_m:g}")

    LaserScanner(range_min_m=-1)  # OpticsError: scanner.range_min_m: expected a number ≥ 0, got -1
    parse_table(read, table_of(LaserScanner), SensorFileError, "my.toml")  # my.toml: range_min_m: …

A subclass inherits the prefix of messages, and extends `_check` through `super()._check()`.
Numbers are stored as floats and lists as tuples.
"""  # fmt: skip

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, TypeVar, get_type_hints

import numpy as np
import pydantic
from pydantic import Field

from omnisim.core.errors import OmnisimError, OpticsError
from omnisim.core.files.table_faults import MIN_POSITIVE, fault_line

MAX_NUMBER = 1e9  # products and quotients of a few such numbers fit in float32, as on the GPU

Number = Annotated[float, Field(strict=True)]  # rejects "11" and true; integers are accepted
IntOrFloat = pydantic.StrictInt | pydantic.StrictFloat  # keeps the type as written
NotNegative = Annotated[Number, Field(ge=0.0, le=MAX_NUMBER)]
Positive = Annotated[Number, Field(ge=MIN_POSITIVE, le=MAX_NUMBER)]
Signed = Annotated[Number, Field(ge=-MAX_NUMBER, le=MAX_NUMBER)]
Fraction = Annotated[Number, Field(ge=0.0, le=1.0)]
AboveZero = Annotated[Number, Field(gt=0.0)]
Level = Annotated[Number, Field(ge=0.0)]
Coordinate = Annotated[Number, Field(ge=-1000.0, le=1000.0)]
Length = Annotated[Number, Field(gt=0.0, le=1000.0)]
Flag = Annotated[bool, Field(strict=True)]
Name = Annotated[str, Field(min_length=1, strict=True)]
Point = tuple[Signed, Signed, Signed]
Seed = Annotated[int, Field(ge=0, le=2**32 - 1, strict=True)]  # one word of a NumPy seed
LongSeed = Annotated[int, Field(ge=0, lt=2**63, strict=True)]


class Table(pydantic.BaseModel):
    """A table in a file: accepts only its own keys, and is immutable once read."""

    synonyms: ClassVar[Mapping[str, str]] = {}  # names of keys in other programs

    model_config = pydantic.ConfigDict(
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
        str_strip_whitespace=True,
        defer_build=True,  # until a file is read; most kinds of tables are never needed
    )


Model = TypeVar("Model", bound=pydantic.BaseModel)


class Parameters:
    """Base of frozen dataclasses that validate their fields against the annotations.

    Raises:
        OpticsError: one line per error, naming the key, the expected value and the actual one.
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
        """Reject values that do not fit each other."""

    def _error(self, key: str, expected: str) -> OpticsError:
        value = getattr(self, key)
        got = f"{value:g}" if isinstance(value, float) else repr(value)
        return OpticsError(f"{self._name}.{key}: expected {expected}, got {got}")


def _plain(value: Any) -> Any:
    """Convert NumPy scalars to Python numbers, also within a list or tuple."""
    if isinstance(value, np.generic):
        return value.item()
    return tuple(map(_plain, value)) if isinstance(value, list | tuple) else value


_TABLES: dict[type[Parameters], type[Table]] = {}


def table_of(kind: type[Parameters]) -> type[Table]:
    """Schema of a file's table with the fields of a parameter class, without its `_check`."""
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
    """Validator of a union, such as `Literal["auto"] | Number`, with one message for all errors."""

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
    """Validate `data` against `model`.

    Args:
        data: keys and values.
        model: schema.
        error: exception class to raise for invalid data.
        source: file name, for messages.
        at: key of the table in its file; empty: the file itself.

    Raises:
        error: one line per error in the data.
    """
    try:
        return model.model_validate(data)
    except pydantic.ValidationError as reason:
        faults = reason.errors()
    keys = [fault["loc"] for fault in faults]
    raise error(
        "\n".join(
            (f"{source}: " if source else "") + fault_line(fault, model, at)
            for fault in faults
            # invalid items of a list are not counted as items
            if not (fault["type"] == "too_short" and _has_inner(keys, fault["loc"]))
        )
    )


def _has_inner(keys: list[tuple[int | str, ...]], outer: tuple[int | str, ...]) -> bool:
    return any(len(key) > len(outer) and key[: len(outer)] == outer for key in keys)
