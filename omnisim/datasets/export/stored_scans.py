"""Tables of a run's sensors, read back: laser scans, ranges, IMU readings."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import RunError
from omnisim.datasets.export.file_headers import FileHeader

MAX_NUMBER = 1e30  # within the range of the formats' floats


@dataclass(frozen=True, eq=False)
class StoredTable:
    """Table of a sensor.

    Attributes:
        header: parameters and pose of the sensor.
        columns: by name, (n,) values each.
    """

    header: FileHeader
    columns: dict[str, NDArray[np.float64]]


def read_table(path: Path, *names: str) -> StoredTable:
    """Read a table with the given columns.

    Raises:
        RunError: the file cannot be read, or is damaged.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError) as reason:
        raise RunError(f"{path}: cannot be read: {reason}") from None
    comments = [line.removeprefix("# ") for line in lines if line.startswith("#")]
    rows = [line.split(",") for line in lines if not line.startswith("#")]
    if not rows or rows[0] != list(names):
        raise RunError(f"{path}: expected the columns {','.join(names)}")
    try:
        values = np.array(rows[1:], dtype=np.float64).reshape(-1, len(names))
    except ValueError:
        raise RunError(f"{path}: expected {len(names)} numbers a line") from None
    if np.any(np.isfinite(values) & (np.abs(values) > MAX_NUMBER)):
        raise RunError(f"{path}: expected numbers below {MAX_NUMBER:g}")
    columns = {name: values[:, index] for index, name in enumerate(names)}
    return StoredTable(FileHeader(path, comments), columns)
