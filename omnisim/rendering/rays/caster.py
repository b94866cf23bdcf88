"""Ray casting at a scene and its dynamic objects, each at its own pose."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import bounds_of
from omnisim.core.world import ObjectPart, ObjectPoses, time_of
from omnisim.rendering.rays.embree import NO_TRIANGLE, EmbreeHits, EmbreeMesh, put_rows
from omnisim.rendering.rays.geometry import Poses, build_geometry
from omnisim.scene.model import Scene

# Distance by which a ray restarts behind a surface, as a share of its length and of its origin's
# coordinates: several roundings of a float32.
_BEYOND = 1e-6
_MIN_STEP_M = 1e-7
_MESHES_KEPT = 8

Sides = bool | NDArray[np.bool_]  # of all surfaces, or of each (surfaces,)


class Rays(NamedTuple):
    """Rays in the world, each with its own origin."""

    origins_m: NDArray[np.float64]  # (n, 3)
    directions: NDArray[np.float64]  # (n, 3), unit
    near_m: NDArray[np.float64]  # (n,): nearer surfaces are ignored
    far_m: NDArray[np.float64]  # (n,): farther surfaces are ignored; may be infinite

    def take(self, indices: NDArray[np.intp]) -> Rays:
        """The selected rays."""
        return Rays(*(values[indices] for values in self))


class RayHits(NamedTuple):
    """Nearest triangles along rays, on their visible side."""

    triangles: NDArray[np.int32]  # (n,) indices into the geometry; `NO_TRIANGLE`: none
    ranges_m: NDArray[np.float64]  # (n,); +inf: none
    weights: NDArray[np.float32]  # (n, 3) barycentric
    planes: NDArray[np.float32]  # (n, 3) normals of the visible side, world, not of unit length

    def take(self, indices: NDArray[np.intp]) -> RayHits:
        """The selected hits."""
        return RayHits._make(values[indices] for values in self)

    def put(self, indices: NDArray[np.intp], hits: RayHits) -> None:
        """Overwrite the selected hits."""
        put_rows(self, indices, hits)


class _PartMesh(NamedTuple):
    """BVH of a part's triangles, centered on the middle of their bounds, in the part's frame."""

    mesh: EmbreeMesh
    triangles: NDArray[np.intp]  # indices into the geometry
    center_m: NDArray[np.float64]
    radius_m: float


class RayCaster:
    """Casts rays at the static scene and its objects; BVHs are built once and instanced by pose.

    Embree finds the triangle in float32, with coordinates relative to the middle of each object
    so that they are small. `exact` computes the other values in float64.

    Args:
        scene: the static part of the world.
        dynamic_objects: objects, each in its own frame.
        casts: False: no more than `exact` is needed, and no embreex.

    Attributes:
        geometry: tables of all triangles.

    Raises:
        OmnisimError: embreex is not installed.
    """

    def __init__(self, scene: Scene, dynamic_objects: Sequence[Scene] = (), casts: bool = True):
        self.geometry = build_geometry(scene, dynamic_objects)
        self._part_meshes: dict[tuple[int, frozenset[ObjectPart]], _PartMesh] = {}
        if casts:
            self._part_mesh(0, frozenset())
        # deformed meshes of the last times, shared by the threads
        self._deformed_mesh = lru_cache(maxsize=_MESHES_KEPT)(self._build_deformed_mesh)
        self._deforming_parts = {
            int(self.geometry.part_of_surface[one.number]) for one in self.geometry.deforming
        }

    def cast(
        self,
        rays: Rays,
        world_from_objects: Poses = (),
        hidden: frozenset[ObjectPart] = frozenset(),
        behind: NDArray[np.int32] | None = None,
        both_sides: Sides = False,
    ) -> RayHits:
        """Find the nearest triangles that face the rays or are double-sided.

        Args:
            rays: (n,) rays in the world.
            world_from_objects: (4, 4) each, poses of the dynamic objects.
            hidden: instances to ignore.
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
            gone = frozenset(one for one in hidden if one[0] == part - 1)
            mesh = self._deformed_mesh(part, gone, time_of(world_from_objects))
            others.append((mesh, world_from_objects[part - 1] if part else identity))
        for mesh, pose in others:
            aimed = _near_sphere(rays, mesh, pose)
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
        for part, (one, other) in enumerate(zip(start, end, strict=True), start=1):
            change = other - one
            if change.any():
                mesh = self._part_mesh(part, hidden)
                center_m = change[:3, :3] @ mesh.center_m + change[:3, 3]
                turn_m = np.linalg.norm(change[:3, :3], 2) * mesh.radius_m
                paths_m.append(float(np.linalg.norm(center_m) + turn_m))
        return max(paths_m)

    @property
    def static_center_m(self) -> NDArray[np.float64]:
        """Middle (3,) of the static surfaces' bounds, world."""
        return self._part_mesh(0, frozenset()).center_m

    def static_hits(
        self,
        origins_m: NDArray[np.float32],
        directions: NDArray[np.float32],
        far: NDArray[np.float32] | None = None,
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

    def behind(self, rays: Rays, ranges_m: NDArray[np.float64]) -> Rays:
        """Rays (n,) continued just behind surfaces at ranges (n,).

        The step exceeds the rounding of a triangle's position, so that a ray along an edge does not
        hit the adjacent triangle of the same surface.
        """
        origins_m = rays.origins_m - self._part_mesh(0, frozenset()).center_m
        return rays._replace(near_m=_beyond_m(origins_m, ranges_m))

    def exact(self, rays: Rays, hits: RayHits, world_from_objects: Poses = ()) -> RayHits:
        """The same hits (n,) with ranges, weights and planes in float64; all rays must hit."""
        corners_m = self.geometry.corners_m(hits.triangles, world_from_objects)
        return self.exact_at(corners_m, rays, hits)

    @staticmethod
    def exact_at(corners_m: NDArray[np.float64], rays: Rays, hits: RayHits) -> RayHits:
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
        rays: Rays,
        world_from_part: NDArray[np.float64],
        behind: NDArray[np.int32] | None,
        both_sides: Sides,
    ) -> RayHits:
        """Cast rays (n,) at one part, and continue them behind triangles that are not hit."""
        rotation = world_from_part[:3, :3]
        origins_m = _rotated(rays.origins_m - world_from_part[:3, 3], rotation.T) - part.center_m
        directions = _rotated(rays.directions, rotation.T)
        hits, near_m = _no_hits(len(origins_m)), rays.near_m
        is_double_sided = self.geometry.is_double_sided | both_sides
        active = np.arange(len(origins_m))
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
        hidden = frozenset(one for one in hidden if one[0] == part - 1)
        if (part, hidden) not in self._part_meshes:
            self._part_meshes[part, hidden] = self._build_part_mesh(part, hidden)
        return self._part_meshes[part, hidden]

    def _build_part_mesh(self, part: int, hidden: frozenset[ObjectPart]) -> _PartMesh:
        geometry = self.geometry
        triangles = geometry.triangles_of_part(part, hidden)
        used, renumbered = np.unique(geometry.corners[triangles], return_inverse=True)
        return _part_mesh_of(geometry.positions_m[used], renumbered, triangles)

    def _build_deformed_mesh(
        self, part: int, hidden: frozenset[ObjectPart], time_s: float
    ) -> _PartMesh:
        """BVH of a part's deforming surfaces at a time."""
        geometry = self.geometry
        triangles = geometry.triangles_of_part(part, hidden, deforming=True)
        # vertices of the part in its own frame
        corners_m = geometry.corners_m(triangles.astype(np.int32), ObjectPoses((), time_s))
        return _part_mesh_of(corners_m.reshape(-1, 3), np.arange(3 * len(triangles)), triangles)


def _part_mesh_of(
    positions_m: NDArray[np.float64], corners: NDArray[np.intp], triangles: NDArray[np.intp]
) -> _PartMesh:
    """BVH of triangles with corners (3 n,) that index vertices (k, 3)."""
    bounds = bounds_of(positions_m) if len(positions_m) else np.zeros((2, 3))
    center_m = bounds.mean(axis=0)
    local_m = (positions_m - center_m).astype(np.float32)
    radius_m = float(np.linalg.norm(local_m, axis=1).max(initial=0.0)) * (1.0 + _BEYOND)
    mesh = EmbreeMesh(local_m, corners.reshape(-1, 3).astype(np.int32))
    return _PartMesh(mesh, triangles, center_m, radius_m)


def _beyond_m(origins_m: NDArray[np.float64], ranges_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ranges (n,) just behind surfaces at ranges (n,) along rays from origins (n, 3)."""
    size_m: NDArray[np.float64] = np.abs(origins_m).max(axis=1) + ranges_m
    return ranges_m + _BEYOND * size_m + _MIN_STEP_M


def _no_hits(count: int) -> RayHits:
    return RayHits(
        np.full(count, NO_TRIANGLE, dtype=np.int32),
        np.full(count, np.inf),
        np.zeros((count, 3), dtype=np.float32),
        np.zeros((count, 3), dtype=np.float32),
    )


def _near_sphere(
    rays: Rays, part: _PartMesh, world_from_part: NDArray[np.float64]
) -> NDArray[np.intp]:
    """Indices of the rays that pass the bounding sphere of a part within its radius."""
    center_m = world_from_part[:3, :3] @ part.center_m + world_from_part[:3, 3]
    to_center = center_m - rays.origins_m
    along = np.maximum(_dot(to_center, rays.directions), 0.0)
    away = to_center - along[:, None] * rays.directions
    return np.flatnonzero(_dot(away, away) <= part.radius_m**2)


def _dot(one: NDArray[np.floating], other: NDArray[np.floating]) -> NDArray[np.float64]:
    """Dot products (n,) of vectors (n, 3) each."""
    return np.einsum("nc,nc->n", one, other)


def _rotated(vectors: NDArray[np.floating], rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors (n, 3) rotated by a matrix (3, 3); without BLAS, whose threads would keep running."""
    return np.einsum("nj,ij->ni", vectors, rotation)
