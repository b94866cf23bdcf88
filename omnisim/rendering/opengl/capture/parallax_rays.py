"""Sample rays of an image that do not pass through one point."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Bools, Floats, Floats32, Indices

MARGIN_PX = 2  # around the image, as in capture/parallax.frag


class SampleRays(NamedTuple):
    """Rays (n,) of samples, in the frame of the image's rays."""

    directions: Floats  # (n, 3), unit
    origins_m: Floats  # (n, 3)
    footprints: Floats32  # (n, 2, 3) changes of the direction to the next samples


@dataclass(frozen=True, eq=False)
class ParallaxRays:
    """Rays of pixel centers, from which those of samples are interpolated, or sample rays."""

    supersampling: int  # samples per pixel side
    directions: Floats32  # (height + 2 margins, width + 2 margins, 3) unit; 0: no ray
    origins_m: Floats32  # origins of these rays, same shape
    smooth: Bools  # (height, width) pixels whose sample rays are interpolated
    rim_numbers: Indices  # (height, width) row of each other pixel in the arrays below; −1: no ray
    rim_directions: Floats32  # (n, samples, 3), samples row by row
    rim_origins_m: Floats32  # origins of these, same shape
    rim_valid: Bools  # (n, samples) mask of the samples with a ray

    @staticmethod
    def interpolated(
        supersampling: int, directions: Floats32, origins_m: Floats32, smooth: Bools
    ) -> ParallaxRays:
        """Rays whose samples are all interpolated; the arguments are the attributes."""
        own = np.zeros((0, supersampling**2, 3), dtype=np.float32)
        numbers = np.full(smooth.shape, -1, dtype=np.intp)
        is_valid = np.zeros(own.shape[:2], dtype=np.bool_)
        return ParallaxRays(
            supersampling, directions, origins_m, smooth, numbers, own, own, is_valid
        )

    @property
    def shown(self) -> Bools:
        """Pixels (height, width) with at least one sample ray."""
        return self.smooth | (self.rim_numbers >= 0)

    def valid_bits(self) -> NDArray[np.uint64]:
        """Bit mask per pixel (height × width,) of its samples with a ray, first sample lowest."""
        count = self.supersampling**2
        bits = np.where(self.smooth, np.uint64((1 << count) - 1), np.uint64(0))
        powers = np.uint64(1) << np.arange(count, dtype=np.uint64)
        rim = self.rim_numbers >= 0
        bits[rim] = (self.rim_valid * powers).sum(axis=1)[self.rim_numbers[rim]]
        return bits.ravel()

    def valid_shares(self) -> Floats32:
        """Share (height, width) of each pixel's samples that have a ray."""
        shares = self.smooth.astype(np.float32)
        rim = self.rim_numbers >= 0
        shares[rim] = self.rim_valid.mean(axis=1)[self.rim_numbers[rim]]
        return shares

    @cached_property
    def valid(self) -> Bools:
        """Pixels (height, width) whose center has a ray."""
        inner = slice(MARGIN_PX, -MARGIN_PX)
        return np.asarray(self.directions[inner, inner].any(axis=-1))

    @property
    def longest_m(self) -> float:
        """Length of the longest origin vector."""
        longest = 0.0
        for origins_m, valid in (
            (self.origins_m, self.directions.any(axis=-1)),
            (self.rim_origins_m, self.rim_valid),
        ):
            lengths_m = np.linalg.norm(origins_m[valid], axis=-1)
            longest = max(longest, float(lengths_m.max(initial=0.0)))
        return longest

    def centers(self) -> tuple[Floats, Floats]:
        """Directions and origins (n, 3) of the valid pixel centers, row by row."""
        inner = slice(MARGIN_PX, -MARGIN_PX)
        return (
            self.directions[inner, inner][self.valid].astype(np.float64),
            self.origins_m[inner, inner][self.valid].astype(np.float64),
        )

    def seen_from(self, viewpoint_m: Floats) -> ParallaxRays:
        """The same rays, origins relative to a point (3,)."""
        offset_m = viewpoint_m.astype(np.float32)
        return replace(
            self, origins_m=self.origins_m - offset_m, rim_origins_m=self.rim_origins_m - offset_m
        )

    def of(self, rows: Indices, columns: Indices, parts: Indices) -> SampleRays:
        """Rays of samples (n,) by row, column and sample number in the pixel (n,)."""
        side = self.supersampling
        offsets = (np.stack((parts % side, parts // side), axis=1) + 0.5) / side - 0.5
        weights = _parabolas(offsets)
        directions, origins_m = np.zeros((2, len(rows), 3))
        footprints = np.zeros((len(rows), 2, 3), dtype=np.float32)
        at = rows + MARGIN_PX, columns + MARGIN_PX
        for down in range(3):
            for right in range(3):
                weight = (weights[:, down, 1] * weights[:, right, 0])[:, None]
                neighbor = at[0] + down - 1, at[1] + right - 1
                directions += weight * self.directions[neighbor]
                origins_m += weight * self.origins_m[neighbor]
        for axis, (down, right) in enumerate(((0, 1), (1, 0))):
            before, after = (
                self.directions[at[0] + sign * down, at[1] + sign * right] for sign in (-1, 1)
            )
            footprints[:, axis] = (after - before) / (2 * side)
        numbers = self.rim_numbers[rows, columns]
        rim = np.flatnonzero(numbers >= 0)
        directions[rim] = self.rim_directions[numbers[rim], parts[rim]]
        origins_m[rim] = self.rim_origins_m[numbers[rim], parts[rim]]
        # beyond the rim there is no next sample
        footprints[rim] = 0.0
        directions /= np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-30)
        return SampleRays(directions, origins_m, footprints)


def _parabolas(offsets: Floats) -> Floats:
    """Weights (n, 3, 2) of the previous, own and next pixel, for offsets (n, 2) in pixels."""
    return np.stack(
        (0.5 * offsets * (offsets - 1.0), 1.0 - offsets * offsets, 0.5 * offsets * (offsets + 1.0)),
        axis=1,
    )
