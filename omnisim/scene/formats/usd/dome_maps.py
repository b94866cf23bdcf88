"""Textures of dome lights as environment maps.

Source: OpenUSD, previewSurface of Hydra Storm, projectToLatLong: the map's center is the dome's +z,
with +x to the left and +y at the top.
"""

from __future__ import annotations

import tempfile
from pathlib import Path, PurePosixPath

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf

from omnisim.core.errors import OutputError
from omnisim.core.files.image_files import read_image, read_radiance
from omnisim.core.srgb import linear_from_srgb8
from omnisim.scene.formats.usd.shading.texture_files import content_of
from omnisim.scene.light.environment import coordinates_of, lookup, map_directions

MAX_ROWS = 2048
ROWS_AT_ONCE = 64  # limits memory use
MAX_RADIANCE = 1e9
_DISPLAY = (".png", ".jpg", ".jpeg")  # formats whose 8-bit values are sRGB
_LAT_LONG = ("", "automatic", "latlong")
# Axes of omnisim's maps: +x in the center, +y to the left.
_DOME_FROM_MAP = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


def dome_map(
    texture: Sdf.AssetPath, layout: str, world_from_dome: NDArray[np.float64]
) -> NDArray[np.float32] | None:
    """Radiance (rows, 2 rows, 3) of a dome's texture in world axes; None: unreadable or
    unsupported.

    Args:
        texture: texture file of the light.
        layout: `texture:format` of the light.
        world_from_dome: (3, 3) axes of the light, of any length.
    """
    axes, _, turned = np.linalg.svd(world_from_dome)
    rotation = axes @ turned
    if layout not in _LAT_LONG or not np.isfinite(rotation).all():
        return None
    pixels = _read(texture.resolvedPath)
    if pixels is None or min(pixels.shape[:2]) < 2:
        return None
    rows = min(max(pixels.shape[0], 2), MAX_ROWS)
    directions, _ = map_directions(rows, 2 * rows)
    parts = []
    for first in range(0, rows, ROWS_AT_ONCE):
        part = directions[first : first + ROWS_AT_ONCE].reshape(-1, 3)
        parts.append(lookup(pixels, coordinates_of(part @ rotation @ _DOME_FROM_MAP)))
    return np.concatenate(parts).reshape(rows, 2 * rows, 3)


def mean_radiance(pixels: NDArray[np.float32]) -> NDArray[np.float64]:
    """Mean (3,) of a map over all directions."""
    _, solid_angles = map_directions(*pixels.shape[:2])
    mean: NDArray[np.float64] = np.average(pixels.mean(axis=1), axis=0, weights=solid_angles)
    return mean


def _read(resolved: str) -> NDArray[np.float32] | None:
    """Linear RGB (height, width, 3) of a file or package member; None: unreadable."""
    try:
        data = content_of(resolved)
    except OSError:
        return None
    suffix = PurePosixPath(resolved.rstrip("]")).suffix.lower()
    if not data or not suffix.isascii() or not suffix[1:].isalnum():
        return None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"map{suffix}")
        path.write_bytes(data)
        try:
            if suffix not in _DISPLAY:
                radiance = read_radiance(path)
            else:
                stored, _ = read_image(path)
                if stored.dtype != np.uint8 or stored.shape[2] < 3:
                    return None
                radiance = linear_from_srgb8(stored[..., :3])
        except OutputError:
            return None
    return np.clip(np.nan_to_num(radiance, posinf=MAX_RADIANCE), 0.0, MAX_RADIANCE)
