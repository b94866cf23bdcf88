"""Point clouds of a run's lidars, read from PLY and PCD files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import RunError
from omnisim.datasets.export.file_headers import FileHeader
from omnisim.sensors.lidar.point_files import ECHO_POINT, POINT

_ENDS = {".ply": b"end_header\n", ".pcd": b"DATA binary\n"}
_COMMENTS = {".ply": "comment ", ".pcd": "# "}
_COUNTS = {".ply": "element vertex ", ".pcd": "POINTS "}


@dataclass(frozen=True, eq=False)
class StoredCloud:
    """Point cloud of a revolution.

    Attributes:
        header: parameters and poses of the lidar.
        points: (n,) records of type `POINT` or `ECHO_POINT` of
            `omnisim.sensors.lidar.point_files`.
    """

    header: FileHeader
    points: NDArray[np.void]

    @property
    def points_m(self) -> NDArray[np.float64]:
        """Points (n, 3) in the lidar's frame at each point's own time."""
        return np.stack([self.points[axis] for axis in "xyz"], axis=-1).astype(np.float64)

    @property
    def reflectances(self) -> NDArray[np.float32]:
        """Intensities (n,), at most 1; 0 without intensities."""
        if self.points.dtype != ECHO_POINT:
            return np.zeros(len(self.points), dtype=np.float32)
        reflectances: NDArray[np.float32] = np.minimum(self.points["intensity"], np.float32(1.0))
        return reflectances


def read_cloud(path: Path) -> StoredCloud:
    """Read a point cloud written by `PointCloud.save`.

    Raises:
        RunError: the file cannot be read, was written by another program, or is damaged.
    """
    try:
        content = path.read_bytes()
    except OSError as reason:
        raise RunError(f"{path}: cannot be read: {reason.strerror}") from None
    head, end, data = content.partition(_ENDS[path.suffix])
    lines = head.decode("utf-8", errors="replace").splitlines()
    counts = [line.removeprefix(_COUNTS[path.suffix]) for line in lines if
              line.startswith(_COUNTS[path.suffix])]  # fmt: skip
    count = int(counts[0]) if counts and counts[0].isdecimal() else -1
    kind = ECHO_POINT if any("intensity" in line.split() for line in lines) else POINT
    if not end or len(data) != count * kind.itemsize:
        raise RunError(f"{path}: is damaged: expected a point cloud as a drive writes it")
    comment = _COMMENTS[path.suffix]
    comments = [line.removeprefix(comment) for line in lines if line.startswith(comment)]
    return StoredCloud(FileHeader(path, comments), np.frombuffer(data, dtype=kind))
