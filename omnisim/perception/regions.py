"""Connected regions of one color in a panorama, which continues from its right to its left edge."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Scalar = TypeVar("Scalar", bound=np.generic)
_EIGHT = np.ones((3, 3), dtype=np.int8)


@dataclass(frozen=True, eq=False)
class Region:
    """Pixels of one class that are connected by edges or corners.

    Attributes:
        color: class of the pixels.
        top, left: position of the mask in the panorama; columns may exceed its right edge.
        mask: (height, width) mask of the region's pixels in its bounding box.
    """

    color: int
    top: int
    left: int
    mask: NDArray[np.bool_]

    @property
    def bottom(self) -> int:
        """First row below the region."""
        return self.top + int(self.mask.shape[0])

    @property
    def right(self) -> int:
        """First column to the right of the region."""
        return self.left + int(self.mask.shape[1])

    @property
    def area_px(self) -> int:
        """Number of pixels."""
        return int(np.count_nonzero(self.mask))


def wrapped_around(panorama: NDArray[Scalar]) -> NDArray[Scalar]:
    """Panorama (height, width, ...) with a copy of its left half appended on the right."""
    return np.concatenate((panorama, panorama[:, : panorama.shape[1] // 2]), axis=1)


def find_regions(classes: NDArray[np.uint8], colors: int, min_area_px: int) -> list[Region]:
    """Regions of a panorama, each once; a region may cross the panorama's left and right edge.

    Args:
        classes: (height, width) classes of pixels; 0: no color.
        colors: number of colors.
        min_area_px: minimum number of pixels of a region.
    """
    width = classes.shape[1]
    colored = np.flatnonzero(classes.any(axis=1))
    if not len(colored):
        return []
    above = int(colored[0])  # rows without color above and below are skipped
    doubled = wrapped_around(classes[above : int(colored[-1]) + 1])
    # the middle of each region is within one turn that starts a quarter from the left
    first = width // 4
    regions = []
    for color in range(1, colors + 1):
        labels, count = ndimage.label(doubled == color, structure=_EIGHT)
        areas = np.bincount(labels.ravel(), minlength=count + 1)
        for index, slices in enumerate(ndimage.find_objects(labels), start=1):
            if areas[index] < min_area_px:
                continue
            rows, columns = slices
            if not first <= (columns.start + columns.stop) // 2 < first + width:
                continue
            mask = labels[slices] == index
            regions.append(Region(color, above + rows.start, columns.start, mask))
    return regions
