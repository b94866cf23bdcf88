"""Fields of calibration files: numbers, sizes, and lists of a known length."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar, NamedTuple, TypeVar

import numpy as np
import pydantic
from numpy.typing import NDArray
from pydantic import BeforeValidator, ConfigDict

from omnisim.core.errors import CalibrationError, OmnisimError, did_you_mean
from omnisim.core.files.parameters import Number, Table, parse_table
from omnisim.core.poses import check_pose

MAX_SIZE_PX = 32768
SIZE = f"a whole number from 1 to {MAX_SIZE_PX}"
TableT = TypeVar("TableT", bound=pydantic.BaseModel)


def unexpected(place: str, expected: str, got: object) -> CalibrationError:
    """Error about an unexpected value; `place` names file and key."""
    return CalibrationError(f"{place}: expected {expected}, got {short(got)}")


def check_choice(
    value: str, choices: Iterable[str], place: str, others: Mapping[str, str] | None = None
) -> None:
    """Reject a word that is not among the choices; `others` are remedies for words of the format.

    Raises:
        CalibrationError: the word is invalid; names the place, the choices and the word.
    """
    choices = list(choices)
    if value in choices:
        return
    error = unexpected(place, f"one of {', '.join(choices)}", value)
    hint = (others or {}).get(value) or did_you_mean(value, choices)
    raise error if hint.startswith("expected") else CalibrationError(f"{error}: {hint}")


def _whole_size(value: Any) -> int:
    """Integer number of pixels; some formats write it with a decimal point, as 1280.0."""
    if type(value) in (int, float) and 1 <= value <= MAX_SIZE_PX and value == int(value):
        return int(value)
    raise ValueError(f"expected {SIZE}")


Size = Annotated[int, BeforeValidator(_whole_size)]
Numbers = list[Number]
Matrix = list[list[Number]]


class Unread(NamedTuple):
    """Key of a format that omnisim does not use although it changes an image or a pose.

    Attributes:
        effect: meaning of the key, and what to do about it.
        neutral: values without effect, besides nothing and zeros.
        is_fault: True if the camera would be wrong without it: an error instead of a notice.
    """

    effect: str
    neutral: tuple[Any, ...] = ()
    is_fault: bool = False


ROLLING_SHUTTER = Unread("rolling shutter: [degradation.shutter] of a sensor file")


class ForeignTable(Table):
    """Table of another tool's file: its fields are read, and notices name other keys.

    A subclass states further keys of its format, in addition to its base's.

    Attributes:
        also_read: keys that are read without a field.
        unread: keys that change an image or a pose, and are not read; given in words.
        harmless: keys that change neither.
        inner: tables in this one by their keys, in lists or alone; "*": of all other keys.
    """

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)
    also_read: ClassVar[frozenset[str]] = frozenset()
    unread: ClassVar[Mapping[str, Unread]] = {}
    harmless: ClassVar[frozenset[str]] = frozenset()
    inner: ClassVar[Mapping[str, type[ForeignTable]]] = {}

    def __init_subclass__(
        cls,
        also_read: str = "",
        unread: Mapping[str, Unread] | None = None,
        harmless: str = "",
        inner: Mapping[str, type[ForeignTable]] | None = None,
        **settings: Any,
    ) -> None:
        super().__init_subclass__(**settings)
        cls.also_read = cls.also_read.union(also_read.split())
        own = {key: one for keys, one in (unread or {}).items() for key in keys.split()}
        cls.unread = {**cls.unread, **own}
        cls.harmless = cls.harmless.union(harmless.split())
        cls.inner = {**cls.inner, **(inner or {})}

    @classmethod
    def reads(cls, key: str, value: Any) -> bool:
        """True for a key that is read."""
        return key in cls.model_fields or key in cls.also_read or key in cls.inner


def unread_keys(
    data: Any, table: type[ForeignTable], path: str = ""
) -> Iterator[tuple[str, Any, Unread | None]]:
    """Paths and values of keys that are not read nor harmless, and their meanings if known."""
    if isinstance(data, list):
        for index, item in enumerate(data):
            yield from unread_keys(item, table, f"{path}.{index}")
    if not isinstance(data, Mapping):
        return
    for key, value in data.items():
        where = f"{path}.{key}" if path else str(key)
        meaning = table.unread.get(key)
        if table.reads(key, value):
            inner = table.inner.get(key, table.inner.get("*"))
            if inner is not None:
                yield from unread_keys(value, inner, where)
        elif key not in table.harmless and not (meaning and _is_neutral(value, meaning.neutral)):
            yield where, value, meaning


def _is_neutral(value: Any, neutral: tuple[Any, ...]) -> bool:
    """True for a neutral value, nothing or zeros."""
    if isinstance(value, Mapping):
        return all(_is_neutral(one, neutral) for one in value.values())
    if value in neutral:
        return True
    if isinstance(value, list):
        return all(_is_neutral(one, neutral) for one in value)
    if isinstance(value, str):
        return all(word.strip("0.") in ("", "false", "none") for word in value.lower().split())
    return not value


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
    return (np.asarray(matrix) + 0.0).tolist()


def short(value: object) -> str:
    """Text of a value for a message, truncated if long."""
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."
