"""Rays for a back end that draws: what it cannot see from its viewpoint, in plain arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np

from omnisim.core.arrays import Bools, Floats, Floats32, Ints32, Uints32
from omnisim.core.world import ObjectPart
from omnisim.ground_truth.hits import (
    BeamHits,
    HitDetails,
    Hits,
    LidarBeams,
    Revolution,
    ScanBeams,
    ThroughHits,
)
from omnisim.rendering.contract import CameraRays, CameraSetup, PlacedMesh, ScenePoses, SceneRays
from omnisim.rendering.pixel_rays import Band, PixelRays
from omnisim.rendering.rays.cast_beams import Beams, LidarCaster, intensities_of
from omnisim.rendering.rays.caster import DepthLimits
from omnisim.rendering.rays.geometry import Geometry
from omnisim.rendering.rays.pixel_hits import cast_hits, cast_occlusion, cast_through
from omnisim.rendering.rays.ray_scene import ObjectState, RayScene
from omnisim.scene import Scene

_RAYS_PER_BATCH = 1 << 12


class CastScene(SceneRays):
    """Rays at a scene, which is prepared on first use after an edit.

    Args:
        scene: static scene.
        objects: dynamic objects.
    """

    def __init__(self, scene: Scene, objects: Sequence[Scene]):
        self._objects = objects
        self.update(scene)

    def update(self, scene: Scene) -> None:
        """Replace the static scene."""
        self._scene = scene
        self._built: RayScene | None = None
        self._first_triangles: tuple[Sequence[PlacedMesh], Ints32] | None = None

    def surfaces(self) -> RayScene:
        """Scene whose surfaces can be looked up, without embreex."""
        if self._built is None:
            self._built = RayScene(self._scene, self._objects)
        return self._built

    def ray_scene(self) -> RayScene:
        """Scene to cast rays at.

        Raises:
            OmnisimError: embreex is not installed.
        """
        scene = self.surfaces()
        scene.caster.prepare()
        return scene

    def range_finder(self, beams: ScanBeams, hidden: frozenset[ObjectPart]) -> Beams:
        """Beams of a scanner."""
        return Beams(self.ray_scene, beams, hidden)

    def beam_caster(self, beams: LidarBeams, hidden: frozenset[ObjectPart]) -> LidarCaster:
        """Beams of a spinning lidar."""
        return LidarCaster(self.ray_scene, beams, hidden)

    def with_intensities(
        self, beams: LidarBeams, revolution: Revolution, draws: Sequence[PlacedMesh], hits: BeamHits
    ) -> BeamHits:
        """Drawn hits of a revolution with the intensities of their surfaces."""
        scene = self.surfaces()
        if self._first_triangles is None or self._first_triangles[0] is not draws:
            # preceded by one for beams without a hit
            firsts = np.insert(_first_triangles(scene.caster.geometry, draws), 0, 0)
            self._first_triangles = draws, firsts
        assert hits.triangles is not None
        triangles = hits.triangles + self._first_triangles[1][hits.draw_ids]
        return hits._replace(
            intensities=intensities_of(scene, beams, revolution, hits.draw_ids, triangles)
        )

    def camera(self, setup: CameraSetup) -> CastCamera:
        """Rays of a camera's pixels."""
        return CastCamera(self.ray_scene, setup)


class CastCamera(CameraRays):
    """Rays of one camera at the current scene.

    Args:
        scene: function that returns the scene in its current state.
        setup: the camera.

    Attributes:
        limits: limits of the depth that it sees.
    """

    def __init__(self, scene: Callable[[], RayScene], setup: CameraSetup):
        self._scene, self._setup = scene, setup
        self.limits = DepthLimits(setup.sensor.near_m, setup.sensor.far_m)
        self._rig_from_optical = setup.sensor.model.rig_from_optical

    @cached_property
    def pixels(self) -> PixelRays:
        """Rays of its pixels."""
        return PixelRays(self._setup.sensor.model, self._setup.sensor.mesh_polygons)

    def radiance(
        self, poses: ScenePoses, origins_m: Floats, directions: Floats, footprints: Floats32
    ) -> Floats32:
        """Linear RGB (n, 3) along rays (n,), rig frame."""
        scene, rotation = self._scene(), poses.world_from_rig[:3, :3]
        aimed = self.limits.aim(directions, poses.world_from_rig)
        offsets_m = np.einsum("nj,ij->ni", origins_m, rotation)
        aimed = aimed._replace(origins_m=aimed.origins_m + offsets_m)
        footprints = np.einsum("nsj,ij->nsi", footprints, rotation.astype(np.float32))
        objects = self._objects(poses)

        def of_batch(first: int) -> Floats32:
            batch = np.arange(first, min(first + _RAYS_PER_BATCH, len(footprints)))
            return scene.radiance(aimed.take(batch), footprints[batch], objects, self._setup.unlit)

        return np.concatenate(
            scene.in_threads(of_batch, range(0, len(footprints), _RAYS_PER_BATCH))
        )

    def hits(
        self,
        poses: ScenePoses,
        band: Band,
        viewpoint_m: Floats,
        numbers: Mapping[ObjectPart, int],
        details: HitDetails,
    ) -> Hits:
        """Hits (n,) of a band's rays, relative to a viewpoint (3,), world."""
        scene = self._scene()
        aimed = self.limits.aim_band(band, self._rig_from_optical, poses.world_from_rig)
        hits = cast_hits(scene, *aimed, viewpoint_m, self._objects(poses), details)
        return hits._replace(draw_ids=_draws_of_surfaces(scene, numbers)[hits.draw_ids])

    def occluded(
        self,
        poses: ScenePoses,
        starts_m: Floats,
        points_m: Floats,
        draw_ids: Uints32,
        triangles: Uints32,
        numbers: Mapping[ObjectPart, int],
    ) -> Bools:
        """Mask (n,) of the points of hits that rays from starts (n, 3) do not reach."""
        scene = self._scene()
        draws = _draws_of_surfaces(scene, numbers)
        surface_of_draw = np.zeros(1 + max(numbers.values(), default=0), dtype=np.intp)
        surface_of_draw[draws] = np.arange(len(draws))
        surface_of_draw[0] = 0
        return cast_occlusion(
            scene, self.limits, points_m, surface_of_draw[draw_ids], triangles, starts_m,
            poses.world_from_rig, self._objects(poses),
        )  # fmt: skip

    def through(
        self, poses: ScenePoses, hits: Hits, is_specular: Bools, numbers: Mapping[ObjectPart, int]
    ) -> ThroughHits:
        """Surfaces behind glass and after mirrors, given the first hits."""
        through = ThroughHits.of_first(hits)
        wanted = np.concatenate(([False], is_specular))[hits.draw_ids]
        if not wanted.any():
            return through
        scene, pixels, objects = self._scene(), self.pixels, self._objects(poses)
        draws = _draws_of_surfaces(scene, numbers)

        def cast_band(number: int) -> None:
            rows = pixels.bands[number]
            if not wanted[rows].any():
                return
            band = pixels.band(number)
            some = np.flatnonzero(wanted[rows][band.valid])
            rays, footprints = self.limits.aim_band(
                band, self._rig_from_optical, poses.world_from_rig
            )
            ends = cast_through(scene, rays.take(some), objects, footprints[some])
            rows_hit, columns = (axis[some] for axis in np.nonzero(band.valid))
            places = rows.start + rows_hit, columns
            through.ranges_m[places] = ends.ranges_m
            through.draw_ids[places] = draws[ends.surfaces_plus_one]
            through.cosines[places], through.shares[places] = ends.cosines, ends.shares

        scene.in_threads(cast_band, range(len(pixels.bands)))
        return through

    def _objects(self, poses: ScenePoses) -> ObjectState:
        return ObjectState(poses.world_from_objects, self._setup.hidden)


def _draws_of_surfaces(scene: RayScene, numbers: Mapping[ObjectPart, int]) -> Uints32:
    """Draw IDs (1 + surfaces,) of the scene's surfaces, after 0 for none."""
    parts = scene.caster.geometry.draws
    return np.array([0, *(numbers.get(part, 0) for part in parts)], dtype=np.uint32)


def _first_triangles(geometry: Geometry, draws: Sequence[PlacedMesh]) -> Ints32:
    """First triangle of each of some instances; 0 for those that are not in the geometry."""
    numbers = {
        PlacedMesh(one.object_index, one.name, one.object_from_mesh.tobytes(), int(count)): first
        for one, first, count in zip(
            geometry.surfaces,
            geometry.first_of_surface,
            np.diff(geometry.first_of_surface),
            strict=False,
        )
    }
    return np.array([numbers.get(one, 0) for one in draws], dtype=np.int32)
