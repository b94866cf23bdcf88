"""Many small pictures in one texture, so that an object of many materials is one mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from scenes.modeling.geometry import Patch, box, fit_to_rectangle, join, polygon

MARGIN = 4  # pixels repeated around each picture against bleeding at coarse mip levels


@dataclass(frozen=True)
class Atlas:
    """Rectangle of each picture: left, bottom, width, height as fractions of the square."""

    places: Mapping[str, tuple[float, float, float, float]]

    def in_material(self, name: str, patch: Patch) -> Patch:
        """Give a part a material of which a square picture shows one meter."""
        left, bottom, width, height = self.places[name]
        if abs(width - height) > 1e-9:
            raise ValueError(f"{name} is a picture, not a square of material")
        return fit_to_rectangle(patch, left, bottom, width)

    def block(self, name: str, size: tuple, center: tuple = (0, 0, 0), without: str = "") -> Patch:
        """A box of one material."""
        return self.in_material(name, box(size, center, without))

    def showing(self, name: str, patch: Patch) -> Patch:
        """Stretch a whole picture over a flat part, whatever its texture coordinates span."""
        low, high = patch.uvs.min(axis=0), patch.uvs.max(axis=0)
        left, bottom, width, height = self.places[name]
        unit = (patch.uvs - low) / (high - low)
        return replace(patch, uvs=np.array([left, bottom]) + unit * np.array([width, height]))

    def picture(self, name: str, width: float, height: float, y: float = 0.0) -> Patch:
        """A picture standing upright on z = 0 at depth `y`, seen from -y, middle at x = 0."""
        half = width / 2
        corners = [(-half, y, 0), (half, y, 0), (half, y, height), (-half, y, height)]
        return self.showing(name, polygon(corners))

    def board(
        self, name: str, edge: str, width: float, height: float, thickness: float = 0.02
    ) -> Patch:
        """A picture on a board whose back is the plane y = 0, with its edges in a material."""
        size, center = (width, thickness, height), (0, -thickness / 2, height / 2)
        sides = self.block(edge, size, center, without="-y+y")
        return join([sides, self.picture(name, width, height, -thickness)])


def pack(pictures: Mapping[str, np.ndarray], size: int) -> tuple[Atlas, np.ndarray]:
    """Lay pictures (height, width, 3) out in rows of a square, tallest first.

    Raises:
        ValueError: they do not fit.
    """
    image = np.full((size, size, 3), 0.5)
    places: dict[str, tuple[float, float, float, float]] = {}
    left = top = row_height = 0
    for name, pixels in sorted(pictures.items(), key=lambda item: (-len(item[1]), item[0])):
        height, width = pixels.shape[0] + 2 * MARGIN, pixels.shape[1] + 2 * MARGIN
        if left + width > size:
            left, top, row_height = 0, top + row_height, 0
        if top + height > size or width > size:
            raise ValueError(f"{name}: the atlas of {size} pixels is full")
        padded = np.pad(pixels, ((MARGIN, MARGIN), (MARGIN, MARGIN), (0, 0)), mode="edge")
        image[top : top + height, left : left + width] = padded
        places[name] = (
            (left + MARGIN) / size,
            1 - (top + height - MARGIN) / size,
            pixels.shape[1] / size,
            pixels.shape[0] / size,
        )
        left, row_height = left + width, max(row_height, height)
    return Atlas(places), image
