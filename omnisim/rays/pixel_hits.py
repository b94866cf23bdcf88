"""Hits of a camera's pixels by casting rays, and occlusion seen from another viewpoint."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import NonCentralCamera, pixels_of_points
from omnisim.ground_truth.hits import Hits
from omnisim.rays.depth_limits import DepthLimits
from omnisim.rays.embree import NO_TRIANGLE
from omnisim.rays.pixel_rays import PixelRays
from omnisim.rays.ray_scene import ObjectState, RayScene

# A hit nearer than the point by more than this share occludes it, as in occlusion.frag.
_NEARER = 1e-3
_POINTS_PER_BATCH = 1 << 14

T = TypeVar("T", bound=np.generic)


class _BandHits(NamedTuple):
    """Hits (n,) of a band's rays, as in `Hits`, and the triangles of the geometry."""

    hits: Hits
    triangles: NDArray[np.int32]


class PixelHits:
    """Hits of the rays of all pixels; everything constant is made once.

    Args:
        scene: to cast rays at.
        pixels: with the rays.
        limits: of the rays.

    Attributes:
        has_ray: (height, width).
    """

    def __init__(self, scene: RayScene, pixels: PixelRays, limits: DepthLimits):
        self._scene, self._pixels, self._limits = scene, pixels, limits
        self._bands = range(len(pixels.bands))
        self.has_ray = np.concatenate([pixels.band(number).valid for number in self._bands])
        # of the last hits, of the pixels that have a ray
        self._points_m = np.empty((0, 3))  # viewpoint frame; where nothing is hit, directions
        self._draws_plus_one = np.empty(0, dtype=np.uint32)
        self._triangles = np.empty(0, dtype=np.int32)

    def rays(self) -> NDArray[np.float64]:
        """Unit rays (height, width, 3), optical frame."""
        return self._placed([self._pixels.band(number).directions for number in self._bands], 0.0)

    def cast(
        self,
        world_from_rig: NDArray[np.float64],
        objects: ObjectState,
        normals: bool,
        albedos: bool,
    ) -> Hits:
        """Cast all rays from a pose (4, 4).

        Normals and albedos have no rows where they are not asked for.
        """

        def of_band(number: int) -> _BandHits:
            return self._cast_band(number, world_from_rig, objects, normals, albedos)

        bands = self._scene.in_threads(of_band, self._bands)
        hits = [band.hits for band in bands]
        self._triangles = np.concatenate([band.triangles for band in bands])
        self._draws_plus_one = np.concatenate([one.draws_plus_one for one in hits])
        self._points_m = np.concatenate([one.points_m for one in hits]).astype(np.float64)
        none = np.empty((0, self.has_ray.shape[1], 3), dtype=np.float32)
        return Hits(
            self._placed([one.points_and_ranges_m for one in hits], (0.0, 0.0, 0.0, np.inf)),
            self._placed([one.draws_plus_one for one in hits], 0),
            self._placed([one.triangles for one in hits], 0),
            self._placed([one.normals for one in hits], 0.0) if normals else none,
            self._placed([one.albedos for one in hits], 0.0) if albedos else none,
        )

    def occluded(
        self,
        world_from_rig: NDArray[np.float64],
        objects: ObjectState,
        other_from_current: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        """Mask (height, width) of the last hits' points that something hides from another pose.

        Args:
            world_from_rig: (4, 4) other pose.
            objects: at the other time.
            other_from_current: (surfaces, 3, 4), from the viewpoint frame of the last hits to the
                other one's, of points on each surface.
        """

        def of_batch(first: int) -> NDArray[np.bool_]:
            batch = slice(first, first + _POINTS_PER_BATCH)
            return self._occluded(batch, world_from_rig, objects, other_from_current)

        firsts = range(0, len(self._triangles), _POINTS_PER_BATCH)
        none = np.empty(0, dtype=np.bool_)
        return self._placed([none, *self._scene.in_threads(of_batch, firsts)], False)

    def _cast_band(
        self,
        number: int,
        world_from_rig: NDArray[np.float64],
        objects: ObjectState,
        normals: bool,
        albedos: bool,
    ) -> _BandHits:
        scene, band, poses = self._scene, self._pixels.band(number), objects.world_from_objects
        geometry, shading = scene.caster.geometry, scene.shading
        world_from_optical = world_from_rig[:3, :3] @ self._pixels.camera.rig_from_optical
        rays = band.aim(self._limits, self._pixels.camera.rig_from_optical, world_from_rig)
        footprints = band.world_footprints(world_from_optical)
        first = scene.first_hits(rays, objects, footprints=footprints)
        hit = np.flatnonzero(first.triangles != NO_TRIANGLE)
        some = rays.take(hit)
        exact = scene.caster.exact(some, first.take(hit), poses)
        points = np.empty((len(first.triangles), 4), dtype=np.float32)
        points[:, :3], points[:, 3] = rays.directions, np.inf
        from_viewpoint_m = some.origins_m - world_from_rig[:3, 3]
        points[hit, :3] = from_viewpoint_m + exact.ranges_m[:, None] * some.directions
        points[hit, 3] = exact.ranges_m
        draws_plus_one, triangles = np.zeros((2, len(points)), dtype=np.uint32)
        surfaces = shading.surfaces(exact)
        draws_plus_one[hit] = surfaces + 1
        triangles[hit] = exact.triangles - geometry.first_of_surface[surfaces]
        found = [np.zeros((len(points), 3), dtype=np.float32) for _ in range(2)]
        if normals:
            found[0][hit] = shading.normals(exact, poses)
        if albedos:
            colors = shading.base_colors(some, exact, poses, footprints[hit])
            found[1][hit] = colors[:, :3]
        return _BandHits(Hits(points, draws_plus_one, triangles, *found), first.triangles)

    def _occluded(
        self,
        batch: slice,
        world_from_rig: NDArray[np.float64],
        objects: ObjectState,
        other_from_current: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        points_m, draws_plus_one = self._points_m[batch].copy(), self._draws_plus_one[batch]
        ends_m = np.full(len(points_m), np.inf)
        hit = np.flatnonzero(draws_plus_one)
        moves = other_from_current[draws_plus_one[hit] - 1]
        points_m[hit] = np.einsum("nij,nj->ni", moves[..., :3], points_m[hit]) + moves[..., 3]
        starts_m = self._starts_m(points_m, draws_plus_one > 0, world_from_rig)
        points_m[hit] -= starts_m[hit]
        lengths_m = np.linalg.norm(points_m, axis=1)
        ends_m[hit] = (1.0 - _NEARER) * lengths_m[hit]
        rig = np.einsum("nj,ji->ni", points_m / lengths_m[:, None], world_from_rig[:3, :3])
        rays = self._limits.aim(rig, world_from_rig)
        rays = rays._replace(
            origins_m=rays.origins_m + starts_m, far_m=np.minimum(rays.far_m, ends_m)
        )
        found = self._scene.first_hits(rays, objects, self._triangles[batch])
        is_hit: NDArray[np.bool_] = found.triangles != NO_TRIANGLE
        return is_hit

    def _starts_m(
        self,
        points_m: NDArray[np.float64],
        is_finite: NDArray[np.bool_],
        world_from_rig: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Origins (n, 3), viewpoint frame, of the rays that see points (n, 3) from another pose."""
        camera = self._pixels.camera
        if not isinstance(camera, NonCentralCamera):
            return np.zeros((1, 3)).repeat(len(points_m), axis=0)
        world_from_optical = world_from_rig[:3, :3] @ camera.rig_from_optical
        optical_m = np.einsum("nj,ji->ni", points_m, world_from_optical)
        rays = camera.ray_from_pixel(pixels_of_points(camera, optical_m, is_finite).positions_px)
        assert rays.origins_m is not None
        starts_m: NDArray[np.float64] = np.einsum("nj,ij->ni", rays.origins_m, world_from_optical)
        return starts_m

    def _placed(self, parts: list[NDArray[T]], otherwise: object) -> NDArray[T]:
        """Picture (height, width, …) of values (n, …) of the pixels that have a ray."""
        values = np.concatenate(parts)
        picture = np.empty((*self.has_ray.shape, *values.shape[1:]), dtype=values.dtype)
        picture[:] = otherwise
        picture[self.has_ray] = values
        return picture
