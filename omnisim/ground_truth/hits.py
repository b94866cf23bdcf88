"""Hits of the rays of an image's pixels, and of a lidar's beams, as all back ends return them.

A draw item is an instance, static or of a dynamic object, by its index in the back end's list.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats, Floats32
from omnisim.core.world import ObjectPoses, time_of

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
        return HitDetails(*(first or second for first, second in zip(self, other, strict=True)))

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
    """Ray hits per pixel, first row at the top; arrays of details that are not requested are empty.

    The viewpoint frame has the world's axes and its origin at the effective viewpoint.
    """

    points_and_ranges_m: Floats32  # (height, width, 4): `points_m` and `ranges_m`
    draw_ids: NDArray[np.uint32]  # (height, width), 1 + draw item; 0: no hit
    triangles: NDArray[np.uint32]  # (height, width) triangle indices in the instance's mesh
    normals: Floats32  # (height, width, 3), viewpoint frame, unit; 0: no hit
    albedos: Floats32  # (height, width, 3) linear RGB; 0: no hit
    # (height, width, 5): `roughness`, `metallic` and `emissive`; 0: no hit
    materials: Floats32

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
        return self._nan_without_hit(self.materials[..., 0])

    @property
    def metallic(self) -> Floats32:
        """Metalness (height, width); NaN: no hit."""
        return self._nan_without_hit(self.materials[..., 1])

    @property
    def emissive(self) -> Floats32:
        """Emitted light (height, width, 3), linear RGB; 0: no hit."""
        return self.materials[..., 2:]

    def _nan_without_hit(self, values: Floats32) -> Floats32:
        return np.where(self.draw_ids == 0, np.float32(np.nan), values)


class EchoLimits(NamedTuple):
    """Limits of a receiver behind glass and mirrors.

    The faintest echo that is detected at `range_max_m` has `min_intensity`, relative to a white
    surface met perpendicularly; nearer echoes may be fainter by the squared range.
    """

    returns: int  # number of returns of a beam: 1, or 2
    min_intensity: float
    range_max_m: float


class ScanBeams(NamedTuple):
    """Beams of a scanner in a plane."""

    angles_rad: Floats  # (n,) in the scanner's frame, counter-clockwise from its x axis
    max_range_m: float  # range beyond which surfaces may be missed; may be infinite
    # limits of echoes behind glass and mirrors; None: beams end at them
    echo_limits: EchoLimits | None = None


@dataclass(frozen=True, eq=False)
class LidarBeams:
    """Beam directions of a lidar."""

    elevations_rad: Floats  # (rings,), ascending
    azimuths_rad: Floats  # (firings,), evenly descending from π over a full turn
    max_range_m: float  # range beyond which surfaces may be omitted
    # limits of echoes behind glass and mirrors; None: beams end at them
    echo_limits: EchoLimits | None = None

    @cached_property
    def directions(self) -> Floats:
        """Unit directions (rings, firings, 3) in the lidar's frame."""
        elevations, azimuths = self.elevations_rad[:, None], self.azimuths_rad[None]
        level = np.cos(elevations)
        x, y = level * np.cos(azimuths), level * np.sin(azimuths)
        return np.stack(np.broadcast_arrays(x, y, np.sin(elevations)), axis=-1)


class LidarPoses(NamedTuple):
    """Poses of a lidar and of all dynamic objects at one time."""

    world_from_lidar: Floats  # (4, 4) pose
    # (4, 4) poses, in the order of the stage's objects
    world_from_objects: Sequence[Floats] = ()

    @property
    def origin_m(self) -> Floats:
        """Origin of the beams (3,), world frame."""
        return self.world_from_lidar[:3, 3]


@dataclass(frozen=True, eq=False)
class Slice:
    """Part of a revolution, in which all points of the world move straight at constant speed."""

    first: int  # first of its firings
    last: int  # first firing of the next slice
    start: LidarPoses  # poses at these times of the slice
    middle: LidarPoses
    end: LidarPoses

    @property
    def path_m(self) -> Floats:
        """Motion (3,) of the lidar's origin from start to end, world frame."""
        return self.end.origin_m - self.start.origin_m

    def part(self, first: int, last: int) -> Slice:
        """Part of the slice: the firings from `first` to before `last`; its middle is theirs."""
        count, middle = self.last - self.first, 0.5 * (first + last - 1)
        shares = [(firing - self.first) / count for firing in (first, middle, last)]
        return Slice(first, last, *map(self._poses_at, shares))

    def _poses_at(self, share: float) -> LidarPoses:
        """Poses at a share of the slice's duration."""
        poses = [
            start + share * (end - start)
            for start, end in zip(
                (self.start.world_from_lidar, *self.start.world_from_objects),
                (self.end.world_from_lidar, *self.end.world_from_objects),
                strict=True,
            )
        ]
        start_s, end_s = (time_of(poses.world_from_objects) for poses in (self.start, self.end))
        return LidarPoses(poses[0], ObjectPoses(poses[1:], start_s + share * (end_s - start_s)))


class Revolution(NamedTuple):
    """Motion during a lidar's revolution."""

    slices: tuple[Slice, ...]  # slices with equal numbers of firings; the last may have fewer
    # (firings,) elapsed fraction, at each firing, of the slice that contains it
    shares: Floats
    rotations: Floats  # (firings, 3, 3) world_from_lidar at each firing


class BeamHits(NamedTuple):
    """Hits of all beams of a revolution."""

    ranges_m: NDArray[np.floating]  # (rings, firings); +inf: no hit
    draw_ids: NDArray[np.uint32]  # (rings, firings), 1 + draw item; 0: no hit
    # (rings, firings), relative to a white surface met perpendicularly at the same range
    intensities: NDArray[np.floating] | None = None
    second: BeamHits | None = None  # second returns; None: one return per beam
    triangles: NDArray[np.int32] | None = None  # (rings, firings), of the instance
