"""Fields of calibration files: numbers, sizes, lists of a known length."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, TypeVar

import numpy as np
import pydantic
from numpy.typing import NDArray
from pydantic import BeforeValidator, ConfigDict

from omnisim.core.errors import CalibrationError, OmnisimError
from omnisim.core.files.parameters import Number, Table, parse_table
from omnisim.core.poses import check_pose

MAX_SIZE_PX = 32768
SIZE = f"a whole number from 1 to {MAX_SIZE_PX}"
TableT = TypeVar("TableT", bound=pydantic.BaseModel)


def unexpected(place: str, expected: str, got: object) -> CalibrationError:
    """Error about a value; `place` names file and key."""
    return CalibrationError(f"{place}: expected {expected}, got {short(got)}")


def check_choice(value: str, choices: Iterable[str], place: str) -> None:
    """Refuse a word that is not among the choices.

    Raises:
        CalibrationError: naming the place, the choices and the word.
    """
    choices = list(choices)
    if value not in choices:
        raise unexpected(place, f"one of {', '.join(choices)}", value)


def _whole_size(value: Any) -> int:
    """Whole number of pixels; some formats write it with a point, as 1280.0."""
    if type(value) in (int, float) and 1 <= value <= MAX_SIZE_PX and value == int(value):
        return int(value)
    raise ValueError(f"expected {SIZE}")


Size = Annotated[int, BeforeValidator(_whole_size)]
Numbers = list[Number]
Matrix = list[list[Number]]


class ForeignTable(Table):
    """A table of another tool's file: unknown keys are ignored."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


def parse(data: Any, model: type[TableT], source: str) -> TableT:
    """Check `data` against `model`; `source` names file and place in messages.

    Raises:
        CalibrationError: naming place, key, the expected value and the one found.
    """
    if not isinstance(data, Mapping):
        raise unexpected(source, "keys with values", data)
    try:
        return parse_table(dict(data), model, CalibrationError, source)
    except CalibrationError as reason:  # values can be long
        lines = (line if len(line) < 400 else line[:400] + " …" for line in str(reason).split("\n"))
        raise CalibrationError("\n".join(lines)) from None
    except (RecursionError, OverflowError) as reason:
        raise unexpected(source, "plain values", type(reason).__name__) from None


def parse_number(word: str, place: str) -> float:
    """Finite number of a word in a text file.

    Raises:
        CalibrationError: the word is none.
    """
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise unexpected(place, "a number", word)
    return value


def parse_size(word: str, place: str) -> int:
    """Number of pixels of a word in a text file.

    Raises:
        CalibrationError: the word is none.
    """
    try:
        return _whole_size(parse_number(word, place))
    except ValueError:
        raise unexpected(place, SIZE, word) from None


def counted(values: Sequence[float], names: str, source: str) -> list[float]:
    """Values that have to be as many as the names.

    Raises:
        CalibrationError: they are more, or fewer.
    """
    expected = names.split()
    if len(values) != len(expected):
        numbers = f"{len(expected)} numbers: {', '.join(expected)}"
        raise unexpected(source, numbers, list(values))
    return [float(value) for value in values]


def pose(matrix: Sequence[Sequence[float]], source: str) -> NDArray[np.float64]:
    """Pose (4, 4) from rows; three rows are completed.

    Raises:
        CalibrationError: no pose.
    """
    rows = [list(row) for row in matrix]
    if len(rows) == 3:
        rows.append([0.0, 0.0, 0.0, 1.0])
    try:
        if len(rows) != 4 or any(len(row) != 4 for row in rows):
            raise CalibrationError("expected 4 × 4 numbers")
        return check_pose(rows)
    except OmnisimError as reason:
        words = str(reason).removeprefix("pose: ")
        raise CalibrationError(f"{source}: {words}, got {short(rows)}") from None


def rows(matrix: NDArray[np.float64]) -> list[list[float]]:
    """Nested lists of a matrix's floats, without −0."""
    listed: list[list[float]] = (np.asarray(matrix) + 0.0).tolist()
    return listed


def short(value: object) -> str:
    """Text of a value for a message, cut where it is long."""
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."
