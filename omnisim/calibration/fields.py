"""Parts of calibration files as pydantic checks them: numbers, sizes, lists of a known length."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, TypeVar

import numpy as np
import pydantic
from numpy.typing import NDArray
from pydantic import BeforeValidator, ConfigDict

from omnisim import poses
from omnisim.errors import CalibrationError, OmnisimError
from omnisim.parameters import Number, Table, parse_table

LARGEST_SIZE_PX = 32768
Model = TypeVar("Model", bound=pydantic.BaseModel)


def _size(value: Any) -> int:
    """A whole number of pixels; some write it with a point, as 1280.0."""
    if type(value) in (int, float) and 1 <= value <= LARGEST_SIZE_PX and value == int(value):
        return int(value)
    raise ValueError(f"want a whole number from 1 to {LARGEST_SIZE_PX}")


Size = Annotated[int, BeforeValidator(_size)]
Numbers = list[Number]
Matrix = list[list[Number]]


class Foreign(Table):
    """A part of another tool's file: keys that are not ours to know are left alone."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


def parse(data: Any, model: type[Model], source: str) -> Model:
    """Check `data` against `model`; `source` names file and place in messages.

    Raises:
        CalibrationError: naming place, key, value and what was wanted.
    """
    if not isinstance(data, Mapping):
        raise CalibrationError(f"{source} = {short(data)}: want keys with values")
    try:
        return parse_table(dict(data), model, CalibrationError, source)
    except CalibrationError as reason:  # values can be long
        lines = (line if len(line) < 400 else line[:400] + " …" for line in str(reason).split("\n"))
        raise CalibrationError("\n".join(lines)) from None
    except (RecursionError, OverflowError) as reason:
        raise CalibrationError(f"{source}: {type(reason).__name__}: want plain values") from None


def counted(values: Sequence[float], names: str, source: str) -> list[float]:
    """The values, which have to be as many as the names.

    Raises:
        CalibrationError: they are more, or fewer.
    """
    count = len(names.split())
    if len(values) != count:
        raise CalibrationError(
            f"{source}: {len(values)} numbers, {short(list(values))}: want {count}: "
            + names.replace(" ", ", ")
        )
    return [float(value) for value in values]


def pose(matrix: Sequence[Sequence[float]], source: str) -> NDArray[np.float64]:
    """A pose (4, 4) of rows; three rows are completed.

    Raises:
        CalibrationError: no pose.
    """
    rows = [list(row) for row in matrix]
    if len(rows) == 3:
        rows.append([0.0, 0.0, 0.0, 1.0])
    try:
        if len(rows) != 4 or any(len(row) != 4 for row in rows):
            raise CalibrationError("want 4 × 4 numbers")
        return poses.check_pose(rows)
    except OmnisimError as reason:
        words = str(reason).removeprefix("pose: ")
        raise CalibrationError(f"{source} = {short(rows)}: {words}") from None


def rows(matrix: NDArray[np.float64]) -> list[list[float]]:
    """A matrix as nested lists of floats, without −0."""
    return (np.asarray(matrix) + 0.0).tolist()


def short(value: Any) -> str:
    """A value as a message shows it, cut where it is long."""
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."
