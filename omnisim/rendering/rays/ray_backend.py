"""Back end of rays: Embree casts one ray per sample of an image, without OpenGL."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import version
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, NonCentralCamera
from omnisim.core.arrays import Bools, Floats, Floats32
from omnisim.core.errors import GraphicsError
from omnisim.core.pending import Pending
from omnisim.core.random_numbers import key_of
from omnisim.core.world import ObjectPart
from omnisim.ground_truth.hits import (
    NO_DETAILS,
    HitDetails,
    Hits,
    LidarBeams,
    ScanBeams,
    ThroughHits,
)
from omnisim.rendering.camera.degradations.encoding import Encoding, eight_bits
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry, LinearImage
from omnisim.rendering.contract import (
    CameraBackend,
    CameraSetup,
    DeformingDraw,
    FrameRequest,
    HitSource,
    Readback,
    SceneBackend,
    ScenePoses,
    SubFrames,
)
from omnisim.rendering.degraded_camera import DegradedCamera
from omnisim.rendering.pixel_rays import Band, PixelRays, moved_points, starts_of_rays
from omnisim.rendering.rays.cast_beams import Beams, LidarCaster
from omnisim.rendering.rays.caster import DepthLimits
from omnisim.rendering.rays.ray_scene import ObjectState, RayScene
from omnisim.rendering.rays.scene_rays import CastCamera, CastScene, cast_hits, cast_occlusion
from omnisim.rendering.rays.shading.ray_optics import LightPaths
from omnisim.scene import Scene

_POINTS_PER_BATCH = 1 << 14

T = TypeVar("T", bound=np.generic)


class RayBackend(SceneBackend):
    """Triangle hierarchies and textures of a scene.

    Raises:
        OmnisimError: embreex is not installed.
    """

    def __init__(self, scene: Scene, objects: Mapping[str, Scene]):
        super().__init__(scene, objects)
        self._rays: CastScene | None = CastScene(scene, tuple(objects.values()))
        self._rays.ray_scene()

    @property
    def rays(self) -> CastScene:
        """Rays at the scene.

        Raises:
            GraphicsError: the back end is closed.
        """
        if self._rays is None:
            raise GraphicsError("this stage is closed: open a new one")
        return self._rays

    @property
    def is_open(self) -> bool:
        """False after `close`."""
        return self._rays is not None

    @property
    def renderer(self) -> str:
        """Name and version of the package that casts rays."""
        return f"embreex {version('embreex')}"

    @contextmanager
    def current(self) -> Iterator[None]:
        """Refuse to work after `close`; nothing else to prepare.

        Raises:
            GraphicsError: the back end is closed.
        """
        if self.is_open or self.rays:
            yield

    def update(self, scene: Scene) -> None:
        """Replace the static scene; all hierarchies are rebuilt."""
        self.rays.update(scene)
        self.scene = scene

    def camera(self, setup: CameraSetup) -> RayCamera:
        """Camera in the scene."""
        return RayCamera(self, setup)

    def range_finder(self, beams: ScanBeams, hidden: frozenset[ObjectPart]) -> Beams:
        """Beams of a scanner."""
        return self.rays.range_finder(beams, hidden)

    def beam_caster(self, beams: LidarBeams, hidden: frozenset[ObjectPart]) -> LidarCaster:
        """Beams of a spinning lidar."""
        return self.rays.beam_caster(beams, hidden)

    def close(self) -> None:
        """Free the memory."""
        self._rays = None


class RayCamera(CameraBackend):
    """Rays of one camera; rarely needed parts are created on first use.

    Of the virtual cameras' settings only near and far apply.
    """

    def __init__(self, world: RayBackend, setup: CameraSetup):
        super().__init__(world, setup)
        sensor = setup.sensor
        self._ray_world, self._sensor = world, sensor
        self._limits = DepthLimits(sensor.near_m, sensor.far_m)
        self._hit_source: RayHitSource | None = None
        self._images = self._ray_images()
        if not sensor.degradation.is_ideal:
            self._degraded = DegradedCamera(world, setup, self._develop).begin

    def refresh(self) -> None:
        """Adapt to the scene after it has changed."""
        self._images, self._hit_source = self._ray_images(), None

    def _ray_images(self) -> list[RayImage]:
        """Image, or one each for R, G and B."""
        sensor, samples = self._sensor, self._sensor.supersampled_model
        return [
            RayImage(
                self._ray_world.rays.ray_scene(),
                camera,
                sensor.mesh_polygons,
                sensor.supersampling,
                self._limits,
                self.setup.unlit,
            )
            for camera in (
                samples.by_color() if isinstance(samples, NonCentralCamera) else (samples,)
            )
        ]

    def _begin_ideal(self, request: FrameRequest) -> Pending[Readback]:
        light = self._linear(request.poses, request.frame_number)
        image = _readback(light, None, request.linear)
        return Pending(lambda: image)

    def _develop(self, frames: SubFrames) -> Pending[Readback]:
        """Render an image from sub-frames with the NumPy references of the degradations."""
        degradation = self._sensor.degradation
        geometry = ImageGeometry.of_camera(self._sensor.model)
        ideal = (
            (self._linear(part.poses, frames.frame_number, number), part.row_weights)
            for number, part in enumerate(frames.parts)
        )
        light = degradation.exposed(ideal, geometry)
        luminance = None if frames.meter is None else frames.meter.of_image(light)
        exposure = frames.expose(luminance)
        noise_key = key_of("noise", self.setup.seed)
        image = degradation.developed(
            light, geometry, exposure.factors, noise_key, exposure.frame_number
        )
        readback = _readback(image, degradation.encoding, frames.linear)
        return Pending(lambda: readback._replace(luminance=luminance))

    def hit_source(self, details: HitDetails) -> RayHitSource:
        """Hits behind its ground truth."""
        if self._hit_source is None:
            self._hit_source = RayHitSource(self._ray_world.rays.ray_scene(), self.setup)
        return self._hit_source

    def faces(self, poses: ScenePoses) -> dict[str, Floats32]:
        """Refuse: there are no virtual cameras.

        Raises:
            GraphicsError: always.
        """
        raise GraphicsError("faces: back end 'rays' has none: expected 'cube'")

    def _linear(self, poses: ScenePoses, frame_number: int, sub_frame: int = 0) -> LinearImage:
        objects = ObjectState(poses.world_from_objects, self.setup.hidden)
        key = key_of("reflections", self.setup.seed, frame_number, sub_frame)
        found = [image.render(poses.world_from_rig, objects, key) for image in self._images]
        if len(found) == 1:
            return found[0]
        red, green, blue = found
        valid = green[..., 3] > 0.0
        green[valid, 0], green[valid, 2] = red[valid, 0], blue[valid, 2]
        return green


class RayImage:
    """Image of an ideal camera, of `supersampling`² samples per pixel; constants are made once."""

    def __init__(
        self,
        scene: RayScene,
        samples: CentralCamera,
        polygons: int | None,
        supersampling: int,
        limits: DepthLimits,
        unlit: bool = False,
    ):
        self._scene, self._limits, self._unlit = scene, limits, unlit
        self._supersampling = supersampling
        self._rays = PixelRays(samples, polygons, supersampling)

    def render(self, world_from_rig: Floats, objects: ObjectState, key: int = 0) -> Floats32:
        """Render the image (height, width, 4) from a pose (4, 4): linear RGB, and validity.

        A pixel is valid if at least half of its samples are. The key is that of the random numbers
        of glossy reflections.
        """

        def rows_of(number: int) -> Floats32:
            band = self._rays.band(number)
            return self._average(self._sampled(band, world_from_rig, objects, key))

        return np.concatenate(self._scene.in_threads(rows_of, range(len(self._rays.bands))))

    def _sampled(
        self, band: Band, world_from_rig: Floats, objects: ObjectState, key: int
    ) -> Floats32:
        """Samples (rows, width, 4) of a band: linear RGB, and validity."""
        camera = self._rays.camera
        rays, footprints = self._limits.aim_band(band, camera.rig_from_optical, world_from_rig)
        # pixels of the samples, and the samples' numbers in them
        rows, columns = np.nonzero(band.valid)
        rows, side = rows + band.rows.start, self._supersampling
        pixels = rows // side * (camera.width_px // side + 1) + columns // side
        numbers = (rows % side * side + columns % side).astype(np.uint32)
        ones = np.ones(len(rows), dtype=np.float32)
        paths = LightPaths(pixels.astype(np.uint32), numbers, ones, key)
        samples = np.zeros((*band.valid.shape, 4), dtype=np.float32)
        samples[band.valid, :3] = self._scene.radiance(
            rays, footprints, objects, self._unlit, paths
        )
        samples[band.valid, 3] = 1.0
        return samples

    def _average(self, samples: Floats32) -> Floats32:
        """Pixels (height, width, 4): averages of the samples that cover them."""
        side = self._supersampling
        height, width = (size // side for size in samples.shape[:2])
        covering = samples[: height * side, : width * side].reshape(height, side, width, side, 4)
        total: Floats32 = covering.sum(axis=(1, 3))
        counts = total[..., 3]
        valid = 2.0 * counts >= side * side
        pixels = np.zeros_like(total)
        pixels[valid, :3] = total[valid, :3] / counts[valid, None]
        pixels[valid, 3] = 1.0
        return pixels


class RayHitSource(HitSource):
    """Exact hits of the pixels' rays by Embree, in float64; the last are kept for occlusion."""

    def __init__(self, scene: RayScene, setup: CameraSetup):
        geometry, sensor = scene.caster.geometry, setup.sensor
        self.camera, self.polygons, self.draws = sensor.model, sensor.mesh_polygons, geometry.draws
        self.deforming = {
            deforming.number: DeformingDraw(
                deforming.mesh,
                geometry.surfaces[deforming.number].object_index,
                deforming.instance.world_from_mesh,
            )
            for deforming in geometry.deforming
        }
        self._scene, self._hidden = scene, setup.hidden
        self._camera_rays = CastCamera(lambda: scene, setup)
        self._numbers = {part: 1 + number for number, part in enumerate(self.draws)}
        self._limits, self._pixels = self._camera_rays.limits, self._camera_rays.pixels
        self._bands = range(len(self._pixels.bands))
        self.has_ray = np.concatenate([self._pixels.band(number).valid for number in self._bands])
        # of the last hits, by the pixels that have a ray
        self._points_m = np.empty((0, 3))
        self._draw_ids, self._triangles = np.empty((2, 0), dtype=np.uint32)

    def rays(self) -> Floats:
        """Unit rays (height, width, 3), optical frame."""
        return self._placed([self._pixels.band(number).directions for number in self._bands], 0.0)

    def hits(self, poses: ScenePoses, details: HitDetails = NO_DETAILS) -> Hits:
        """Cast all rays."""
        objects = ObjectState(poses.world_from_objects, self._hidden)
        viewpoint_m = poses.world_from_rig[:3, 3]

        def of_band(number: int) -> Hits:
            aimed = self._limits.aim_band(
                self._pixels.band(number), self.camera.rig_from_optical, poses.world_from_rig
            )
            return cast_hits(self._scene, *aimed, viewpoint_m, objects, details)

        hits = self._scene.in_threads(of_band, self._bands)
        self._points_m = np.concatenate([hit.points_m for hit in hits]).astype(np.float64)
        self._draw_ids = np.concatenate([hit.draw_ids for hit in hits])
        self._triangles = np.concatenate([hit.triangles for hit in hits])
        none = np.empty((0, self.has_ray.shape[1], 3), dtype=np.float32)
        arrays = dict.fromkeys(details._fields, none)
        for name in details.components:
            arrays[name] = self._placed([getattr(hit, name) for hit in hits], 0.0)
        return Hits(
            self._placed([hit.points_and_ranges_m for hit in hits], (0.0, 0.0, 0.0, np.inf)),
            self._placed([hit.draw_ids for hit in hits], 0),
            self._placed([hit.triangles for hit in hits], 0),
            **arrays,
        )

    def through(self, poses: ScenePoses, hits: Hits) -> ThroughHits:
        """Surfaces behind glass and after mirrors."""
        is_specular = self._scene.shading.is_specular
        return self._camera_rays.through(poses, hits, is_specular, self._numbers)

    def begin_occlusion(
        self, other: ScenePoses, other_from_current: Floats, deformed: Hits | None
    ) -> Pending[Bools]:
        """Cast rays from another viewpoint to the points of the last hits."""
        if deformed is not None:
            self._points_m = deformed.points_m[self.has_ray].astype(np.float64)
        objects, pose = ObjectState(other.world_from_objects, self._hidden), other.world_from_rig

        def of_batch(first: int) -> Bools:
            own = slice(first, first + _POINTS_PER_BATCH)
            draw_ids = self._draw_ids[own]
            points_m = moved_points(self._points_m[own], draw_ids, other_from_current)
            starts_m = starts_of_rays(self.camera, points_m, draw_ids > 0, pose)
            return cast_occlusion(
                self._scene, self._limits, points_m, draw_ids.astype(np.intp),
                self._triangles[own], starts_m, pose, objects,
            )  # fmt: skip

        firsts = range(0, len(self._draw_ids), _POINTS_PER_BATCH)
        none = np.empty(0, dtype=np.bool_)
        occluded = self._placed([none, *self._scene.in_threads(of_batch, firsts)], False)
        return Pending(lambda: occluded)

    def _placed(self, parts: list[NDArray[T]], otherwise: object) -> NDArray[T]:
        """Image (height, width, …) from values (n, …) of the pixels that have a ray."""
        values = np.concatenate(parts)
        image = np.empty((*self.has_ray.shape, *values.shape[1:]), dtype=values.dtype)
        image[:] = otherwise
        image[self.has_ray] = values
        return image


def _readback(image: LinearImage, encoding: Encoding | None, linear: bool) -> Readback:
    floats = np.ascontiguousarray(image[..., :3]) if linear else None
    return Readback(eight_bits(image, encoding), floats)
