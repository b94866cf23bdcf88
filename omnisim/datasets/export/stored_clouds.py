"""Stored clouds and scans of a run; a missing or damaged file or value raises `RunError`."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats, Floats32
from omnisim.core.errors import OmnisimError, RunError
from omnisim.core.poses import check_pose
from omnisim.sensors.lidar.point_files import PLAIN_POINT, POINT


class FileHeader:
    """Header of a file of a run: lines `key: value`, and its path for messages."""

    def __init__(self, path: Path, lines: Iterable[str]):
        self._path = path
        self._texts = {key: text for key, _, text in (line.partition(": ") for line in lines)}

    @property
    def values(self) -> dict[str, Any]:
        """Values by key, in the order of the file; lines without a value are left out."""
        return {key: self.value(key) for key, text in self._texts.items() if text}

    def value(self, key: str) -> Any:
        """Value of a key."""
        try:
            return json.loads(self._texts[key])
        except (KeyError, ValueError, RecursionError):
            raise RunError(f"{self._path}: {key}: is missing or damaged: expected JSON") from None

    def number(self, key: str) -> float:
        """Number of a key."""
        value = self.value(key)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise RunError(f"{self._path}: {key}: expected a number, got {value!r}")
        return float(value)

    def pose(self, key: str) -> Floats:
        """Pose (4, 4) of a key."""
        try:
            return check_pose(self.value(key))
        except OmnisimError as reason:
            if isinstance(reason, RunError):
                raise
            raise RunError(f"{self._path}: {key}: {reason}") from None


# Point clouds of a run's lidars, read from PLY and PCD files.


_ENDS = {".ply": b"end_header\n", ".pcd": b"DATA binary\n"}
_COMMENTS = {".ply": "comment ", ".pcd": "# "}
_COUNTS = {".ply": "element vertex ", ".pcd": "POINTS "}


@dataclass(frozen=True, eq=False)
class StoredCloud:
    """Point cloud of a revolution, with parameters and poses of the lidar in its header.

    Points (n,) are of type `POINT`, or `PLAIN_POINT` in older runs, of
    `omnisim.sensors.lidar.point_files`.
    """

    header: FileHeader
    points: NDArray[np.void]

    @property
    def points_m(self) -> Floats:
        """Points (n, 3) in the lidar's frame at each point's own time."""
        return np.stack([self.points[axis] for axis in "xyz"], axis=-1).astype(np.float64)

    @property
    def reflectances(self) -> Floats32:
        """Intensities (n,), at most 1; 0 without intensities."""
        if self.points.dtype != POINT:
            return np.zeros(len(self.points), dtype=np.float32)
        return np.minimum(self.points["intensity"], np.float32(1.0))


def read_cloud(path: Path) -> StoredCloud:
    """Read a point cloud written by `PointCloud.save`."""
    try:
        content = path.read_bytes()
    except OSError as reason:
        raise RunError(f"{path}: cannot be read: {reason.strerror}") from None
    head, end, data = content.partition(_ENDS[path.suffix])
    lines = head.decode("utf-8", errors="replace").splitlines()
    counts = [line.removeprefix(_COUNTS[path.suffix]) for line in lines if
              line.startswith(_COUNTS[path.suffix])]  # fmt: skip
    count = int(counts[0]) if counts and counts[0].isdecimal() else -1
    kind = POINT if any("intensity" in line.split() for line in lines) else PLAIN_POINT
    if not end or len(data) != count * kind.itemsize:
        raise RunError(f"{path}: is damaged: expected a point cloud as a drive writes it")
    comment = _COMMENTS[path.suffix]
    comments = [line.removeprefix(comment) for line in lines if line.startswith(comment)]
    return StoredCloud(FileHeader(path, comments), np.frombuffer(data, dtype=kind))


# Tables of a run's sensors, read back: laser scans, ranges, IMU readings.


MAX_NUMBER = 1e30  # within the range of the formats' floats


@dataclass(frozen=True, eq=False)
class StoredTable:
    """Table of a sensor: parameters and pose of the sensor, and values (n,) by column."""

    header: FileHeader
    columns: dict[str, Floats]


def read_table(path: Path, *names: str) -> StoredTable:
    """Read a table with the given columns."""
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
