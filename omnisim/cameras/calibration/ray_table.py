"""Ray tables: origin and direction of each pixel's ray, for users without the camera model.

An EXR file of 32-bit floats, one value for each pixel's center, first row at the top:

| channel | unit | |
| --- | --- | --- |
| direction.X, .Y, .Z | – | unit vector, optical frame: x right, y down, z forward |
| origin.X, .Y, .Z | m | a point that the ray passes through, same frame; 0 for central cameras |
| valid | 0 or 1 | the pixel sees something; where it is 0 the direction means nothing |

The file's attributes repeat this: `omnisim:frame`, `omnisim:unit`, `omnisim:pixel`. The camera
and its pose are in ImageDescription as JSON, as in omnisim's images. A
mirror that is drawn as a mesh has the exact mirror's rays here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, pixel_grid
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
BAND_PIXELS = 1 << 20  # computed at once, which bounds the memory of intermediate results
UNIT_TOLERANCE = 1e-5  # a hundred times a float's rounding


@dataclass(frozen=True, eq=False)
class RayTable:
    """The rays of an image's pixels.

    Attributes:
        directions: (height, width, 3) float32, unit vectors where valid, optical frame.
        origins_m: (height, width, 3) float32, points on the rays, optical frame.
        valid: (height, width) the pixel sees something.
        metadata: of the camera; empty without any in the file.
    """

    directions: NDArray[np.float32]
    origins_m: NDArray[np.float32]
    valid: NDArray[np.bool_]
    metadata: dict[str, Any]

    def __repr__(self) -> str:
        height, width = self.valid.shape
        return short_repr(self, f"{width} × {height} px")


def ray_table(camera: CentralCamera) -> RayTable:
    """Rays of all pixels of a camera."""
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
    """Write the rays of a camera.

    Args:
        path: of the EXR file.
        camera: the camera.
        metadata: more of it, such as the camera's pose.

    Raises:
        OutputError: another suffix, or a file that cannot be written; nothing is left of it then.
    """
    table = ray_table(camera)
    channels: dict[str, NDArray[Any]] = {}
    for at, axis in enumerate(AXES):
        channels[f"direction.{axis}"] = table.directions[..., at]
    for at, axis in enumerate(AXES):
        channels[f"origin.{axis}"] = table.origins_m[..., at]
    channels["valid"] = table.valid
    write_channels(Path(path), channels, {**(metadata or {}), **table.metadata}, ATTRIBUTES)


def read_ray_table(path: str | Path) -> RayTable:
    """Read a ray table, of omnisim or another program.

    Raises:
        OutputError: the file is missing or no EXR, or naming a channel that is missing or
            malformed.
    """
    path = Path(path)
    found = read_channels(path)
    directions, origins = (
        np.stack([_channel(path, found.values, f"{name}.{axis}") for axis in AXES], axis=-1)
        for name in ("direction", "origin")
    )
    valid = _channel(path, found.values, "valid") > 0.5
    rays = np.concatenate((directions, origins), axis=-1)[valid]
    lengths = np.linalg.norm(rays[:, :3].astype(np.float64), axis=-1)
    error = np.abs(lengths - 1.0).max(initial=0.0)
    if not (np.isfinite(rays).all() and error <= UNIT_TOLERANCE):
        raise OutputError(
            f"{path}: direction: expected unit vectors where valid is 1, got "
            + (
                f"an error of {error:.3g}"
                if math.isfinite(error)
                else "numbers that are not finite"
            )
        )
    return RayTable(directions, origins, valid, found.metadata or {})


def _channel(path: Path, values: dict[str, NDArray[np.float32]], name: str) -> NDArray[np.float32]:
    if name not in values:
        channels = ", ".join(sorted(values))
        raise OutputError(f"{path}: expected a ray table with a channel {name}, got {channels}")
    return values[name]
