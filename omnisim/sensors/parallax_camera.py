"""Optical systems on the back end of virtual cameras: one viewpoint, and range for the rest."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cube import face_index, face_tangents
from omnisim.errors import GraphicsError
from omnisim.extras import missing_packages, require_extra
from omnisim.gpu.atlas.sampling_density import (
    MAX_ANISOTROPY,
    MIN_DENSITY_SHARE,
    RegionDensity,
)
from omnisim.gpu.atlas.tile_plan import TilePlan, plan_regions
from omnisim.gpu.capture.parallax_pass import ParallaxPass, ViewpointRays
from omnisim.gpu.capture.pixel_map import PixelMap
from omnisim.gpu.degradation.degradation_pass import DegradationPass
from omnisim.gpu.parallax_pipeline import ParallaxPipeline
from omnisim.gpu.pipeline import DegradedPipeline, Readback, ScenePoses
from omnisim.gpu.scene.cube_pass import CubePass
from omnisim.gpu.scene.scene_buffers import SceneBuffers
from omnisim.gpu.scene.surface_program import SurfacePrograms
from omnisim.gpu.scene.tile_renderer import VirtualCameras
from omnisim.optics.centrality import common_point
from omnisim.sensors.backend import CameraBackend, CameraSetup, FrameRequest, SceneBackend
from omnisim.sensors.degradations.picture_geometry import PictureGeometry
from omnisim.sensors.degradations.random_numbers import key_of
from omnisim.sensors.degraded_camera import DegradedCamera, object_corners_m
from omnisim.sensors.hit_source import HitSource
from omnisim.sensors.omnicamera import OmniCamera
from omnisim.sensors.sample_rays import SampleRays, sample_rays
from omnisim.sensors.tiles import ONE_SAMPLE_BIAS, SUPERSAMPLED_BIAS

if TYPE_CHECKING:
    from omnisim.rays.ray_scene import RayScene

_PARTS = 2  # of a face, to a side: tiles of different density
_NEAREST_M = (0.05, 0.1, 0.2, 0.5, 2.0, 1e9)  # lengths along the rays that faces are kept for


class Drawn(NamedTuple):
    """Scene on the GPU."""

    buffers: SceneBuffers
    programs: SurfacePrograms


class ParallaxCamera(CameraBackend):
    """Passes of one optical system.

    The virtual cameras stand at the point nearest to all rays; each sample looks up range until it
    has met its own surface. Samples in doubt are cast as rays, where those are installed, or keep
    what they found last; the picture's metadata counts them. Ground truth is that of rays.

    Raises:
        GraphicsError: several samples a texel, or past the GPU's limits.
    """

    def __init__(self, world: SceneBackend, drawn: Drawn, setup: CameraSetup):
        super().__init__(world, setup)
        sensor = setup.sensor
        if sensor.samples > 1:
            raise GraphicsError(
                f"virtual_cameras.samples: expected 1 for an optical system, got {sensor.samples}"
            )
        self._sensor, context = sensor, drawn.buffers.context
        self._rays: RayScene | None = None
        self._samples = sample_rays(sensor.model, sensor.supersampling, sensor.mesh_polygons)
        seen = self._samples.valid
        if not seen.any():
            raise GraphicsError("camera: no pixel of the picture sees anything of the scene")
        rig_from_optical = sensor.model.rig_from_optical.astype(np.float32)
        directions = self._samples.directions @ rig_from_optical.T
        origins_m = self._samples.origins_m @ rig_from_optical.T
        every = slice(None, None, max(1, int(seen.sum()) // 10_000))
        viewpoint_m = common_point(
            origins_m[seen][every].astype(np.float64), directions[seen][every].astype(np.float64)
        )
        origins_m -= viewpoint_m.astype(np.float32)
        rays = ViewpointRays(directions, origins_m, seen)
        is_ideal = sensor.degradation.is_ideal
        self._cube = CubePass(
            drawn.buffers,
            drawn.programs,
            _plan(rays, sensor),
            VirtualCameras(
                sensor.near_m, sensor.far_m, 1, setup.unlit, world.scene.background, setup.hidden
            ),
        )
        parallax = ParallaxPass(
            context, rays, self._cube.plan, sensor.supersampling, sensor.near_m, sensor.far_m
        )
        self._casts = not missing_packages("rays")
        self._pipeline = ParallaxPipeline(
            self._cube,
            PixelMap(context, sensor.supersampled_model),
            parallax,
            viewpoint_m,
            self._cast if self._casts else None,
            sensor.supersampling,
            "f2" if is_ideal else "f4",
        )
        self._degraded = None if is_ideal else self._degraded_camera()
        self._hit_source: HitSource | None = None

    def refresh(self) -> None:
        """Draw what the buffers have now."""
        self._cube.refresh()
        self._rays = self._hit_source = None

    def take(self, request: FrameRequest) -> tuple[Readback, dict[str, Any]]:
        """Take a picture; also return the metadata of its degradation and undecided samples."""
        self._pipeline.undecided_samples = 0
        if self._degraded is not None:
            picture, metadata = self._degraded.take(request)
            found: dict[str, Any] = {"degradation": metadata}
        else:
            picture, found = self._pipeline.render(request.poses, request.linear), {}
        undecided = {"samples": self._pipeline.undecided_samples, "cast": self._casts}
        return picture, {**found, "undecided": undecided}

    def hit_source(self, albedo: bool) -> HitSource:
        """Source of its ground truth: rays.

        Raises:
            OmnisimError: they are not installed.
        """
        require_extra("rays", "ground truth of an optical system")
        from omnisim.rays.depth_limits import DepthLimits
        from omnisim.sensors.ray_backend import RayHitSource

        if self._hit_source is None:
            limits = DepthLimits(self._sensor.near_m, self._sensor.far_m)
            self._hit_source = RayHitSource(self._ray_scene(), self.setup, limits)
        return self._hit_source

    def faces(self, poses: ScenePoses) -> dict[str, NDArray[np.float32]]:
        """Refuse them: the virtual cameras are parts of faces.

        Raises:
            GraphicsError: always.
        """
        raise GraphicsError("faces: expected a camera with one viewpoint, got an optical system")

    def _ray_scene(self) -> RayScene:
        from omnisim.rays.ray_scene import RayScene  # of an extra

        if self._rays is None:
            self._rays = RayScene(self.world.scene, tuple(self.world.objects.values()))
        return self._rays

    def _cast(self, poses: ScenePoses, samples: NDArray[np.intp]) -> NDArray[np.float32]:
        """Linear RGB (n, 3) of samples (n,), by their own rays."""
        from omnisim.rays.depth_limits import DepthLimits
        from omnisim.rays.pixel_rays import Band
        from omnisim.rays.ray_scene import ObjectState

        found, rig_from_optical = self._samples, self._sensor.model.rig_from_optical
        directions = found.directions.reshape(-1, 3)[samples].astype(np.float64)
        origins_m = found.origins_m.reshape(-1, 3)[samples].astype(np.float64)
        band = Band(slice(0), found.valid, directions, origins_m, _footprints(found, samples))
        limits = DepthLimits(self._sensor.near_m, self._sensor.far_m)
        return self._ray_scene().radiance(
            band.aim(limits, rig_from_optical, poses.world_from_rig),
            band.world_footprints(poses.world_from_rig[:3, :3] @ rig_from_optical),
            ObjectState(poses.world_from_objects, self.setup.hidden),
            self.setup.unlit,
        )

    def _degraded_camera(self) -> DegradedCamera:
        sensor, seed = self._sensor, self.setup.seed
        degradation, geometry = sensor.degradation, PictureGeometry.of_camera(sensor.model)
        passes = DegradationPass(
            self._pipeline.context,
            (geometry.width_px, geometry.height_px),
            degradation.optics_steps(geometry),
            degradation.sensor_steps(geometry, key_of("noise", seed)),
            degradation.encoding_step(),
        )
        corners_m = object_corners_m(self.world.objects.values())
        return DegradedCamera(sensor, seed, DegradedPipeline(self._pipeline, passes), corners_m)


def _plan(rays: ViewpointRays, sensor: OmniCamera) -> TilePlan:
    """Parts of faces that the rays' points, near and far, are seen in from the viewpoint."""
    side = sensor.supersampling
    directions, origins_m = (x[::side, ::side].astype(np.float64) for x in rays[:2])
    valid = rays.valid[::side, ::side]
    right = directions[:-1, 1:] - directions[:-1, :-1]
    down = directions[1:, :-1] - directions[:-1, :-1]
    whole = valid[:-1, :-1] & valid[:-1, 1:] & valid[1:, :-1]
    if not whole.any():
        raise GraphicsError("camera: the picture shows too little of the scene")
    steps = np.linalg.svd(np.stack((right, down), axis=-1)[whole], compute_uv=False) / side
    narrowest = np.maximum(steps[:, 1], steps[:, 0] / MAX_ANISOTROPY)
    seen, origins_m = directions[:-1, :-1][whole], origins_m[:-1, :-1][whole]
    found: dict[tuple[int, int, int], tuple[float, float]] = {}
    for length_m in _NEAREST_M:
        places = origins_m + length_m * seen
        faces = face_index(places)
        for face in np.flatnonzero(np.bincount(faces)).tolist():
            on_it = np.flatnonzero(faces == face)
            tangents = face_tangents(places[on_it], face)
            columns, rows = np.clip((0.5 * _PARTS * (tangents + 1.0)).astype(int), 0, _PARTS - 1).T
            parts = columns * _PARTS + rows
            for part in np.flatnonzero(np.bincount(parts)).tolist():
                column, row = divmod(part, _PARTS)
                within = parts == part
                some = on_it[within]
                # a face's tangents grow faster than angles away from its middle
                here = 1.0 + np.square(tangents[within]).sum(axis=1)
                most = float((1.0 / (narrowest[some] * np.sqrt(here))).max())
                least = float((1.0 / (steps[some, 0] * here)).min())
                before = found.get((face, column, row), (np.inf, 0.0))
                found[face, column, row] = min(least, before[0]), max(most, before[1])
    highest = max(most for _, most in found.values())
    regions = []
    for (face, column, row), (least, most) in found.items():
        first = -1.0 + 2.0 / _PARTS * np.array([column, row])
        region = np.stack((first, first + 2.0 / _PARTS))
        density = RegionDensity(max(least, MIN_DENSITY_SHARE * highest), most, region, region)
        regions.append((face, density))
    bias = ONE_SAMPLE_BIAS if side == 1 else SUPERSAMPLED_BIAS
    return plan_regions(regions, sensor.texels_per_pixel / side, bias)


def _footprints(rays: SampleRays, samples: NDArray[np.intp]) -> NDArray[np.float32]:
    """Steps (n, 2, 3) of directions to the next samples right and below; 0: there is none."""
    directions, valid = rays.directions.reshape(-1, 3), rays.valid.ravel()
    found = np.zeros((len(samples), 2, 3), dtype=np.float32)
    for axis, step in enumerate((1, rays.valid.shape[1])):
        beside = np.minimum(samples + step, len(valid) - 1)
        has_next = valid[beside]
        steps = directions[beside[has_next]] - directions[samples[has_next]]
        found[has_next, axis] = steps
    return found
