"""Numbers in an optics file that a calibration may change, addressed by their keys."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from omnisim.cameras.optics.shapes.shape import Floats
from omnisim.cameras.optics.system import OpticalSystem
from omnisim.cameras.optics.system_file import parse_optics
from omnisim.core.errors import OpticsError

_ZEROS = ("decenter_m", "tilt_deg")  # 0 if left out
_Path = tuple[str | int, ...]


class FreeParameters:
    """Numbers in an optics file's table, addressed by keys.

    A key names a number, or a list to select all its numbers: `camera.focal_length_px`,
    `surfaces.0.decenter_m`, `surfaces.0.tilt_deg.2`.

    Args:
        table: table of the optics file.
        keys: keys of the free numbers.
        source: file name, for messages.

    Attributes:
        names: keys of the numbers, in the order of `values`.
        values: (n,) values in the table.

    Raises:
        OpticsError: a key names no number, or a number is named twice.
    """

    def __init__(self, table: Mapping[str, Any], keys: Sequence[str], source: str):
        self._source, self._paths = source, list[_Path]()
        self._table: dict[str, Any] = copy.deepcopy(dict(table))
        for key in keys:
            for path in self._find(key):
                if path in self._paths:
                    raise OpticsError(f"{source}: {key}: expected each number once, got it twice")
                self._paths.append(path)
        self.names = [".".join(map(str, path)) for path in self._paths]
        values = [_at(self._table, path) for path in self._paths]
        self.values: Floats = np.array(values, dtype=np.float64)

    def table(self, values: Floats) -> dict[str, Any]:
        """The file's table with other values (n,)."""
        changed = copy.deepcopy(self._table)
        for path, value in zip(self._paths, values.tolist(), strict=True):
            _at(changed, path[:-1])[path[-1]] = value
        return changed

    def system(self, values: Floats) -> OpticalSystem:
        """Build the optical system with other values (n,).

        Raises:
            SensorFileError: a value is invalid for the system.
        """
        return parse_optics(self.table(values), self._source)

    def _find(self, key: str) -> list[_Path]:
        """Paths to the numbers of a key; optional keys that are missing are added to the table."""
        path: _Path = tuple(int(part) if part.isdecimal() else part for part in key.split("."))
        for end in (len(path) - 1, len(path) - 2):
            holder = _at(self._table, path[:end]) if end > 0 else None
            if isinstance(holder, dict) and path[end] in _ZEROS and "pose" not in holder:
                holder.setdefault(path[end], [0.0, 0.0, 0.0])
        value = _at(self._table, path)
        if isinstance(value, list) and value and all(map(_is_number, value)):
            return [(*path, index) for index in range(len(value))]
        if not _is_number(value):
            actual = "no such key" if value is None else f"{value!r:.60}"
            raise OpticsError(f"{self._source}: {key}: expected a number, got {actual}")
        return [path]


def _at(table: Any, path: _Path) -> Any:
    """Value at a path in tables and lists, or None."""
    for part in path:
        if isinstance(table, dict):
            table = table.get(part)
        elif isinstance(table, list) and isinstance(part, int) and part < len(table):
            table = table[part]
        else:
            return None
    return table


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
