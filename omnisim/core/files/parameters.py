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
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, TypeVar, get_type_hints

import numpy as np
import pydantic
from pydantic import Field

from omnisim.core.errors import OmnisimError, OpticsError
from omnisim.core.files.table_faults import MIN_POSITIVE, fault_line

MAX_NUMBER = 1e9  # products and quotients of a few stay within float32, as on the GPU

Number = Annotated[float, Field(strict=True)]  # no "11", no true; whole numbers are fine
IntOrFloat = pydantic.StrictInt | pydantic.StrictFloat  # a number as it was written
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
Seed = Annotated[int, Field(ge=0, le=2**32 - 1, strict=True)]  # one word of NumPy's seeds
LongSeed = Annotated[int, Field(ge=0, lt=2**63, strict=True)]


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
            (f"{source}: " if source else "") + fault_line(fault, model, at)
            for fault in faults
            # faulty items of a list do not count as items
            if not (fault["type"] == "too_short" and _has_inner(keys, fault["loc"]))
        )
    )


def _has_inner(keys: list[tuple[int | str, ...]], outer: tuple[int | str, ...]) -> bool:
    return any(len(key) > len(outer) and key[: len(outer)] == outer for key in keys)
