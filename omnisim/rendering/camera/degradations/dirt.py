"""Dust and scratches on the mirror or lens, fixed in the image.

No source gives numbers for the dirt on a robot's mirror: these are assumptions, chosen by eye.

The dirt is nearly in focus: a speck's edge is soft over some tenths of its radius. Radii are
log-normal, as for dust; positions are uniformly distributed. The map is computed once, in NumPy,
and the GPU multiplies and adds: light · (1 − absorbed) + glow · absorbed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from omnisim.core.arrays import Floats, Floats32
from omnisim.core.files.parameters import Fraction, LongSeed, NotNegative, Number, Typical
from omnisim.core.random_numbers import key_of, normal, pcg4d, uniform
from omnisim.rendering.camera.degradations.effect import Count, OpticalEffect
from omnisim.rendering.camera.degradations.image_geometry import (
    EffectStep,
    ImageGeometry,
    LinearImage,
)

Pixels = Annotated[Number, Field(gt=0.0, le=10_000.0)]
RADIUS_SPREAD = 0.5  # standard deviation of the logarithm of the specks' radii
SOFT = 0.35  # share of a speck's radius: half the width of its edge
SPACING_PX = 0.25  # between the dots that draw a scratch


@dataclass(frozen=True, kw_only=True)
class Dirt(OpticalEffect, name="degradation.dirt"):
    """Specks and scratches, placed by a seed."""

    dust_count: Annotated[Count, Typical(0.0, 300.0)] = 60
    """Number of specks in the image's square."""
    dust_radius_px: Annotated[Pixels, Typical(1.0, 4.0)] = 2.0
    """Median radius of the specks in pixels."""
    dust_opacity: Annotated[Fraction, Typical(0.2, 0.8)] = 0.5
    """Maximum share of light absorbed at the center of a speck."""
    scratch_count: Annotated[Count, Typical(0.0, 30.0)] = 0
    """Number of scratches."""
    scratch_width_px: Annotated[Pixels, Typical(0.5, 1.0)] = 0.7
    """Distance in pixels at which a scratch has half its effect."""
    scratch_length_px: Annotated[Pixels, Typical(20.0, 200.0)] = 80.0
    """Length in pixels of the longest scratch."""
    scratch_opacity: Annotated[Fraction, Typical(0.1, 0.5)] = 0.3
    """Maximum share of light that a scratch absorbs."""
    dust_glow: Annotated[NotNegative, Typical(0.02, 0.2)] = 0.05
    """Linear light that dust scatters to the camera instead."""
    scratch_glow: Annotated[NotNegative, Typical(0.2, 1.0)] = 0.6
    """Linear light that scratches scatter: they catch the lamps."""
    seed: LongSeed = 0
    """Seed of the specks and scratches."""

    def map(self, geometry: ImageGeometry) -> Floats32:
        """Dirt map (height, width, 2): share of light absorbed, and light added."""
        dust, scratches = np.ones((2, geometry.height_px, geometry.width_px))
        self._dust(dust, geometry)
        self._scratches(scratches, geometry)
        glow = self.dust_glow * (1.0 - dust) + self.scratch_glow * (1.0 - scratches)
        return np.stack((1.0 - dust * scratches, glow), axis=-1).astype(np.float32)

    def steps(self, geometry: ImageGeometry) -> list[EffectStep]:
        """One GPU pass."""
        return [EffectStep("dirt", textures={"u_dirt": self.map(geometry)})]

    def apply(self, image: LinearImage, geometry: ImageGeometry) -> LinearImage:
        """Reference in NumPy."""
        dirt = np.where(image[..., 3:] > 0.5, self.map(geometry), np.float32(0.0))
        result = image.copy()
        result[..., :3] = image[..., :3] * (np.float32(1.0) - dirt[..., :1]) + dirt[..., 1:]
        return result

    def _random(self, stream: str, count: int) -> tuple[Floats, Floats]:
        """Uniform random numbers (count, 12) and normal ones (count, 4), one row per item."""
        key = key_of("dirt", stream, self.seed)
        items = np.arange(count)[:, None]
        hashes = np.moveaxis(pcg4d(items, np.arange(5)[None, :], 0, key), 0, -1)
        plain = uniform(hashes[:, :3].reshape(count, 12)).astype(np.float64)
        pairs = hashes[:, 3:].reshape(count, 8)
        return plain, normal(pairs[:, :4], pairs[:, 4:]).astype(np.float64)

    def _positions(self, fractions: Floats, geometry: ImageGeometry) -> Floats:
        """Positions (..., 2) in the square of the image's shorter side around the axis."""
        middle = np.array(geometry.center_px)
        return middle + (2.0 * fractions - 1.0) * geometry.radius_unit_px

    def _dust(self, clear: Floats, geometry: ImageGeometry) -> None:
        plain, spread = self._random("dust", self.dust_count)
        positions = self._positions(plain[:, :2], geometry)
        radii = self.dust_radius_px * np.exp(RADIUS_SPREAD * spread[:, 0])
        opacities = self.dust_opacity * (0.4 + 0.6 * plain[:, 2])
        for position, radius, opacity, phases in zip(
            positions, radii, opacities, plain[:, 3:6], strict=True
        ):
            window, right, down = _window(clear, position, 1.8 * radius + 1.0)
            if not window.size:
                continue
            angle = np.arctan2(down, right)
            # specks are not round: an oval, three lumps and five small ones
            lumps = zip((0.22, 0.12, 0.07), (2, 3, 5), phases, strict=True)
            waves = [size * np.sin(n * angle + 2 * np.pi * phase) for size, n, phase in lumps]
            edge = radius * (1.0 + sum(waves))
            soft = max(SOFT * radius, 0.5)
            inside = np.clip(0.5 + (edge - np.hypot(right, down)) / (2.0 * soft), 0.0, 1.0)
            window *= 1.0 - opacity * inside * inside * (3.0 - 2.0 * inside)

    def _scratches(self, clear: Floats, geometry: ImageGeometry) -> None:
        plain, spread = self._random("scratches", self.scratch_count)
        positions = self._positions(plain[:, :2], geometry)
        reach = 3.0 * self.scratch_width_px + 1.0
        for position, numbers, bends in zip(positions, plain[:, 2:], spread, strict=True):
            length = self.scratch_length_px * (0.3 + 0.7 * numbers[0])
            along = np.linspace(-0.5, 0.5, max(2, round(length / SPACING_PX)))
            angle = 2.0 * np.pi * numbers[1] + 0.6 * bends[0] * along
            steps = np.stack((np.cos(angle), np.sin(angle)), axis=-1) * (length / len(along))
            points = position + np.cumsum(steps, axis=0) - 0.5 * steps.sum(axis=0)
            # deep at its start or in the middle, never over its whole length
            waves = np.sin(2 * np.pi * (5 * along + numbers[2]))
            depth = np.cos(np.pi * along) * (0.7 + 0.3 * waves)
            opacity = self.scratch_opacity * (0.4 + 0.6 * numbers[3])
            dirt = np.zeros_like(clear)
            window, right, down = _window(dirt, points.mean(axis=0), 0.5 * length + reach)
            if not window.size:
                continue
            width = max(self.scratch_width_px, 0.3)
            points = points - points.mean(axis=0)
            for point, strength in zip(points, opacity * depth, strict=True):
                columns = np.flatnonzero(np.abs(right[0] - point[0]) < reach)
                rows = np.flatnonzero(np.abs(down[:, 0] - point[1]) < reach)
                if not columns.size or not rows.size:
                    continue
                near = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
                squared = (right[near] - point[0]) ** 2 + (down[near] - point[1]) ** 2
                shape = strength * np.exp2(-np.minimum(squared / width**2, 60.0))
                np.maximum(window[near], shape, out=window[near])
            clear *= 1.0 - dirt


def _window(values: Floats, center_px: Floats, reach_px: float) -> tuple[Floats, Floats, Floats]:
    """View of values (height, width) around a position; offsets right and down from it."""
    height, width = values.shape
    first = np.floor(center_px - reach_px).astype(int)
    last = np.ceil(center_px + reach_px).astype(int) + 1
    left, right = np.clip((first[0], last[0]), 0, width).tolist()
    top, bottom = np.clip((first[1], last[1]), 0, height).tolist()
    u = np.arange(left, right) - center_px[0]
    v = np.arange(top, bottom) - center_px[1]
    across, down = np.meshgrid(u, v)
    return values[top:bottom, left:right], across, down
