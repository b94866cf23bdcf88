"""Ray casting by Embree at a scene and its dynamic objects, each at its own pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import AnyFloats, Bools, Floats, Floats32, Indices, Ints32, bounds_of
from omnisim.core.extras import require_extra
from omnisim.core.world import ObjectPart, ObjectPoses, Poses, time_of
from omnisim.rendering.pixel_rays import Band
from omnisim.rendering.rays.geometry import build_geometry
from omnisim.scene.model import Scene

# Distance by which a ray restarts behind a surface, as a share of its length and of its origin's
# coordinates: several roundings of a float32.
_BEYOND = 1e-6
_MIN_STEP_M = 1e-7
_MESHES_KEPT = 8

Sides = bool | Bools  # of all surfaces, or of each (surfaces,)


class WorldRays(NamedTuple):
    """Rays in the world, each with its own origin."""

    origins_m: Floats  # (n, 3)
    directions: Floats  # (n, 3), unit
    near_m: Floats  # (n,): nearer surfaces are ignored
    far_m: Floats  # (n,): farther surfaces are ignored; may be infinite

    def take(self, indices: Indices) -> WorldRays:
        """The selected rays."""
        return WorldRays(*(values[indices] for values in self))


class RayHits(NamedTuple):
    """Nearest triangles along rays, on their visible side."""

    triangles: Ints32  # (n,) indices into the geometry; `NO_TRIANGLE`: none
    ranges_m: Floats  # (n,); +inf: none
    weights: Floats32  # (n, 3) barycentric
    planes: Floats32  # (n, 3) normals of the visible side, world, not of unit length

    def take(self, indices: Indices) -> RayHits:
        """The selected hits."""
        return RayHits._make(values[indices] for values in self)

    def put(self, indices: Indices, hits: RayHits) -> None:
        """Overwrite the selected hits."""
        put_rows(self, indices, hits)


class RayCaster:
    """Casts rays at the static scene and its objects; BVHs are built on first use, and instanced.

    Embree finds the triangle in float32, with coordinates relative to the middle of each object
    so that they are small. `exact` computes the other values in float64.

    Args:
        scene: the static part of the world.

    Attributes:
        geometry: tables of all triangles.
    """

    def __init__(self, scene: Scene, dynamic_objects: Sequence[Scene] = ()):
        self.geometry = build_geometry(scene, dynamic_objects)
        self._part_meshes: dict[tuple[int, frozenset[ObjectPart]], _PartMesh] = {}
        # of the last times, shared by the threads
        self._deformed_mesh = lru_cache(maxsize=_MESHES_KEPT)(self._build_deformed_mesh)
        self._deforming_parts = {
            int(self.geometry.part_of_surface[deforming.number])
            for deforming in self.geometry.deforming
        }

    def prepare(self) -> None:
        """Build what all casts share, before threads do, unless it is there.

        Raises:
            OmnisimError: embreex is not installed.
        """
        self._part_mesh(0, frozenset())

    def cast(
        self,
        rays: WorldRays,
        world_from_objects: Poses = (),
        hidden: frozenset[ObjectPart] = frozenset(),
        behind: Ints32 | None = None,
        both_sides: Sides = False,
    ) -> RayHits:
        """Find the nearest triangles that face the rays or are double-sided.

        Args:
            behind: (n,) triangles that the rays have passed and that are not hit again.
            both_sides: treat all triangles as double-sided, or those of the surfaces in a mask.
        """
        identity = np.eye(4)
        hits = self._cast_part(self._part_mesh(0, frozenset()), rays, identity, behind, both_sides)
        others = [
            (self._part_mesh(part, hidden), pose)
            for part, pose in enumerate(world_from_objects, start=1)
        ]
        for part in self._deforming_parts:
            if part > len(world_from_objects):  # without poses there are no dynamic objects
                continue
            gone = frozenset(key for key in hidden if key[0] == part - 1)
            mesh = self._deformed_mesh(part, gone, time_of(world_from_objects))
            others.append((mesh, world_from_objects[part - 1] if part else identity))
        for mesh, pose in others:
            # rays that pass the part's bounding sphere
            to_center_m = pose[:3, :3] @ mesh.center_m + pose[:3, 3] - rays.origins_m
            along_m = np.maximum(_dot(to_center_m, rays.directions), 0.0)
            away_m = to_center_m - along_m[:, None] * rays.directions
            aimed = np.flatnonzero(_dot(away_m, away_m) <= mesh.radius_m**2)
            if len(aimed) == 0:
                continue
            some = rays.take(aimed)
            some = some._replace(far_m=np.minimum(some.far_m, hits.ranges_m[aimed]))
            passed = None if behind is None else behind[aimed]
            part_hits = self._cast_part(mesh, some, pose, passed, both_sides)
            nearer = np.flatnonzero(part_hits.triangles != NO_TRIANGLE)
            hits.put(aimed[nearer], part_hits.take(nearer))
        return hits

    def longest_path_m(self, start: Poses, end: Poses, hidden: frozenset[ObjectPart]) -> float:
        """Upper bound of the straight motion of any object's points from one pose to another."""
        paths_m = [0.0]
        for part, (first, other) in enumerate(zip(start, end, strict=True), start=1):
            change = other - first
            if change.any():
                mesh = self._part_mesh(part, hidden)
                center_m = change[:3, :3] @ mesh.center_m + change[:3, 3]
                turn_m = np.linalg.norm(change[:3, :3], 2) * mesh.radius_m
                paths_m.append(float(np.linalg.norm(center_m) + turn_m))
        return max(paths_m)

    @property
    def static_center_m(self) -> Floats:
        """Middle (3,) of the static surfaces' bounds, world."""
        return self._part_mesh(0, frozenset()).center_m

    def static_hits(
        self, origins_m: Floats32, directions: Floats32, far: Floats32 | None = None
    ) -> EmbreeHits:
        """Nearest static triangles along rays (n, 3), either side, as Embree finds them.

        Args:
            origins_m: (n, 3) relative to `static_center_m`, along the world's axes.
            directions: (n, 3) directions of any length.
            far: (n,) ends of the rays, in lengths of the direction; None: unlimited.
        """
        part = self._part_mesh(0, frozenset())
        hits = part.mesh.hits(origins_m, directions, far)
        is_hit = hits.triangles != NO_TRIANGLE
        triangles = part.triangles.take(hits.triangles, mode="clip").astype(np.int32)
        return hits._replace(triangles=np.where(is_hit, triangles, np.int32(NO_TRIANGLE)))

    def behind(self, rays: WorldRays, ranges_m: Floats) -> WorldRays:
        """Rays (n,) continued just behind surfaces at ranges (n,).

        The step exceeds the rounding of a triangle's position, so that a ray along an edge does not
        hit the adjacent triangle of the same surface.
        """
        origins_m = rays.origins_m - self._part_mesh(0, frozenset()).center_m
        return rays._replace(near_m=_beyond_m(origins_m, ranges_m))

    def exact(self, rays: WorldRays, hits: RayHits, world_from_objects: Poses = ()) -> RayHits:
        """The same hits (n,) with ranges, weights and planes in float64; all rays must hit."""
        corners_m = self.geometry.corners_m(hits.triangles, world_from_objects)
        return self.exact_at(corners_m, rays, hits)

    @staticmethod
    def exact_at(corners_m: Floats, rays: WorldRays, hits: RayHits) -> RayHits:
        """The same hits (n,) of triangles with corners (n, 3, 3), world; see `exact`."""
        a, b, c = np.moveaxis(corners_m - rays.origins_m[:, None], 1, 0)
        planes = np.cross(b - a, c - a)
        along = _dot(planes, rays.directions)
        ranges_m = _dot(planes, a) / along
        # an edge and the origin span a plane; the ray's side of it is the opposite corner's weight
        sides = np.stack(
            [
                _dot(rays.directions, np.cross(first, second - first))
                for first, second in ((b, c), (c, a), (a, b))
            ],
            axis=1,
        )
        weights = sides / sides.sum(axis=1, keepdims=True)
        planes *= np.where(along > 0.0, -1.0, 1.0)[:, None]
        return RayHits(
            hits.triangles, ranges_m, weights.astype(np.float32), planes.astype(np.float32)
        )

    def _cast_part(
        self,
        part: _PartMesh,
        rays: WorldRays,
        world_from_part: Floats,
        behind: Ints32 | None,
        both_sides: Sides,
    ) -> RayHits:
        """Cast rays (n,) at one part, and continue them behind triangles that are not hit."""
        rotation = world_from_part[:3, :3]
        origins_m = _rotated(rays.origins_m - world_from_part[:3, 3], rotation.T) - part.center_m
        directions = _rotated(rays.directions, rotation.T)
        count, near_m = len(origins_m), rays.near_m
        hits = RayHits(
            np.full(count, NO_TRIANGLE, dtype=np.int32), np.full(count, np.inf),
            np.zeros((count, 3), dtype=np.float32), np.zeros((count, 3), dtype=np.float32),
        )  # fmt: skip
        is_double_sided = self.geometry.is_double_sided | both_sides
        active = np.arange(count)
        while len(active):
            starts_m = origins_m[active] + near_m[active, None] * directions[active]
            aims = directions[active].astype(np.float32)
            lengths_m = np.maximum(rays.far_m[active] - near_m[active], 0.0)
            embree_hits = part.mesh.hits(
                starts_m.astype(np.float32), aims, np.minimum(lengths_m, 1e37).astype(np.float32)
            )
            is_hit = np.flatnonzero(embree_hits.triangles != NO_TRIANGLE)
            triangles = part.triangles[embree_hits.triangles[is_hit]].astype(np.int32)
            planes = embree_hits.normals[is_hit]
            is_back = _dot(planes, aims[is_hit]) > 0.0
            rays_hit = active[is_hit]
            ranges_m = near_m[rays_hit] + embree_hits.ranges_m[is_hit]
            shows = ~is_back
            shows |= is_double_sided[self.geometry.surface_of_triangle[triangles]]
            if behind is not None:
                shows &= behind[rays_hit] != triangles
            shown_rays, shown_hits = rays_hit[shows], is_hit[shows]
            hits.triangles[shown_rays] = triangles[shows]
            hits.ranges_m[shown_rays] = ranges_m[shows]
            u, v = embree_hits.u[shown_hits], embree_hits.v[shown_hits]
            hits.weights[shown_rays] = np.stack((1.0 - u - v, u, v), axis=1)
            facing = np.where(is_back[shows], np.float32(-1.0), np.float32(1.0))
            hits.planes[shown_rays] = _rotated(facing[:, None] * planes[shows], rotation)
            passed = rays_hit[~shows]
            if len(passed):
                near_m = near_m.copy()
                near_m[passed] = _beyond_m(origins_m[passed], ranges_m[~shows])
            active = passed
        return hits

    def _part_mesh(self, part: int, hidden: frozenset[ObjectPart]) -> _PartMesh:
        """BVH of a part without hidden instances, built on first use and shared by sensors."""
        hidden = frozenset(key for key in hidden if key[0] == part - 1)
        if (part, hidden) not in self._part_meshes:
            triangles = self.geometry.triangles_of_part(part, hidden)
            used, renumbered = np.unique(self.geometry.corners[triangles], return_inverse=True)
            mesh = _part_mesh_of(self.geometry.positions_m[used], renumbered, triangles)
            self._part_meshes[part, hidden] = mesh
        return self._part_meshes[part, hidden]

    def _build_deformed_mesh(
        self, part: int, hidden: frozenset[ObjectPart], time_s: float
    ) -> _PartMesh:
        """BVH of a part's deforming surfaces at a time."""
        geometry = self.geometry
        triangles = geometry.triangles_of_part(part, hidden, deforming=True)
        # vertices of the part in its own frame
        corners_m = geometry.corners_m(triangles.astype(np.int32), ObjectPoses((), time_s))
        return _part_mesh_of(corners_m.reshape(-1, 3), np.arange(3 * len(triangles)), triangles)


class _PartMesh(NamedTuple):
    """BVH of a part's triangles, centered on the middle of their bounds, in the part's frame."""

    mesh: EmbreeMesh
    triangles: Indices  # indices into the geometry
    center_m: Floats
    radius_m: float


def _part_mesh_of(positions_m: Floats, corners: Indices, triangles: Indices) -> _PartMesh:
    """BVH of triangles with corners (3 n,) that index vertices (k, 3)."""
    bounds = bounds_of(positions_m) if len(positions_m) else np.zeros((2, 3))
    center_m = bounds.mean(axis=0)
    local_m = (positions_m - center_m).astype(np.float32)
    radius_m = float(np.linalg.norm(local_m, axis=1).max(initial=0.0)) * (1.0 + _BEYOND)
    mesh = EmbreeMesh(local_m, corners.reshape(-1, 3).astype(np.int32))
    return _PartMesh(mesh, triangles, center_m, radius_m)


def _beyond_m(origins_m: Floats, ranges_m: Floats) -> Floats:
    """Ranges (n,) just behind surfaces at ranges (n,) along rays from origins (n, 3)."""
    size_m: Floats = np.abs(origins_m).max(axis=1) + ranges_m
    return ranges_m + _BEYOND * size_m + _MIN_STEP_M


def _dot(one: AnyFloats, other: AnyFloats) -> Floats:
    """Dot products (n,) of vectors (n, 3) each."""
    return np.einsum("nc,nc->n", one, other)


def _rotated(vectors: AnyFloats, rotation: Floats) -> Floats:
    """Vectors (n, 3) rotated by a matrix (3, 3); without BLAS, whose threads would keep running."""
    return np.einsum("nj,ij->ni", vectors, rotation)


# Embree, through embreex: nearest triangles along rays, in float32.
NO_TRIANGLE = -1
_FAR_M = np.float32(1e37)  # Embree's own limit


def put_rows(
    columns: tuple[NDArray[Any], ...], rows: Indices, values: tuple[NDArray[Any], ...]
) -> None:
    """Overwrite some rows of columns (n, …)."""
    for column, new_values in zip(columns, values, strict=True):
        column[rows] = new_values


class EmbreeHits(NamedTuple):
    """Nearest triangles along rays."""

    triangles: Ints32  # (n,) indices; `NO_TRIANGLE`: none
    ranges_m: Floats32  # (n,) in lengths of the direction
    u: Floats32  # (n,) weight of the second corner
    v: Floats32  # (n,) weight of the third corner
    normals: Floats32  # (n, 3) plane normals on the front side, not of unit length

    @property
    def weights(self) -> Floats32:
        """Barycentric weights (n, 3)."""
        return np.stack((1.0 - self.u - self.v, self.u, self.v), axis=1)

    def take(self, indices: Indices) -> EmbreeHits:
        """The selected hits."""
        return EmbreeHits._make(values[indices] for values in self)

    def put(self, indices: Indices, hits: EmbreeHits) -> None:
        """Overwrite the selected hits."""
        put_rows(self, indices, hits)


class EmbreeMesh:
    """Bounding volume hierarchy of triangles; embreex frees the GIL while it casts.

    Args:
        positions_m: (n, 3) vertices.
        triangles: (m, 3) indices of the corners.

    Raises:
        OmnisimError: embreex is not installed.
    """

    def __init__(self, positions_m: Floats32, triangles: Ints32):
        require_extra("rays", "casting rays")
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._scene = EmbreeScene()
        positions_m = np.ascontiguousarray(positions_m, dtype=np.float32)
        # embreex needs at least one triangle
        self._is_empty = len(triangles) == 0
        if not self._is_empty:
            triangles = np.ascontiguousarray(triangles, dtype=np.int32)
            self._mesh = TriangleMesh(self._scene, positions_m, triangles)  # owns the vertices

    @classmethod
    def of_corners(cls, corners_m: AnyFloats) -> EmbreeMesh:
        """Mesh of triangles (m, 3, 3) without shared vertices."""
        positions = corners_m.reshape(-1, 3).astype(np.float32)
        return cls(positions, np.arange(len(positions), dtype=np.int32).reshape(-1, 3))

    def triangles_hit(self, origins_m: Floats32, directions: Floats32) -> Ints32:
        """Indices (n,) of the nearest triangles along rays (n, 3); `NO_TRIANGLE`: none."""
        if self._is_empty:
            return np.full(len(origins_m), NO_TRIANGLE, dtype=np.int32)
        return self._scene.run(origins_m, directions)

    def hits(
        self, origins_m: Floats32, directions: Floats32, far: Floats32 | None = None
    ) -> EmbreeHits:
        """Nearest triangles, of either side, along rays (n, 3) up to `far` (n,) directions."""
        if self._is_empty:
            none = np.zeros(len(origins_m), dtype=np.float32)
            missed = np.full(len(none), NO_TRIANGLE, dtype=np.int32)
            return EmbreeHits(missed, none, none, none, np.zeros((len(none), 3), np.float32))
        ends = None if far is None else np.minimum(far, _FAR_M)
        columns = self._scene.run(origins_m, directions, dists=ends, output=True)
        return EmbreeHits(
            columns["primID"], columns["tfar"], columns["u"], columns["v"], columns["Ng"]
        )


@dataclass(frozen=True)
class DepthLimits:
    """Depth limits equal to the clipping planes of the virtual cameras: faces of two cubes."""

    # half the side lengths of the cubes
    near_m: float
    far_m: float

    def aim(self, rig: Floats, world_from_rig: Floats) -> WorldRays:
        """Rays in the world along unit directions (n, 3), rig frame, from a pose (4, 4)."""
        depths = np.abs(rig).max(axis=1)
        return WorldRays(
            np.tile(world_from_rig[:3, 3], (len(rig), 1)),
            _rotated(rig, world_from_rig[:3, :3]),
            self.near_m / depths,
            self.far_m / depths,
        )

    def aim_band(
        self, band: Band, rig_from_optical: Floats, world_from_rig: Floats
    ) -> tuple[WorldRays, Floats32]:
        """Rays (n,) of a band in the world, and their footprints (n, 2, 3) there.

        Args:
            rig_from_optical: (3, 3) orientation of the camera.
            world_from_rig: (4, 4) pose of its rig.
        """
        world_from_optical = world_from_rig[:3, :3] @ rig_from_optical
        rotation = world_from_optical.astype(np.float32)
        footprints = np.einsum("nsj,ij->nsi", band.footprints, rotation)
        rays = self.aim(_rotated(band.directions, rig_from_optical), world_from_rig)
        if band.origins_m is not None:
            offsets_m = _rotated(band.origins_m, world_from_optical)
            rays = rays._replace(origins_m=rays.origins_m + offsets_m)
        return rays, footprints
