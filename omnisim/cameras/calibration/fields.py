"""Fields of calibration files: numbers, sizes, and lists of a known length."""

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
    """Error about an unexpected value; `place` names file and key."""
    return CalibrationError(f"{place}: expected {expected}, got {short(got)}")


def check_choice(value: str, choices: Iterable[str], place: str) -> None:
    """Reject a word that is not among the choices.

    Raises:
        CalibrationError: the word is invalid; names the place, the choices and the word.
    """
    choices = list(choices)
    if value not in choices:
        raise unexpected(place, f"one of {', '.join(choices)}", value)


def _whole_size(value: Any) -> int:
    """Integer number of pixels; some formats write it with a decimal point, as 1280.0."""
    if type(value) in (int, float) and 1 <= value <= MAX_SIZE_PX and value == int(value):
        return int(value)
    raise ValueError(f"expected {SIZE}")


Size = Annotated[int, BeforeValidator(_whole_size)]
Numbers = list[Number]
Matrix = list[list[Number]]


class ForeignTable(Table):
    """Table of another tool's file: unknown keys are ignored."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


def parse(data: Any, model: type[TableT], source: str) -> TableT:
    """Validate `data` against `model`; `source` names file and place in messages.

    Raises:
        CalibrationError: the data is invalid; names place, key, actual and expected value.
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
    """Parse a finite number in a text file.

    Raises:
        CalibrationError: the word is not a finite number.
    """
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise unexpected(place, "a number", word)
    return value


def parse_size(word: str, place: str) -> int:
    """Parse a number of pixels in a text file.

    Raises:
        CalibrationError: the word is not a number of pixels.
    """
    try:
        return _whole_size(parse_number(word, place))
    except ValueError:
        raise unexpected(place, SIZE, word) from None


def counted(values: Sequence[float], names: str, source: str) -> list[float]:
    """Check that there is one value per space-separated name, and return the values.

    Raises:
        CalibrationError: there are more or fewer values than names.
    """
    expected = names.split()
    if len(values) != len(expected):
        numbers = f"{len(expected)} numbers: {', '.join(expected)}"
        raise unexpected(source, numbers, list(values))
    return [float(value) for value in values]


def pose(matrix: Sequence[Sequence[float]], source: str) -> NDArray[np.float64]:
    """Pose (4, 4) from rows; a fourth row is added to three.

    Raises:
        CalibrationError: the matrix is not a pose.
    """
    rows = [list(row) for row in matrix]
    if len(rows) == 3:
        rows.append([0.0, 0.0, 0.0, 1.0])
    try:
        if len(rows) != 4 or any(len(row) != 4 for row in rows):
            raise CalibrationError("expected 4 × 4 numbers")
        return check_pose(rows)
    except OmnisimError as reason:
        message = str(reason).removeprefix("pose: ")
        raise CalibrationError(f"{source}: {message}, got {short(rows)}") from None


def rows(matrix: NDArray[np.float64]) -> list[list[float]]:
    """Rows of a matrix as nested lists of floats, with −0 replaced by 0."""
    listed: list[list[float]] = (np.asarray(matrix) + 0.0).tolist()
    return listed


def short(value: object) -> str:
    """Text of a value for a message, truncated if long."""
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."
