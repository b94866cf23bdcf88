"""Parameters that are checked alike whether they come from a file or from Python."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Self, get_type_hints

import pydantic

from omnisim.errors import OpticsError
from omnisim.parameters import Number, Table, parse_table

# Products and quotients of a few of these stay within float32, which the GPU counts in.
SMALLEST, LARGEST = 1e-9, 1e9
MOST_STOPS = 30.0


def _is_not_tiny(value: float) -> float:
    if value < SMALLEST:
        raise ValueError(f"want at least {SMALLEST:g}")
    return value


NotNegative = Annotated[Number, pydantic.Field(ge=0.0, le=LARGEST)]
Positive = Annotated[
    Number, pydantic.Field(gt=0.0, le=LARGEST), pydantic.AfterValidator(_is_not_tiny)
]
Signed = Annotated[Number, pydantic.Field(ge=-LARGEST, le=LARGEST)]
Stops = Annotated[Number, pydantic.Field(ge=-MOST_STOPS, le=MOST_STOPS)]
Share = Annotated[Number, pydantic.Field(ge=0.0, le=1.0)]
Count = Annotated[int, pydantic.Field(strict=True, ge=0, le=10_000)]
Seed = Annotated[int, pydantic.Field(strict=True, ge=0, lt=2**63)]
Colour = tuple[NotNegative, NotNegative, NotNegative]


@dataclass(frozen=True)
class Parameters:
    """Base of the tables below `[degradation]`: a frozen dataclass whose types say what fits.

    Raises:
        OpticsError: naming the table, the key, its value and what was wanted.
    """

    def __post_init__(self) -> None:
        name = self.table_name()
        given = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        checked = parse_table(given, table_of(type(self)), OpticsError, f"degradation.{name}")
        for key in given:
            object.__setattr__(self, key, getattr(checked, key))
        self._check()

    def _check(self) -> None:
        """Refuse values that do not fit each other."""

    @classmethod
    def table_name(cls) -> str:
        """Name of the table in a sensor file: that of the module."""
        return cls.__module__.rpartition(".")[2]

    def values(self) -> dict[str, Any]:
        """The keys of the table with their values; those without one are left out."""
        told = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return {key: value for key, value in told.items() if value is not None}

    def scaled(self, scale: float) -> Self:
        """The same for a picture `scale` times as large: what is given in pixels grows."""
        pixels = {
            field.name: scale * getattr(self, field.name)
            for field in dataclasses.fields(self)
            if field.name.endswith("_px")
        }
        return dataclasses.replace(self, **pixels) if pixels else self


@cache
def table_of(kind: type[Parameters]) -> type[Table]:
    """The checked TOML table with the fields of a parameter class."""
    hints = get_type_hints(kind, include_extras=True)
    fields = {field.name: (hints[field.name], field.default) for field in dataclasses.fields(kind)}
    return pydantic.create_model(kind.__name__, __base__=Table, **fields)
