"""Numbers, rounding, headers and CSV files of range-measuring devices."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import OpticsError
from omnisim.core.files.atomic_file import write_text

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

MAX_SEED = 2**32 - 1  # one word each in a NumPy seed: different tuples never coincide
_SPECULAR_KEYS = ("specular", "returns", "min_intensity")


def check_number(name: str, number: object) -> None:
    """Raise an error unless a measurement number is a whole number of 32 bits.

    Raises:
        OpticsError: the number is invalid; names the measurement and the number.
    """
    is_whole = isinstance(number, int | np.integer) and not isinstance(number, bool)
    if not (is_whole and 0 <= number <= MAX_SEED):  # type: ignore[operator]
        raise OpticsError(f"{name}: expected a whole number of 32 bits, got {number!r}")


def round_ranges(ranges_m: Floats, step_m: float) -> Floats:
    """Round ranges (...) to multiples of a step; a step of 0 leaves them unchanged."""
    if not step_m:
        return ranges_m
    # Dividing, unlike multiplying, is exact to the last bit: 8190 steps become 8.19.
    steps_per_m = 1.0 / step_m
    return np.rint(ranges_m * steps_per_m) / steps_per_m


def stated_parameters(sensor: DataclassInstance) -> dict[str, Any]:
    """Parameters of a sensor for the header of its files, but for its file format.

    Keys for glass and mirrors are left out at their defaults: files of scenes without are the same
    as without these keys.
    """
    defaults = {key.name: key.default for key in dataclasses.fields(sensor)}
    return {
        key: value
        for key, value in dataclasses.asdict(sensor).items()
        if key != "file_format" and (key not in _SPECULAR_KEYS or value != defaults[key])
    }


# CSV files of measurements with leading comment lines of metadata.


def write_commented_csv(
    path: str | Path, header: Mapping[str, Any], columns: str, rows: Iterable[str]
) -> None:
    """Atomically write `# key: value` lines with JSON values, the column names, and the rows.

    Raises:
        OutputError: the file cannot be written.
    """
    comments = (
        f"# {key}: {json.dumps(value, ensure_ascii=False)}" for key, value in header.items()
    )
    write_text(Path(path), "\n".join((*comments, columns, *rows)) + "\n")
