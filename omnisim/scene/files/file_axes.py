"""Up axis and unit of mesh files."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import SceneError
from omnisim.scene.files.scene_file import SceneFile

_WORLD_FROM_UP_AXIS = {
    "x": np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]]),  # COLLADA: right −y, up x, inward z
    "y": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "z": np.eye(3),
}
# For formats that do not fix it: the assumption of Blender's importers. All others: z.
_UP_AXIS_OF_FORMAT = {".glb": "y", ".gltf": "y", ".obj": "y"}
_METERS_OF_FORMAT = {".3mf": 0.001}  # 3MF's default unit; all others: 1


class FileAxes(NamedTuple):
    """Up axis and unit that override those of a file; None: no override."""

    up_axis: str | None = None
    meters_per_unit: float | None = None


def axes_overrides(settings: SceneFile, axes: FileAxes) -> FileAxes:
    """Overrides for a file, from `axes` or else from `settings`."""
    unit = settings.meters_per_unit if axes.meters_per_unit is None else axes.meters_per_unit
    return FileAxes(axes.up_axis or settings.up_axis, unit)


def world_from_file(suffix: str, data: bytes, axes: FileAxes) -> NDArray[np.float64]:
    """Transform (4, 4) from a file's axes and unit to the world frame.

    `axes` override the file's values, which override those of its format.
    """
    axis = _UP_AXIS_OF_FORMAT.get(suffix, "z")
    unit = _METERS_OF_FORMAT.get(suffix, 1.0)
    if suffix == ".dae":
        axis, unit = _collada(data)
    return world_from_axes(
        axes.up_axis or axis, unit if axes.meters_per_unit is None else axes.meters_per_unit
    )


def world_from_axes(up_axis: str, meters_per_unit: float) -> NDArray[np.float64]:
    """Transform (4, 4) to the world frame from a frame with the given up axis and unit.

    Raises:
        SceneError: an axis other than x, y and z, or an invalid unit.
    """
    if up_axis not in _WORLD_FROM_UP_AXIS:
        raise SceneError(f"up axis: expected x, y or z, got {up_axis!r}")
    if not 0.0 < meters_per_unit < math.inf:
        raise SceneError(f"meters_per_unit: expected a number > 0, got {meters_per_unit!r}")
    matrix = np.eye(4)
    matrix[:3, :3] = _WORLD_FROM_UP_AXIS[up_axis] * meters_per_unit
    return matrix


def _collada(data: bytes) -> tuple[str, float]:
    """Up axis and unit in COLLADA's <asset>, which trimesh does not apply."""
    axis_match = re.search(rb"<up_axis>\s*([XYZ])_UP\s*</up_axis>", data)
    axis = axis_match[1].decode().lower() if axis_match else "y"
    stated = re.search(rb"<unit\b[^>]*\bmeter\s*=\s*[\"']([^\"']*)[\"']", data)
    if stated is None:
        return axis, 1.0
    text = stated[1].decode("utf-8", "replace")
    try:
        unit = float(text)
    except ValueError:
        unit = math.nan
    if not (math.isfinite(unit) and unit > 0.0):
        raise SceneError(f"<unit meter>: expected a number > 0, got {text!r}")
    return axis, unit
