"""Back end of virtual cameras: OpenGL renders cube faces, and samples images from them."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import NonCentralCamera
from omnisim.core.errors import GraphicsError
from omnisim.core.world import ObjectPart
from omnisim.ground_truth.hits import NO_DETAILS, HitDetails, Hits
from omnisim.rendering.backend import (
    BeamCaster,
    CameraBackend,
    CameraSetup,
    RangeFinder,
    SceneBackend,
)
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.near_plane import near_plane_m, scene_size_m
from omnisim.rendering.opengl.atlas.image_parts import image_parts
from omnisim.rendering.opengl.atlas.tile_plan import whole_faces
from omnisim.rendering.opengl.capture.image_pass import RemapPass
from omnisim.rendering.opengl.capture.pixel_map import PixelMap
from omnisim.rendering.opengl.drawing.cube_pass import CubePass
from omnisim.rendering.opengl.drawing.surface_program import SurfacePrograms
from omnisim.rendering.opengl.drawing.tile_renderer import VirtualCameras
from omnisim.rendering.opengl.geometry.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.gl.context import (
    check_process,
    collect_garbage,
    current,
    graphics_info,
    open_context,
    release_context,
    release_unclosed_context,
    release_unclosed_contexts,
)
from omnisim.rendering.opengl.pipeline import Pipeline, check_image_size
from omnisim.rendering.opengl.shadows.shadow_maps import ShadowMaps
from omnisim.rendering.opengl_camera import DrawnHits, DrawnScene, OpenGLCamera
from omnisim.rendering.readback import Pending, ScenePoses
from omnisim.rendering.sensor_tiles import sensor_tiles
from omnisim.scene import Scene

if TYPE_CHECKING:  # imported where they are made: few images need them
    from omnisim.ground_truth.lidar_beams import EchoLimits, LidarBeams
    from omnisim.rendering.opengl.batch_pipeline import BatchPipeline
    from omnisim.rendering.opengl.ground_truth.occlusion_pass import OcclusionPass
    from omnisim.rendering.opengl.hit_batches import HitBatches
    from omnisim.rendering.rays.ray_scene import RayScene

# A triangle is hit if a texel near the ray shows it or an adjacent one. Measured in the warehouse:
# 0.1 % of the rays miss one at 1 texel per pixel, 0.05 % at 1.5, mostly at silhouettes.
TEXELS_PER_PIXEL = 1.5
LIDAR_NEAR_M = 0.01  # smaller in small scenes


class CubeBackend(SceneBackend):
    """OpenGL context with one copy of the scene and the programs that draw it.

    A back end that is dropped without `close` warns, as files do, and is released.

    Args:
        scene: static scene.
        objects: bodies and dynamic objects by name.
        device: number of the GPU, as `omnisim info` lists them, or cuda:N; None takes the first.

    Attributes:
        context, buffers, surface_programs: OpenGL context, scene and programs of all passes.

    Raises:
        GraphicsError: no OpenGL, OpenGL too old, or a scene beyond its limits.
    """

    def __init__(self, scene: Scene, objects: Mapping[str, Scene], device: int | str | None = None):
        super().__init__(scene, objects)
        self._rays: RayScene | None = None
        self._surfaces: RayScene | None = None
        self.context = open_context(device)
        self._finalizer = weakref.finalize(
            self, release_unclosed_context, self.context, threading.current_thread()
        )
        self._finalizer.atexit = False  # the end of the process frees it
        try:
            with self.context:  # current since it was opened, and not afterwards
                self.buffers = SceneBuffers(self.context, scene, tuple(objects.values()))
                self._shadows = None
                if has_computed_shadows((scene, *objects.values())):
                    self._shadows = ShadowMaps(self.buffers, scene.lighting)
                self.surface_programs = SurfacePrograms(self.buffers, scene.lighting, self._shadows)
        except BaseException:
            self.close()
            raise

    @property
    def is_open(self) -> bool:
        """False after `close`."""
        return self._finalizer.alive

    @property
    def renderer(self) -> str:
        """OpenGL's name of the renderer."""
        return graphics_info(self.context).renderer

    @contextmanager
    def current(self) -> Iterator[None]:
        """Make its context current for a `with` block.

        Raises:
            GraphicsError: the back end is closed, or belongs to the process before a fork.
        """
        check_process()
        if not self.is_open:
            raise GraphicsError("this stage is closed: open a new one")
        release_unclosed_contexts()
        with current(self.context):
            collect_garbage(self.context)  # renderers that were dropped without `close`
            yield

    def update(self, scene: Scene) -> None:
        """Replace the static scene, with the context current. Unchanged meshes are not uploaded."""
        self.buffers.update(scene)
        if self._shadows is not None:
            self._shadows.refresh()
        self.scene, self._rays, self._surfaces = scene, None, None

    def camera(self, setup: CameraSetup) -> CameraBackend:
        """Camera in the scene; needs the current context, as do all its methods."""
        drawn = DrawnScene(self.buffers, self.surface_programs)
        if isinstance(setup.sensor.model, NonCentralCamera):
            from omnisim.rendering.parallax_camera import ParallaxCamera  # seldom needed

            return ParallaxCamera(self, drawn, setup)
        return CubeCamera(self, drawn, setup)

    def range_finder(
        self,
        angles_rad: NDArray[np.float64],
        max_range_m: float,
        hidden: frozenset[ObjectPart],
        limits: EchoLimits | None = None,
    ) -> RangeFinder:
        """Beams of a scanner; needs the current context, as do the pass's methods."""
        from omnisim.rendering.opengl.drawing.range_pass import RangePass
        from omnisim.rendering.rays.beams import Beams
        from omnisim.rendering.rays.followed_beams import FollowedRanges

        def drawn() -> RangePass:
            return RangePass(self.buffers, angles_rad, max_range_m, hidden)

        if limits is None:
            return drawn()
        return FollowedRanges(
            self.follows_specular,
            drawn,
            lambda: Beams(self.ray_scene, angles_rad, max_range_m, hidden, limits),
        )

    def beam_caster(self, beams: LidarBeams, hidden: frozenset[ObjectPart]) -> BeamCaster:
        """Beams of a spinning lidar; needs the current context, as do the pass's methods."""
        from omnisim.rendering.opengl.ground_truth.lidar_pass import LidarPass
        from omnisim.rendering.rays.followed_beams import FollowedBeams
        from omnisim.rendering.rays.lidar_caster import LidarCaster

        near_m = near_plane_m(scene_size_m(self.scene), LIDAR_NEAR_M)

        def drawn() -> LidarCaster:
            geometry = lambda: self.surfaces().caster.geometry  # noqa: E731 - as it is at the time
            cameras = LidarPass(self.buffers, beams, near_m, hidden, geometry)
            return LidarCaster(self.surfaces, beams, hidden, cameras)

        if beams.echo_limits is None:
            return drawn()
        return FollowedBeams(
            self.follows_specular, drawn, lambda: LidarCaster(self.ray_scene, beams, hidden)
        )

    def surfaces(self) -> RayScene:
        """Scene whose surfaces can be looked up; only a built `ray_scene` can cast, too."""
        if self._surfaces is None:
            from omnisim.rendering.rays.ray_scene import RayScene  # seldom needed

            objects = tuple(self.objects.values())
            self._surfaces = self._rays or RayScene(self.scene, objects, casts=False)
        return self._surfaces

    def ray_scene(self) -> RayScene:
        """Scene to cast rays at, built on first use after an edit.

        Raises:
            OmnisimError: embreex is not installed.
        """
        if self._rays is None:
            from omnisim.rendering.rays.ray_scene import RayScene  # needs an extra

            self._rays = RayScene(self.scene, tuple(self.objects.values()))
        return self._rays

    def close(self) -> None:
        """Release the OpenGL context and everything in it."""
        if self._finalizer.detach() is not None:
            for name in ("buffers", "surface_programs", "_shadows", "_rays", "_surfaces"):
                self.__dict__.pop(name, None)
            release_context(self.context)


def has_computed_shadows(parts: Sequence[Scene]) -> bool:
    """Tell whether lamps cast shadows on the scene (the first part) or on dynamic objects.

    Baked light includes its shadows; beside it they are for glossy surfaces.
    """
    lighting = parts[0].lighting
    if lighting.baked is None:
        return lighting.has_shadows
    materials = [one for part in parts for one in part.materials]
    return lighting.has_shadows and not (
        lighting.is_matte or all(one.is_matte for one in materials)
    )


class CubeCamera(OpenGLCamera["CubeHits"]):
    """Passes of a central camera."""

    def __init__(self, world: SceneBackend, drawn: DrawnScene, setup: CameraSetup):
        super().__init__(world, drawn, setup)
        sensor, context = setup.sensor, drawn.buffers.context
        camera = sensor.supersampled_model
        is_ideal = sensor.degradation.is_ideal
        size_px = sensor.model.width_px, sensor.model.height_px
        what = "an image" if is_ideal else "a degraded image"
        check_image_size(context, *size_px, what, has_half_floats=is_ideal)
        density = sensor.texels_per_pixel / sensor.supersampling
        plan = sensor_tiles(sensor, camera, density, sensor.face_size_px, subdivide=True)
        side_px = graphics_info(context).max_texture_size_px
        parts = image_parts(sensor.model, plan, side_px, sensor.supersampling, sensor.mesh_error_px)
        self.cube = self._cube_pass(parts[0].plan, plan)
        samples = PixelMap(context, camera, sensor.mesh_polygons)
        linear_type: Literal["f2", "f4"] = "f2" if is_ideal else "f4"
        self._use(Pipeline(self.cube, samples, sensor.supersampling, linear_type, parts))

    def refresh(self) -> None:
        """Adapt to the scene after its buffers have changed."""
        super().refresh()
        if "whole_cube" in self.__dict__:
            self.whole_cube.refresh()
        if "batches" in self.__dict__ and self.batches is not None:
            self.batches.refresh()

    def begin_batch(
        self, poses: Sequence[ScenePoses], out: NDArray[np.uint8], frame_number: int = 0
    ) -> Pending[None]:
        """Begin to render images; those of an ideal camera are drawn together."""
        if self.batches is None:
            return super().begin_batch(poses, out, frame_number)
        return self.batches.begin(poses, out)

    @cached_property
    def batches(self) -> BatchPipeline | None:
        """Pipeline of batches; None: images are degraded, or too large for it."""
        from omnisim.rendering.opengl.batch_pipeline import BatchPipeline

        image_pass = self._pipeline.image_pass
        if self._degraded is not None or not isinstance(image_pass, RemapPass):
            return None
        pipeline = self._pipeline
        return BatchPipeline(pipeline.readback, self.cube, image_pass, pipeline.size_px)

    def _make_hits(self, details: HitDetails) -> CubeHits:
        return CubeHits(self._drawn.buffers, self._sensor, self._cameras, details)

    def faces(self, poses: ScenePoses) -> dict[str, NDArray[np.float32]]:
        """Linear images (size, size, 3) of the virtual cameras by name, rendered for this call."""
        cube = self.whole_cube
        cube.render(*poses)
        return {tile.face_name: cube.read_face(tile) for tile in cube.plan.tiles}

    @cached_property
    def whole_cube(self) -> CubePass:
        """Virtual cameras of whole faces, in one piece each."""
        return self._cube_pass(whole_faces(self.cube.plan))


class CubeHits(DrawnHits):
    """Hits of rays from one viewpoint."""

    def __init__(
        self,
        buffers: SceneBuffers,
        sensor: OmniCamera,
        cameras: VirtualCameras,
        details: HitDetails,
    ):
        from omnisim.rendering.opengl.ground_truth.ray_hit_pass import RayHitPass
        from omnisim.rendering.opengl.ground_truth.visibility_pass import VisibilityPass

        super().__init__(buffers, sensor, cameras, details)
        size_px = sensor.model.width_px, sensor.model.height_px
        check_image_size(buffers.context, *size_px, "ground truth")
        self._pixels = PixelMap(buffers.context, sensor.model, sensor.mesh_polygons)
        plan = sensor_tiles(sensor, sensor.model, TEXELS_PER_PIXEL)
        side_px = graphics_info(buffers.context).max_texture_size_px
        parts = image_parts(sensor.model, plan, side_px, mesh_error_px=sensor.mesh_error_px)
        visibility = VisibilityPass(buffers, parts[0].plan, cameras, details)
        self._passes = RayHitPass(visibility, self._pixels, parts)
        self.has_ray = self._pixels.valid

    def refresh(self) -> None:
        """Adapt to the scene after its buffers have changed."""
        super().refresh()
        self._passes.refresh()
        if "_batches" in self.__dict__:
            self._batches.refresh()

    def rays(self) -> NDArray[np.float32]:
        """Unit rays (height, width, 3), optical frame."""
        return self._pixels.read_rays()[0]

    def hits(self, poses: ScenePoses, details: HitDetails = NO_DETAILS) -> Hits:
        """Intersect all rays with the triangles visible around them."""
        return self._passes.render(*poses, details=details)

    def batch_hits(
        self, poses: Sequence[ScenePoses], details: HitDetails = NO_DETAILS
    ) -> Iterator[Hits]:
        """Intersect the rays of many images, drawn together."""
        return self._batches.hits(poses, details)

    @cached_property
    def _batches(self) -> HitBatches:
        from omnisim.rendering.opengl.hit_batches import HitBatches

        return HitBatches(self._passes)

    def begin_occlusion(
        self, other: ScenePoses, other_from_current: NDArray[np.float64], deformed: Hits | None
    ) -> Pending[NDArray[np.bool_]]:
        """Begin to render the occlusion from another viewpoint."""
        if deformed is not None:
            self._passes.put_points(deformed)
        bits = self._occlusion_pass.begin(
            other.world_from_rig, other.world_from_objects, other_from_current
        )
        return bits.then(lambda values: values > 0)

    @cached_property
    def _occlusion_pass(self) -> OcclusionPass:
        from omnisim.rendering.opengl.ground_truth.occlusion_pass import OcclusionPass

        return OcclusionPass(self._passes)
