"""Environment maps: distant light for matte and glossy surfaces.

Directions are unit vectors in world axes. A map's columns run clockwise, seen from above: the
center column is the world's +x, and +y is a quarter of the width to its left. The first row is
straight up.
Source: Ramamoorthi and Hanrahan, "An efficient representation for irradiance environment maps",
2001; Karis, "Real shading in Unreal Engine 4", 2013.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats, Floats32
from omnisim.core.short_repr import short_repr

# Filtered map: one level per roughness step, each with half as many rows as the previous one.
FILTERED_ROWS, FILTERED_LEVELS = 256, 6
_SAMPLES = 128


@dataclass(frozen=True, eq=False)
class Environment:
    """Environment map of distant light."""

    # (height, width, 3) float32, linear RGB in display brightness; width is twice the height
    radiance: Floats32

    def __repr__(self) -> str:
        height, width = self.radiance.shape[:2]
        return short_repr(self, f"{width} × {height} px")

    def scaled(self, factor: float) -> Environment:
        """Map with its radiance multiplied by a factor."""
        return Environment((factor * self.radiance).astype(np.float32))

    @cached_property
    def irradiance(self) -> Floats:
        """Light on white surfaces: coefficients (9, 3) of the terms of `spherical_harmonics`."""
        pixels = _halved_to(self.radiance, 128).astype(np.float64)
        directions, weights = map_directions(*pixels.shape[:2])
        shares = spherical_harmonics(directions.reshape(-1, 3))
        return factors_of_moments(shares.T @ (pixels * weights[:, None, None]).reshape(-1, 3))

    @cached_property
    def filtered(self) -> tuple[Floats32, ...]:
        """Levels (height, width, 3) of the map, one per roughness step from 0 to 1."""
        first = _halved_to(self.radiance, FILTERED_ROWS)
        pyramid = _pyramid(first)
        steps = range(1, FILTERED_LEVELS)
        return first, *(
            _filtered(pyramid, first.shape[0] >> step, step / (FILTERED_LEVELS - 1))
            for step in steps
        )

    def ambient(self, normals: NDArray[np.floating]) -> Floats:
        """Light (n, 3) on white surfaces with unit normals (n, 3)."""
        return np.maximum(spherical_harmonics(normals) @ self.irradiance, 0.0)

    def light(self, directions: NDArray[np.floating], roughness: NDArray[np.floating]) -> Floats32:
        """Radiance (n, 3) in directions (n, 3), filtered for roughnesses (n,) in [0, 1]."""
        steps = np.asarray(roughness, dtype=np.float64) * (FILTERED_LEVELS - 1)
        return _between_levels(self.filtered, coordinates_of(directions), steps)

    @cached_property
    def pyramid(self) -> tuple[Floats32, ...]:
        """Mip pyramid of the map: each level has half the rows and columns of the previous one."""
        return tuple(_pyramid(self.radiance))

    def seen(
        self, directions: NDArray[np.floating], widths_rad: NDArray[np.floating] | None = None
    ) -> Floats32:
        """Radiance (n, 3) in directions (n, 3), averaged over widths (n,); None: not averaged."""
        uv = coordinates_of(directions)
        if widths_rad is None:
            return lookup(self.radiance, uv)
        texels = np.maximum(widths_rad, 1e-12) * (self.radiance.shape[0] / np.pi)
        return _between_levels(self.pyramid, uv, np.maximum(np.log2(texels), 0.0))


# Per polynomial: squared normalization constant times the cosine lobe's coefficient of its order,
# divided by pi.
_FACTORS = np.array(
    [
        1.0 / (4.0 * np.pi), *[2.0 / 3.0 * 3.0 / (4.0 * np.pi)] * 3,
        *[0.25 * 15.0 / (4.0 * np.pi)] * 2, 0.25 * 5.0 / (16.0 * np.pi),
        0.25 * 15.0 / (4.0 * np.pi), 0.25 * 15.0 / (16.0 * np.pi),
    ]
)  # fmt: skip


def factors_of_moments(moments: Floats) -> Floats:
    """Coefficients (..., 9, 3) of light on white surfaces, from moments of the radiance."""
    return moments * _FACTORS[:, None]


def spherical_harmonics(normals: NDArray[np.floating]) -> Floats:
    """Unnormalized spherical harmonics (n, 9) up to order 2, of unit vectors (n, 3)."""
    x, y, z = np.asarray(normals, dtype=np.float64).T
    return np.stack(
        (np.ones_like(x), y, z, x, x * y, y * z, 3.0 * z * z - 1.0, x * z, x * x - y * y), axis=-1
    )


def coordinates_of(directions: NDArray[np.floating]) -> Floats:
    """Texture coordinates (n, 2) of unit vectors (n, 3) in an environment map."""
    x, y, z = np.asarray(directions, dtype=np.float64).T
    across = 0.5 - np.arctan2(y, x) / (2.0 * np.pi)
    return np.stack((across, np.arccos(np.clip(z, -1.0, 1.0)) / np.pi), axis=-1)


def lookup(pixels: Floats32, uv: Floats) -> Floats32:
    """Bilinear lookup (n, 3) in a map at texture coordinates (n, 2)."""
    height, width = pixels.shape[:2]
    column, row = uv[:, 0] * width - 0.5, uv[:, 1] * height - 0.5
    left, top = np.floor(column).astype(np.intp), np.floor(row).astype(np.intp)
    right_share = (column - left).astype(np.float32)[:, None]
    down_share = (row - top).astype(np.float32)[:, None]
    columns = left % width, (left + 1) % width
    rows = np.clip(top, 0, height - 1), np.clip(top + 1, 0, height - 1)
    upper, lower = (
        pixels[row, columns[0]] * (1 - right_share) + pixels[row, columns[1]] * right_share
        for row in rows
    )
    return upper * (1 - down_share) + lower * down_share


def _between_levels(
    levels: tuple[Floats32, ...], uv: Floats, steps: NDArray[np.floating]
) -> Floats32:
    """Values (n, 3) at texture coordinates (n, 2), interpolated between levels at steps (n,)."""
    steps = np.minimum(steps, len(levels) - 1)
    total = np.zeros((len(uv), 3), dtype=np.float32)
    for level, pixels in enumerate(levels):
        weights = np.maximum(1.0 - np.abs(steps - level), 0.0)
        selected = np.flatnonzero(weights)
        if len(selected):
            total[selected] += weights[selected, None] * lookup(pixels, uv[selected])
    return total


def map_directions(height: int, width: int) -> tuple[Floats, Floats]:
    """Directions (height, width, 3) of a map's pixels, and solid angles (height,) per row."""
    azimuth = 2.0 * np.pi * (0.5 - (np.arange(width) + 0.5) / width)[None]
    polar = np.pi * (np.arange(height) + 0.5)[:, None] / height
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    x, y, z = np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)
    directions = np.stack(np.broadcast_arrays(x, y, z), axis=-1)
    return directions, (edges[:-1] - edges[1:]) * 2.0 * np.pi / width


def _halved_to(pixels: Floats32, rows: int) -> Floats32:
    """Map (rows, 2 rows, 3), halved while it is larger, then resampled."""
    while pixels.shape[0] > rows and pixels.shape[0] % 2 == 0 and pixels.shape[1] % 2 == 0:
        pixels = _halved(pixels)
    if pixels.shape[:2] == (rows, 2 * rows):
        return pixels
    down, across = (np.arange(rows) + 0.5) / rows, (np.arange(2 * rows) + 0.5) / (2 * rows)
    uv = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    return lookup(pixels, uv).reshape(rows, 2 * rows, 3)


def _halved(pixels: Floats32) -> Floats32:
    """Means (rows/2, columns/2, 3) of 2 × 2 pixels by solid angle; odd last rows are dropped."""
    height, width = (size // 2 * 2 for size in pixels.shape[:2])
    pixels = pixels[:height, :width]
    weights = map_directions(height, width)[1].astype(np.float32)[:, None, None]
    rows = (pixels * weights).reshape(height // 2, 2, width, 3).sum(axis=1)
    rows /= weights.reshape(height // 2, 2, 1, 1).sum(axis=1)
    return 0.5 * (rows[:, 0::2] + rows[:, 1::2])


def _pyramid(pixels: Floats32) -> list[Floats32]:
    pyramid = [pixels]
    while pyramid[-1].shape[0] > 2:
        pyramid.append(_halved(pyramid[-1]))
    return pyramid


def _filtered(pyramid: list[Floats32], rows: int, roughness: float) -> Floats32:
    """Map (rows, 2 rows, 3) of the light reflected at a given roughness, seen along the normal.

    Each GGX half vector samples the pyramid level whose pixels match its share of the lobe.
    Source: Křivánek and Colbert, "Real-time shading with filtered importance sampling", 2008.
    """
    normals = map_directions(rows, 2 * rows)[0].reshape(-1, 3)
    up = np.where(np.abs(normals[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    tangents = np.cross(up, normals)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    bitangents = np.cross(normals, tangents)
    alpha_squared = roughness**4
    pixel = 4.0 * np.pi / (pyramid[0].shape[0] * pyramid[0].shape[1])
    total, weight = np.zeros((len(normals), 3), dtype=np.float32), 0.0
    for number in range(_SAMPLES):
        first = (number + 0.5) / _SAMPLES
        azimuth = 2.0 * np.pi * number * 0.6180339887498949
        height2 = (1.0 - first) / (1.0 + (alpha_squared - 1.0) * first)
        along = 2.0 * height2 - 1.0  # cosine between light and normal
        if along <= 0.0:
            continue
        side = np.sqrt(1.0 - along * along)
        light = side * np.cos(azimuth) * tangents + side * np.sin(azimuth) * bitangents
        light += along * normals
        spread = height2 * (alpha_squared - 1.0) + 1.0
        density = alpha_squared / (np.pi * spread * spread) / 4.0
        level = 0.5 * np.log2(1.0 / (_SAMPLES * density) / pixel) + 1.0
        source = pyramid[int(np.clip(np.rint(level), 0, len(pyramid) - 1))]
        total += np.float32(along) * lookup(source, coordinates_of(light))
        weight += along
    return (total / np.float32(weight)).reshape(rows, 2 * rows, 3)
