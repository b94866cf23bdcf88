"""Bounds on what two drivers may draw differently, and what they did."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

# An edge through the middle of a pixel falls to either side; colors round to either level.
MAX_LEVELS, MAX_SHARE_OF_COLORS, MAX_SHARE_OF_INSTANCES = 1, 1e-3, 1e-3
# Ranges follow from the triangles, not from texels: they differ by the rounding of floats.
MAX_RELATIVE_RANGE = 1e-5


class Difference(NamedTuple):
    """Difference of the images of one case by two drivers."""

    images: int = 0
    unlike_itself: int = 0  # images that a driver did not draw the same again, or in a batch
    levels: int = 0  # largest difference of a color
    colors: float = 0.0  # share of the pixels that differ, and so on
    instances: float = 0.0
    ranges: float = 0.0  # by more than rounding, where the instance is the same
    lost: int = 0  # pixels with a range by one driver only
    psnr_db: float = math.inf  # of the colors

    @property
    def is_within_bounds(self) -> bool:
        """It is no more than two drivers may differ by."""
        return (
            self.unlike_itself == 0
            and self.levels <= MAX_LEVELS
            and self.colors <= MAX_SHARE_OF_COLORS
            and self.instances <= MAX_SHARE_OF_INSTANCES
            and self.ranges <= MAX_SHARE_OF_INSTANCES
            and self.lost == 0
        )

    def __str__(self) -> str:
        return (
            f"{self.images} images, {self.unlike_itself} unlike themselves; colors differ in "
            f"{self.colors:.4%} of the pixels, by {self.levels} levels at most "
            f"({self.psnr_db:.1f} dB); instances in "
            f"{self.instances:.4%}, ranges in {self.ranges:.4%}, {self.lost} ranges lost"
        )


def compare(one: Path, other: Path, print_line: Callable[[str], None]) -> bool:
    """Compare two folders of drawings, case by case; tell whether all are within the bounds."""
    names = sorted(path.name for path in one.glob("*.npz") if (other / path.name).is_file())
    if not names:
        raise FileNotFoundError(f"{one}, {other}: there is no case drawn in both")
    all_within = True
    for name in names:
        found = difference(one / name, other / name)
        all_within = all_within and found.is_within_bounds
        verdict = "" if found.is_within_bounds else "TOO MUCH: "
        print_line(f"{verdict}{Path(name).stem}: {found}")
    return all_within


def difference(one: Path, other: Path) -> Difference:
    """Difference of two files of `python -m tests.drivers.draw`."""
    with np.load(one) as first, np.load(other) as second:
        unlike = int(first["unlike itself"]) + int(second["unlike itself"])
        result = Difference(int(first["images"]), unlike)
        if "rgb" in first:
            levels = np.abs(first["rgb"].astype(int) - second["rgb"]).max(axis=-1)
            errors = first["rgb"].astype(float) - second["rgb"]
            mean_square = float(np.mean(errors**2))
            psnr_db = 10.0 * math.log10(255.0**2 / mean_square) if mean_square else math.inf
            result = result._replace(
                levels=int(levels.max()), colors=float((levels > 0).mean()), psnr_db=psnr_db
            )
        same = first["instance"] == second["instance"]
        near, far = first["range"].astype(float), second["range"].astype(float)
        both = np.isfinite(near) & np.isfinite(far)
        relative = np.abs(near[both] - far[both]) / np.maximum(near[both], 1.0)
        return result._replace(
            instances=float((~same).mean()),
            ranges=float((same[both] & (relative > MAX_RELATIVE_RANGE)).sum() / near.size),
            lost=int((np.isfinite(near) != np.isfinite(far)).sum()),
        )
