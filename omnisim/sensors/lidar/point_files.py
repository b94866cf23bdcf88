"""Point cloud files: binary PLY and PCD."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.files.atomic_file import atomic_write
from omnisim.core.poses import quaternion_from_rotation
from omnisim.core.world import Pose

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
POINT = np.dtype([*_FIELDS.items(), ("intensity", "<f4"), ("return", "<u2")])
PLAIN_POINT = np.dtype(list(_FIELDS.items()))  # of older files: without intensities
_PLY_TYPES = {"<f4": "float", "<u2": "ushort", "<u4": "uint"}


def write_points(
    path: Path, points: NDArray[np.void], world_from_lidar: Pose, metadata: Mapping[str, Any]
) -> None:
    """Atomically write points (n,) of type `POINT` as .ply or .pcd, depending on the path's suffix.

    The header's comments are `key: value` lines of the metadata, with the values in JSON.

    Raises:
        OutputError: the file cannot be written.
        KeyError: any other suffix.
    """
    comments = [f"{key}: {json.dumps(value)}" for key, value in metadata.items()]
    content = FORMATS[path.suffix](points, world_from_lidar, comments) + points.tobytes()
    with atomic_write(path) as partial:
        partial.write_bytes(content)


def _ply_header(points: NDArray[np.void], world_from_lidar: Pose, comments: Sequence[str]) -> bytes:
    """Header of a PLY file. Source: Turk, The PLY Polygon File Format (1994)."""
    names = points.dtype.names or ()
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        *(f"comment {comment}" for comment in comments),
        f"element vertex {len(points)}",
        *(f"property {_PLY_TYPES[points.dtype[name].str]} {name}" for name in names),
        "end_header",
    ]
    return ("\n".join(lines) + "\n").encode("ascii")


def _pcd_header(points: NDArray[np.void], world_from_lidar: Pose, comments: Sequence[str]) -> bytes:
    """Header of a PCD file. Source: PCL, The PCD file format, version 0.7."""
    x, y, z, w = quaternion_from_rotation(world_from_lidar[None, :3, :3])[0]
    viewpoint = " ".join(f"{value:.9g}" for value in (*world_from_lidar[:3, 3], w, x, y, z))
    names, count = points.dtype.names or (), len(points)
    kinds = [points.dtype[name] for name in names]
    lines = [
        "# .PCD v0.7 - Point Cloud Data file format",
        *(f"# {comment}" for comment in comments),
        "VERSION 0.7",
        f"FIELDS {' '.join(names)}",
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


FORMATS = {".ply": _ply_header, ".pcd": _pcd_header}
