"""Ray tables: origin and direction of the ray of each pixel, for use without the camera model.

The file is an EXR of 32-bit floats, with one value per pixel center and the first row at the top:

| channel | unit | |
| --- | --- | --- |
| direction.X, .Y, .Z | – | unit vector, optical frame: x right, y down, z forward |
| origin.X, .Y, .Z | m | a point that the ray passes through, same frame; 0 for central cameras |
| valid | 0 or 1 | 1: the pixel sees something; 0: the direction is meaningless |

The file attributes `omnisim:frame`, `omnisim:unit` and `omnisim:pixel` repeat these conventions. As
in omnisim's images, ImageDescription holds the camera and its pose as JSON. For a mirror that is
rendered as a mesh, the table has the rays of the exact mirror.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, pixel_grid
from omnisim.core.arrays import Bools, Floats32
from omnisim.core.errors import OutputError
from omnisim.core.files.image_files import read_channels, write_channels
from omnisim.core.short_repr import short_repr
from omnisim.core.version import __version__

AXES = "XYZ"
ATTRIBUTES = {
    "omnisim:frame": "optical: x right, y down, z forward, or into the mirror",
    "omnisim:unit": "meters; directions are unit vectors",
    "omnisim:pixel": "a value is that of the pixel's center; the first row is the top one",
}
BAND_PIXELS = 1 << 20  # pixels computed at once, to bound the memory of intermediate results
UNIT_TOLERANCE = 1e-5  # a hundred times a float's rounding


@dataclass(frozen=True, eq=False)
class RayTable:
    """Rays of an image's pixels, optical frame, and the camera's metadata if the file has any."""

    directions: Floats32  # (height, width, 3) float32, unit vectors where valid
    origins_m: Floats32  # (height, width, 3) float32, points on the rays
    valid: Bools  # (height, width), True if the pixel sees something
    metadata: dict[str, Any]

    def __repr__(self) -> str:
        height, width = self.valid.shape
        return short_repr(self, f"{width} × {height} px")


def ray_table(camera: CentralCamera) -> RayTable:
    """Compute the rays of all pixels of a camera."""
    size = (camera.height_px, camera.width_px)
    directions = np.empty((*size, 3), dtype=np.float32)
    origins_m = np.zeros_like(directions)
    valid = np.empty(size, dtype=bool)
    step = max(1, BAND_PIXELS // camera.width_px)
    for first in range(0, camera.height_px, step):
        rows = slice(first, first + step)
        pixels = pixel_grid(camera.width_px, len(valid[rows])) + (0.0, first)
        rays = camera.ray_from_pixel(pixels)
        directions[rows], valid[rows] = rays.directions, rays.valid
        if rays.origins_m is not None:
            origins_m[rows] = rays.origins_m
    metadata = {"omnisim": __version__, "camera": camera.parameters()}
    return RayTable(directions, origins_m, valid, metadata)


def write_ray_table(
    path: str | Path, camera: CentralCamera, metadata: dict[str, Any] | None = None
) -> None:
    """Write the rays of a camera to an EXR file, with metadata such as the camera's pose.

    Raises:
        OutputError: the suffix is not EXR's, or the file cannot be written; no partial file is
            left.
    """
    table = ray_table(camera)
    channels: dict[str, NDArray[Any]] = {}
    for name, values in (("direction", table.directions), ("origin", table.origins_m)):
        channels |= {f"{name}.{axis}": values[..., at] for at, axis in enumerate(AXES)}
    channels["valid"] = table.valid
    write_channels(Path(path), channels, {**(metadata or {}), **table.metadata}, ATTRIBUTES)


def read_ray_table(path: str | Path) -> RayTable:
    """Read a ray table written by omnisim or another program.

    Raises:
        OutputError: the file is missing or not an EXR, or a channel is missing or malformed; the
            message names it.
    """
    path = Path(path)
    data = read_channels(path)
    directions, origins = (
        np.stack([_channel(path, data.values, f"{name}.{axis}") for axis in AXES], axis=-1)
        for name in ("direction", "origin")
    )
    valid = _channel(path, data.values, "valid") > 0.5
    rays = np.concatenate((directions, origins), axis=-1)[valid]
    lengths = np.linalg.norm(rays[:, :3].astype(np.float64), axis=-1)
    error = np.abs(lengths - 1.0).max(initial=0.0)
    if not (np.isfinite(rays).all() and error <= UNIT_TOLERANCE):
        got = f"an error of {error:.3g}" if math.isfinite(error) else "numbers that are not finite"
        raise OutputError(f"{path}: direction: expected unit vectors where valid is 1, got {got}")
    return RayTable(directions, origins, valid, data.metadata or {})


def _channel(path: Path, values: dict[str, Floats32], name: str) -> Floats32:
    if name not in values:
        channels = ", ".join(sorted(values))
        raise OutputError(f"{path}: expected a ray table with a channel {name}, got {channels}")
    return values[name]
