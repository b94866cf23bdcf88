"""Colored points as a PLY file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from omnisim.core.files.atomic_file import atomic_write
from omnisim.datasets.export.scene_points import ScenePoints

_FIELDS = {"x": "float", "y": "float", "z": "float", "red": "uchar", "green": "uchar",
           "blue": "uchar"}  # fmt: skip


def write_ply(path: Path, points: ScenePoints) -> None:
    """Write positions in meters and sRGB colors, binary.

    Raises:
        OutputError: the file cannot be written.

    Source: Turk, The PLY Polygon File Format (1994).
    """
    types = {"float": "<f4", "uchar": "u1"}
    records = np.empty(len(points), dtype=[(name, types[kind]) for name, kind in _FIELDS.items()])
    for index, axis in enumerate("xyz"):
        records[axis] = points.positions_m[:, index]
    for index, color in enumerate(("red", "green", "blue")):
        records[color] = points.colors[:, index]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
    header += [f"property {kind} {name}" for name, kind in _FIELDS.items()]
    text = "\n".join([*header, "end_header"]) + "\n"
    with atomic_write(path) as partial:
        partial.write_bytes(text.encode("ascii") + records.tobytes())
