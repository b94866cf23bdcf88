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
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage
from scipy.spatial import KDTree

from omnisim.cameras import CentralCamera, Pixels, Rays, pixel_grid
from omnisim.cameras.calibration.documents import MAX_SIZE_PX
from omnisim.cameras.camera import Uniforms, as_directions, as_pixels
from omnisim.cameras.parametric_camera import ParametricCamera, PrincipalPoint
from omnisim.core.arrays import Bools, Floats, Floats32
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
RIM = 5  # pixels within which a spline feels that there is no ray
PAD = 7  # pixels beyond the border, into which the splines are extrapolated
NEWTON_STEPS = 8  # from the nearest pixel
MIN_SIDE = 8  # pixels of a table that a lens can be fitted to
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


# Tables of other programs, as lenses that are read as the nearest model.

EXR_CHANNELS = (tuple(f"direction.{axis}" for axis in AXES), tuple(AXES), tuple("RGB"))
CSV_HEADER = "u,v,x,y,z"


@dataclass(frozen=True, eq=False)
class TableLens(ParametricCamera):
    """Lens by the rays of its pixels' centers, with cubic splines in between.

    Domain: between the centers of valid pixels, at least `RIM` pixels from invalid ones.
    """

    principal_point_px: PrincipalPoint
    model_name = "ray_table"
    __eq__, __hash__ = object.__eq__, object.__hash__  # rays are no fields

    @classmethod
    def of(cls, directions: Floats, valid: Bools) -> TableLens:
        """Lens with rays (height, width, 3) where `valid` (height, width)."""
        nearest = ndimage.distance_transform_edt(
            ~valid, return_distances=False, return_indices=True
        )
        filled = directions[tuple(nearest)]
        v, u = np.unravel_index(int(np.argmax(filled[..., 2])), valid.shape)
        lens = cls(valid.shape[1], valid.shape[0], (float(u), float(v)))
        wide = np.pad(filled, ((PAD, PAD), (PAD, PAD), (0, 0)), "reflect", reflect_type="odd")
        splines = [ndimage.spline_filter(wide[..., axis], mode="mirror") for axis in range(3)]
        object.__setattr__(lens, "_splines", splines)
        inner = ndimage.binary_erosion(valid, iterations=RIM, border_value=1)
        object.__setattr__(lens, "_valid", inner.astype(np.uint8))
        return lens

    def ray_from_pixel(self, pixels_px: ArrayLike) -> Rays:
        """Rays of pixels (..., 2): unit directions in the optical frame; valid in the domain."""
        pixels = as_pixels(pixels_px)
        u, v = pixels.reshape(-1, 2).T
        splines: list[Floats] = getattr(self, "_splines")  # noqa: B009  no field of the dataclass
        at = np.stack((v + PAD, u + PAD))
        directions = np.stack(
            [ndimage.map_coordinates(s, at, prefilter=False, mode="mirror") for s in splines],
            axis=-1,
        )
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        inside = (u >= 0.0) & (u <= self.width_px - 1.0) & (v >= 0.0) & (v <= self.height_px - 1.0)
        seen = ndimage.map_coordinates(getattr(self, "_valid"), (v, u), order=0, mode="nearest")  # noqa: B009
        shape = pixels.shape[:-1]
        return Rays(directions.reshape(*shape, 3), (inside & (seen > 0)).reshape(shape))

    @cached_property
    def _nearest(self) -> tuple[KDTree, Floats]:
        """Search tree of the rays of valid pixels, and these pixels (n, 2)."""
        pixels = pixel_grid(self.width_px, self.height_px).reshape(-1, 2)
        rays = self.ray_from_pixel(pixels)
        return KDTree(rays.directions[rays.valid]), pixels[rays.valid]

    def pixel_from_ray(self, directions: ArrayLike) -> Pixels:
        """Pixels of directions (..., 3), by Newton's method from the pixel with the nearest ray."""
        rays = as_directions(directions)
        rays = rays / np.maximum(np.linalg.norm(rays, axis=-1, keepdims=True), 1e-300)
        tree, pixels = self._nearest
        found = pixels[tree.query(rays)[1]]
        for _ in range(NEWTON_STEPS):
            sides = (
                self.ray_from_pixel(found + step).directions
                - self.ray_from_pixel(found - step).directions
                for step in (0.25 * np.eye(2))
            )
            jacobian = 2.0 * np.stack(tuple(sides), axis=-1)  # (..., 3, 2)
            error = (rays - self.ray_from_pixel(found).directions)[..., None]
            found = found + np.clip((np.linalg.pinv(jacobian) @ error)[..., 0], -1.0, 1.0)
        seen = self.ray_from_pixel(found)
        off = np.abs(seen.directions - rays).max(axis=-1)
        return Pixels(found, seen.valid & (off < UNIT_TOLERANCE))

    def uniforms(self) -> Uniforms:
        """Nothing: a table has no GLSL twin. The model that is fitted to it is drawn."""
        return {}


def read_table_lens(path: Path) -> tuple[TableLens, bool]:
    """Read rays per pixel from an EXR with three channels, or a CSV with the columns u, v, x, y, z.

    Rays of any length but 0 are valid, unless the EXR has a channel `valid`.

    Returns:
        The lens, and True if it looks into a mirror: its z is then that of a lens.

    Raises:
        OutputError: the file is missing or malformed.
    """
    valid: Bools
    if path.suffix.lower() == ".csv":
        rays = _csv_rays(path)
        valid = np.ones(rays.shape[:2], dtype=bool)
    else:
        values = read_channels(path).values
        names = next((names for names in EXR_CHANNELS if set(names) <= values.keys()), None)
        if names is None:
            expected = " or ".join(", ".join(names) for names in EXR_CHANNELS)
            raise OutputError(f"{path}: expected channels {expected}, got {', '.join(values)}")
        rays = np.stack([values[name] for name in names], axis=-1).astype(np.float64)
        valid = values["valid"] > 0.5 if "valid" in values else np.ones(rays.shape[:2], dtype=bool)
    lengths = np.linalg.norm(rays, axis=-1)
    valid = valid & np.isfinite(lengths) & (lengths > 0.0)
    if min(valid.shape) < MIN_SIDE or valid.sum() < MIN_SIDE**2:
        raise OutputError(f"{path}: expected at least {MIN_SIDE} × {MIN_SIDE} pixels with a ray")
    directions = np.where(valid[..., None], rays, 0.0) / np.where(valid, lengths, 1.0)[..., None]
    height, width = valid.shape
    sign = -1.0 if directions[height // 2][width // 2][2] < 0.0 else 1.0
    return TableLens.of(directions * (1.0, 1.0, sign), valid), sign < 0.0


def _csv_rays(path: Path) -> Floats:
    """Rays (height, width, 3) of a CSV; 0 where a pixel has no row."""
    try:
        with path.open(encoding="utf-8") as file:
            header = file.readline().replace(" ", "").strip().lower()
            if header != CSV_HEADER:
                raise OutputError(f"{path}: expected the header {CSV_HEADER}, got {header[:60]}")
            rows = np.loadtxt(file, delimiter=",", ndmin=2)
    except (OSError, ValueError) as reason:
        raise OutputError(f"{path}: expected rows of u, v, x, y, z: {reason}") from None
    pixels = rows[:, :2].astype(np.int64)
    if rows.shape[1] != 5 or (pixels != rows[:, :2]).any() or not 0 <= pixels.min() <= MAX_SIZE_PX:
        raise OutputError(f"{path}: expected whole u and v from 0, and three numbers of a ray")
    if pixels.max() >= MAX_SIZE_PX:
        raise OutputError(f"{path}: expected pixels below {MAX_SIZE_PX}, got {pixels.max()}")
    width, height = pixels.max(axis=0) + 1
    rays = np.zeros((height, width, 3))
    rays[pixels[:, 1], pixels[:, 0]] = rows[:, 2:]
    return rays


def _channel(path: Path, values: dict[str, Floats32], name: str) -> Floats32:
    if name not in values:
        channels = ", ".join(sorted(values))
        raise OutputError(f"{path}: expected a ray table with a channel {name}, got {channels}")
    return values[name]
