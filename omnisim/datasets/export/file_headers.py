"""Headers of a run's tables and point clouds: `key: value` with JSON values."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import OmnisimError, RunError
from omnisim.core.poses import check_pose


class FileHeader:
    """Header of a file of a run.

    Args:
        path: path of the file, for messages.
        lines: lines `key: value`.
    """

    def __init__(self, path: Path, lines: Iterable[str]):
        self._path = path
        self._texts = {key: text for key, _, text in (line.partition(": ") for line in lines)}

    @property
    def values(self) -> dict[str, Any]:
        """Values by key, in the order of the file; lines without a value are left out.

        Raises:
            RunError: a value is damaged.
        """
        return {key: self.value(key) for key, text in self._texts.items() if text}

    def value(self, key: str) -> Any:
        """Value of a key.

        Raises:
            RunError: the value is missing or damaged.
        """
        try:
            return json.loads(self._texts[key])
        except (KeyError, ValueError, RecursionError):
            raise RunError(f"{self._path}: {key}: is missing or damaged: expected JSON") from None

    def number(self, key: str) -> float:
        """Number of a key.

        Raises:
            RunError: the value is missing, damaged, or not a number.
        """
        value = self.value(key)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise RunError(f"{self._path}: {key}: expected a number, got {value!r}")
        return float(value)

    def pose(self, key: str) -> NDArray[np.float64]:
        """Pose (4, 4) of a key.

        Raises:
            RunError: the value is missing, damaged, or not a pose.
        """
        try:
            return check_pose(self.value(key))
        except OmnisimError as reason:
            if isinstance(reason, RunError):
                raise
            raise RunError(f"{self._path}: {key}: {reason}") from None
