"""Hits of pixels' rays: first surfaces, occlusion, all layers, and what mirrors and panes show.

`CastScene` and `CastCamera`, at the end, are what a back end that draws asks for: what it cannot
see from its viewpoint, in plain arrays.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Bools, Floats, Floats32, Indices, Ints, Ints32, Uints32
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
from omnisim.rendering.rays.caster import NO_TRIANGLE, DepthLimits, WorldRays
from omnisim.rendering.rays.geometry import Geometry
from omnisim.rendering.rays.ray_scene import MAX_LAYERS, ObjectState, RayScene
from omnisim.rendering.rays.shading.ray_optics import MAX_BOUNCES
from omnisim.rendering.rays.shading.shading import RayView
from omnisim.rendering.rays.shading.surface_light import mirrored_rays, surface_light
from omnisim.scene import Scene

# A hit that is nearer than the point by more than this share occludes it, as in occlusion.frag.
_NEARER = 1e-3


def cast_hits(
    scene: RayScene,
    rays: WorldRays,
    footprints: Floats32,
    viewpoint_m: Floats,
    objects: ObjectState,
    details: HitDetails,
) -> Hits:
    """Cast rays (n,) and return hits with points relative to a viewpoint (3,).

    Args:
        rays: (n,) world.
        footprints: (n, 2, 3), see `RayScene.radiance`.
        viewpoint_m: (3,) world.
        details: surface details to compute; the others are empty.
    """
    poses, geometry, shading = objects.world_from_objects, scene.caster.geometry, scene.shading
    first = scene.first_hits(rays, objects, footprints=footprints)
    hit = np.flatnonzero(first.triangles != NO_TRIANGLE)
    some = rays.take(hit)
    exact = scene.caster.exact(some, first.take(hit), poses)
    points = np.empty((len(first.triangles), 4), dtype=np.float32)
    points[:, :3], points[:, 3] = rays.directions, np.inf
    from_viewpoint_m = some.origins_m - viewpoint_m
    points[hit, :3] = from_viewpoint_m + exact.ranges_m[:, None] * some.directions
    points[hit, 3] = exact.ranges_m
    draw_ids, triangles = np.zeros((2, len(points)), dtype=np.uint32)
    surfaces = shading.surfaces(exact)
    draw_ids[hit] = surfaces + 1
    triangles[hit] = exact.triangles - geometry.first_of_surface[surfaces]
    view = RayView(some, exact, poses, footprints[hit])
    find: dict[str, Callable[[], Floats32]] = {
        "normals": lambda: shading.normals(exact, poses),
        "albedos": lambda: shading.base_colors(view)[:, :3],
        "materials": lambda: shading.materials(view),
    }
    values = {name: np.empty((0, 0), dtype=np.float32) for name in find}
    for name, numbers in details.components.items():
        values[name] = np.zeros((len(points), numbers), dtype=np.float32)
        values[name][hit] = find[name]()
    return Hits(points, draw_ids, triangles, **values)


def cast_occlusion(
    scene: RayScene,
    limits: DepthLimits,
    points_m: Floats,
    surfaces_plus_one: Indices,
    triangles: Uints32,
    starts_m: Floats,
    world_from_rig: Floats,
    objects: ObjectState,
) -> Bools:
    """Mask (n,) of points that rays from starts (n, 3) do not reach.

    Args:
        points_m, starts_m: (n, 3) viewpoint frame; directions for points without a hit.
        surfaces_plus_one: (n,) 1 + index into the geometry's surfaces; 0: no hit.
        triangles: (n,) indices into the surfaces' meshes.
    """
    hit, ways_m = np.flatnonzero(surfaces_plus_one), points_m.copy()
    ways_m[hit] -= starts_m[hit]
    ends_m, lengths_m = np.full(len(ways_m), np.inf), np.linalg.norm(ways_m, axis=1)
    ends_m[hit] = (1.0 - _NEARER) * lengths_m[hit]
    rig = np.einsum("nj,ji->ni", ways_m / lengths_m[:, None], world_from_rig[:3, :3])
    rays = limits.aim(rig, world_from_rig)
    rays = rays._replace(origins_m=rays.origins_m + starts_m, far_m=np.minimum(rays.far_m, ends_m))
    firsts = scene.caster.geometry.first_of_surface[surfaces_plus_one - 1]
    own = firsts.astype(np.int32) + triangles.astype(np.int32)
    return scene.first_hits(rays, objects, own).triangles != NO_TRIANGLE


def whole_areas_px(
    scene: RayScene,
    pixels: PixelRays,
    limits: DepthLimits,
    world_from_rig: Floats,
    objects: ObjectState,
    instance_of_surface: NDArray[np.integer],
    instances: NDArray[np.integer],
) -> Ints:
    """Number of pixels (n,) whose rays pass through each instance, by ID; 0 is no instance.

    Rays continue through all surfaces, up to the extent of the scene. Surfaces count as in
    `RayScene.first_hits`. A pixel that shows an instance always counts for it.

    Args:
        world_from_rig: (4, 4) pose of the camera's rig.
        instance_of_surface: (surfaces,) ID of each surface of the geometry.
        instances: (height, width) ID shown in each pixel, the channel `instance`.
    """
    count = 1 + int(max(instance_of_surface.max(initial=0), instances.max(initial=0)))

    def of_band(number: int) -> Ints:
        band = pixels.band(number)
        aimed = limits.aim_band(band, pixels.camera.rig_from_optical, world_from_rig)
        layers = _surfaces_along(scene, *aimed, objects)
        # one number per pair of pixel and instance
        pairs = [row * count + instance_of_surface[surface] for row, surface in layers]
        shown = instances[band.rows][band.valid]
        pairs.append(np.arange(len(shown)) * count + shown)
        return np.bincount(np.unique(np.concatenate(pairs)) % count, minlength=count)

    of_bands = scene.in_threads(of_band, range(len(pixels.bands)))
    areas: Ints = np.stack(of_bands).sum(axis=0)
    areas[0] = 0
    return areas


def _surfaces_along(
    scene: RayScene, rays: WorldRays, footprints: Floats32, objects: ObjectState
) -> list[tuple[Indices, NDArray[np.integer]]]:
    """Rays and the surfaces they meet, layer by layer, nearest first."""
    layers: list[tuple[Indices, NDArray[np.integer]]] = []
    active, behind = np.arange(len(rays.near_m)), None
    for _ in range(MAX_LAYERS):
        hits = scene.first_hits(rays, objects, behind, footprints[active])
        kept = np.flatnonzero(hits.triangles != NO_TRIANGLE)
        if len(kept) == 0:
            break
        active, rays, hits = active[kept], rays.take(kept), hits.take(kept)
        layers.append((active, scene.shading.surfaces(hits)))
        behind = hits.triangles
        rays = scene.caster.behind(rays, hits.ranges_m)
    return layers


# Surfaces that rays reach through panes and by mirrors. Rays pass panes, and continue after
# surfaces that reflect more than half of the light: the picture shows what is behind them. Others
# end there, such as a polished floor that is not grazed.


MAX_PANES = 32  # along a path, with its mirrors
MIN_REFLECTED = 0.5  # reflected share of the light, mean of linear RGB, of a mirror


class RayEnds(NamedTuple):
    """Surfaces (n,) at the ends of rays, as in `ThroughHits`."""

    ranges_m: Floats
    surfaces_plus_one: Uints32
    cosines: Floats
    shares: Floats


def cast_through(
    scene: RayScene, rays: WorldRays, objects: ObjectState, footprints: Floats32
) -> RayEnds:
    """Surfaces at the ends of rays (n,) with footprints (n, 2, 3), see `RayScene.first_hits`."""
    poses, shading, count = objects.world_from_objects, scene.shading, len(rays.near_m)
    ends = RayEnds(
        np.full(count, np.inf),
        np.zeros(count, dtype=np.uint32),
        np.full(count, np.nan),
        np.ones(count),
    )
    active, behind = np.arange(count), np.full(count, NO_TRIANGLE, dtype=np.int32)
    bounces = np.zeros(count, dtype=np.intp)
    for number in range(MAX_PANES):
        hits = scene.first_hits(rays, objects, behind, footprints)
        hit = np.flatnonzero(hits.triangles != NO_TRIANGLE)
        active, rays, footprints = active[hit], rays.take(hit), footprints[hit]
        if len(active) == 0:
            break
        hits = scene.caster.exact(rays, hits.take(hit), poses)
        light = surface_light(shading, RayView(rays, hits, poses, footprints))
        passed, reflected = light.passed.mean(axis=1), light.reflected.mean(axis=1)
        passes = passed > 0.0
        mirrors = ~passes & (reflected > MIN_REFLECTED) & (bounces[active] < MAX_BOUNCES)
        if number == MAX_PANES - 1:
            passes = mirrors = np.zeros_like(passes)
        here = ~(passes | mirrors)
        ends.ranges_m[active[here]] = hits.ranges_m[here]
        ends.surfaces_plus_one[active[here]] = shading.surfaces(hits)[here] + 1
        ends.cosines[active[here]] = light.cosines[here]
        bounces[active[mirrors]] += 1
        ends.shares[active[passes]] *= passed[passes]
        ends.shares[active[mirrors]] *= reflected[mirrors]
        some = np.flatnonzero(mirrors)
        mirrored = mirrored_rays(scene.caster, rays.take(some), hits.take(some), light.take(some))
        rays = WorldRays(*(values.copy() for values in scene.caster.behind(rays, hits.ranges_m)))
        for values, new in zip(rays, mirrored, strict=True):
            values[some] = new
        normals, footprints = light.normals[some], footprints.copy()
        heights = np.einsum("nsc,nc->ns", footprints[some], normals)
        footprints[some] -= (2.0 * heights[..., None] * normals[:, None]).astype(np.float32)
        on = np.flatnonzero(~here)
        active, behind = active[on], hits.triangles[on]
        rays, footprints = rays.take(on), footprints[on]
    return ends


# Rays for a back end that draws: what it cannot see from its viewpoint, in plain arrays.


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
        PlacedMesh(
            surface.object_index, surface.name, surface.object_from_mesh.tobytes(), int(count)
        ): first
        for surface, first, count in zip(
            geometry.surfaces,
            geometry.first_of_surface,
            np.diff(geometry.first_of_surface),
            strict=False,
        )
    }
    return np.array([numbers.get(draw, 0) for draw in draws], dtype=np.int32)
