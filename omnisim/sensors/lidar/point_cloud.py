"""Point clouds of lidars, and their files: PLY and PCD, both binary."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.files.atomic_file import atomic_write
from omnisim.core.poses import quaternion_from_rotation
from omnisim.core.short_repr import short_repr
from omnisim.sensors.lidar.spinning_lidar import SpinningLidar

_FIELDS = {
    "x": "<f4",
    "y": "<f4",
    "z": "<f4",
    "ring": "<u2",
    "time": "<f4",
    "azimuth": "<f4",
    "range": "<f4",
    "instance": "<u4",
}
POINT = np.dtype(list(_FIELDS.items()))
_PLY_TYPES = {"<f4": "float", "<u2": "ushort", "<u4": "uint"}


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Points of one revolution, in the order in which they are measured.

    Attributes:
        points: (n,) of `POINT`: meters in the lidar's frame at each point's own time, number of the
            ring, seconds since the revolution's start, azimuth in radians counter-clockwise, range
            in meters, and ID of the instance as ground truth has it.
        lidar: that took it.
        world_from_lidar_at_start, world_from_lidar: (4, 4) its poses at the revolution's start and
            end.
        metadata: omnisim's version, the scene, number and end of the revolution.
    """

    points: NDArray[np.void]
    lidar: SpinningLidar
    world_from_lidar_at_start: NDArray[np.float64]
    world_from_lidar: NDArray[np.float64]
    metadata: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        return short_repr(self, f"{len(self.points)} points", f"{self.lidar.rings} rings")

    @property
    def points_m(self) -> NDArray[np.float32]:
        """Points (n, 3) in the lidar's frame at each one's own time."""
        return np.stack([self.points[axis] for axis in "xyz"], axis=-1)

    def save(self, path: str | Path) -> None:
        """Write the cloud by its suffix, .ply or .pcd; the file is written atomically.

        Comments of the header hold `key: value` with the value in JSON: the metadata, the lidar's
        parameters, and its poses by rows.

        Raises:
            OutputError: the file cannot be written.
            KeyError: another suffix.
        """
        target = Path(path)
        content = FORMATS[target.suffix](self) + self.points.tobytes()
        with atomic_write(target) as partial:
            partial.write_bytes(content)

    def _comments(self) -> list[str]:
        header = {
            **self.metadata,
            **dataclasses.asdict(self.lidar),
            "world_from_lidar_at_start": self.world_from_lidar_at_start.tolist(),
            "world_from_lidar": self.world_from_lidar.tolist(),
        }
        return [f"{key}: {json.dumps(value)}" for key, value in header.items()]


def make_points(
    lidar: SpinningLidar, ranges_m: NDArray[np.float64], instances: NDArray[np.uint32]
) -> NDArray[np.void]:
    """Points (n,) of measured ranges (rings, firings), +inf for none, and of instances."""
    firings, rings = np.nonzero(np.isfinite(ranges_m.T))
    points = np.empty(len(rings), dtype=POINT)
    ranges = ranges_m[rings, firings]
    xyz = ranges[:, None] * lidar.beams.directions[rings, firings]
    for axis, values in zip("xyz", xyz.T, strict=True):
        points[axis] = values
    points["ring"], points["range"] = rings, ranges
    points["time"], points["azimuth"] = lidar.times_s[firings], lidar.azimuths_rad[firings]
    points["instance"] = instances[rings, firings]
    return points


def _ply_header(cloud: PointCloud) -> bytes:
    """Header of a PLY file. Source: Turk, The PLY Polygon File Format (1994)."""
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        *(f"comment {comment}" for comment in cloud._comments()),
        f"element vertex {len(cloud.points)}",
        *(f"property {_PLY_TYPES[kind]} {name}" for name, kind in _FIELDS.items()),
        "end_header",
    ]
    return ("\n".join(lines) + "\n").encode("ascii")


def _pcd_header(cloud: PointCloud) -> bytes:
    """Header of a PCD file. Source: PCL, The PCD file format, version 0.7."""
    count = len(cloud.points)
    pose = cloud.world_from_lidar
    x, y, z, w = quaternion_from_rotation(pose[None, :3, :3])[0]
    viewpoint = " ".join(f"{value:.9g}" for value in (*pose[:3, 3], w, x, y, z))
    kinds = [np.dtype(kind) for kind in _FIELDS.values()]
    lines = [
        "# .PCD v0.7 - Point Cloud Data file format",
        *(f"# {comment}" for comment in cloud._comments()),
        "VERSION 0.7",
        f"FIELDS {' '.join(_FIELDS)}",
        f"SIZE {' '.join(str(kind.itemsize) for kind in kinds)}",
        f"TYPE {' '.join(kind.kind.upper() for kind in kinds)}",
        f"COUNT {' '.join('1' for _ in kinds)}",
        f"WIDTH {count}",
        "HEIGHT 1",
        f"VIEWPOINT {viewpoint}",
        f"POINTS {count}",
        "DATA binary",
    ]
    return ("\n".join(lines) + "\n").encode("ascii")


FORMATS: dict[str, Callable[[PointCloud], bytes]] = {".ply": _ply_header, ".pcd": _pcd_header}
