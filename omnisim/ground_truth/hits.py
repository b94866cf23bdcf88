"""Hits of the rays of an image's pixels."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_MATERIALS = {"roughness", "metallic", "emissive"}


class HitDetails(NamedTuple):
    """Values to find of the surfaces that are hit, beside points and triangles.

    Attributes:
        normals, albedos, materials: see `Hits`.
    """

    normals: bool = False
    albedos: bool = False
    materials: bool = False

    @classmethod
    def of_channels(cls, names: Collection[str]) -> HitDetails:
        """Details that channels of these names are made of."""
        return cls(
            not {"normals", "normals_camera"}.isdisjoint(names),
            "albedo" in names,
            not _MATERIALS.isdisjoint(names),
        )

    @property
    def of_texels(self) -> HitDetails:
        """Details that textures change, without the others."""
        return self._replace(normals=False)

    def joined(self, other: HitDetails) -> HitDetails:
        """These and other ones."""
        return HitDetails(*(one or more for one, more in zip(self, other, strict=True)))

    @property
    def components(self) -> dict[str, int]:
        """Numbers a pixel has of each, by its name in `Hits`."""
        numbers = {"normals": 3, "albedos": 3, "materials": 5}
        return {name: numbers[name] for name in self._fields if getattr(self, name)}


NO_DETAILS = HitDetails()


class Hits(NamedTuple):
    """Hits of each pixel's ray; first row at the top.

    The viewpoint frame has the world's axes and its origin in the effective viewpoint. Details that
    were not asked for have no rows.
    """

    points_and_ranges_m: NDArray[np.float32]  # (height, width, 4), see below
    draw_ids: NDArray[np.uint32]  # (height, width), 1 + draw item; 0: nothing is hit
    triangles: NDArray[np.uint32]  # (height, width) of the instance's mesh
    normals: NDArray[np.float32]  # (height, width, 3), viewpoint frame, unit; 0: nothing is hit
    albedos: NDArray[np.float32]  # (height, width, 3) linear RGB; 0: nothing is hit
    materials: NDArray[np.float32]  # (height, width, 5), see below; 0: nothing is hit

    @property
    def points_m(self) -> NDArray[np.float32]:
        """Points (height, width, 3), viewpoint frame; where nothing is hit, directions."""
        return self.points_and_ranges_m[..., :3]

    @property
    def ranges_m(self) -> NDArray[np.float32]:
        """Ranges (height, width); +inf: nothing is hit."""
        return self.points_and_ranges_m[..., 3]

    @property
    def roughness(self) -> NDArray[np.float32]:
        """Roughness (height, width), of matte surfaces 1; NaN: nothing is hit."""
        return self._of_something(self.materials[..., 0])

    @property
    def metallic(self) -> NDArray[np.float32]:
        """Metalness (height, width); NaN: nothing is hit."""
        return self._of_something(self.materials[..., 1])

    @property
    def emissive(self) -> NDArray[np.float32]:
        """Light emitted (height, width, 3), linear RGB; 0: nothing is hit."""
        return self.materials[..., 2:]

    def _of_something(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.where(self.draw_ids == 0, np.float32(np.nan), values)
