"""Hits of the rays of an image's pixels."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats32

_MATERIALS = {"roughness", "metallic", "emissive"}


class HitDetails(NamedTuple):
    """Optional surface properties at hits, beside points and triangles: fields of `Hits`."""

    normals: bool = False
    albedos: bool = False
    materials: bool = False

    @classmethod
    def of_channels(cls, names: Collection[str]) -> HitDetails:
        """Details required by the channels with the given names."""
        return cls(
            not {"normals", "normals_camera"}.isdisjoint(names),
            "albedo" in names,
            not _MATERIALS.isdisjoint(names),
        )

    @property
    def of_texels(self) -> HitDetails:
        """Details that depend on textures: all but the normals."""
        return self._replace(normals=False)

    def joined(self, other: HitDetails) -> HitDetails:
        """Union of two sets of details."""
        return HitDetails(*(one or more for one, more in zip(self, other, strict=True)))

    @property
    def components(self) -> dict[str, int]:
        """Number of components per pixel of each requested detail, by its name in `Hits`."""
        numbers = {"normals": 3, "albedos": 3, "materials": 5}
        return {name: numbers[name] for name in self._fields if getattr(self, name)}


NO_DETAILS = HitDetails()


class ThroughHits(NamedTuple):
    """Surfaces that pixels show behind glass and after mirrors, (height, width) each."""

    ranges_m: Floats32  # lengths of the paths; +inf: no hit
    draw_ids: NDArray[np.uint32]  # 1 + draw item; 0: no hit
    # cosines of the angles of incidence there; NaN: neither glass nor mirror before it
    cosines: Floats32
    # share of light, mean of linear RGB, that panes and mirrors on the way leave
    shares: Floats32

    @classmethod
    def of_first(cls, hits: Hits) -> ThroughHits:
        """The first surfaces: where no glass and no mirror is."""
        unknown = np.full(hits.draw_ids.shape, np.nan, dtype=np.float32)
        everything = np.ones(hits.draw_ids.shape, dtype=np.float32)
        return cls(hits.ranges_m.copy(), hits.draw_ids.copy(), unknown, everything)


class Hits(NamedTuple):
    """Ray hits per pixel, first row at the top.

    The viewpoint frame has the world's axes and its origin at the effective viewpoint. Details that
    are not requested have no rows.
    """

    points_and_ranges_m: Floats32  # (height, width, 4), see below
    draw_ids: NDArray[np.uint32]  # (height, width), 1 + draw item; 0: no hit
    triangles: NDArray[np.uint32]  # (height, width) triangle indices in the instance's mesh
    normals: Floats32  # (height, width, 3), viewpoint frame, unit; 0: no hit
    albedos: Floats32  # (height, width, 3) linear RGB; 0: no hit
    materials: Floats32  # (height, width, 5), see below; 0: no hit

    @property
    def points_m(self) -> Floats32:
        """Points (height, width, 3), viewpoint frame; without a hit: directions."""
        return self.points_and_ranges_m[..., :3]

    @property
    def ranges_m(self) -> Floats32:
        """Ranges (height, width); +inf: no hit."""
        return self.points_and_ranges_m[..., 3]

    @property
    def roughness(self) -> Floats32:
        """Roughness (height, width), 1 for matte surfaces; NaN: no hit."""
        return self._of_something(self.materials[..., 0])

    @property
    def metallic(self) -> Floats32:
        """Metalness (height, width); NaN: no hit."""
        return self._of_something(self.materials[..., 1])

    @property
    def emissive(self) -> Floats32:
        """Emitted light (height, width, 3), linear RGB; 0: no hit."""
        return self.materials[..., 2:]

    def _of_something(self, values: Floats32) -> Floats32:
        return np.where(self.draw_ids == 0, np.float32(np.nan), values)
