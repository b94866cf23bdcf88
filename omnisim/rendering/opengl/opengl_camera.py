"""Cameras that draw by OpenGL: one with a single viewpoint, and the base of all."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Generic, NamedTuple, TypeVar

from omnisim.core.arrays import Bytes, Floats32
from omnisim.core.pending import Pending
from omnisim.ground_truth.hits import NO_DETAILS, HitDetails
from omnisim.rendering.atlas.image_parts import image_parts
from omnisim.rendering.atlas.tile_plan import TilePlan, sensor_tiles, whole_faces
from omnisim.rendering.contract import (
    CameraBackend,
    CameraRays,
    CameraSetup,
    FrameRequest,
    Readback,
    SceneBackend,
    ScenePoses,
    SubFrame,
    SubFrames,
    seen_background,
)
from omnisim.rendering.opengl.camera_frame import CameraFrame, CubePass, TriangleCounter
from omnisim.rendering.opengl.capture.mesh_and_lens import PixelMap
from omnisim.rendering.opengl.gl.context import collect_garbage, graphics_info
from omnisim.rendering.opengl.gl.gpu_textures import check_image_size
from omnisim.rendering.opengl.scene_view import VirtualCameras
from omnisim.rendering.opengl.surfaces.surface_program import SurfacePrograms
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers

if TYPE_CHECKING:  # for frames with ground truth, or that are degraded
    from omnisim.rendering.opengl.degradation.degradation_pass import DegradationPass
    from omnisim.rendering.opengl.frame_batches import FrameBatches
    from omnisim.rendering.opengl.hits.drawn_hits import CubeHits, DrawnHits


class DrawnScene(NamedTuple):
    """Scene on the GPU."""

    buffers: SceneBuffers
    programs: SurfacePrograms


HitsT = TypeVar("HitsT", bound="DrawnHits")


class OpenGLCamera(CameraBackend, Generic[HitsT]):
    """Camera by OpenGL; what few images need is created on first use.

    Args:
        world: the back end's scene; its context must be current, here and in all methods.
        drawn: scene on the GPU.
        setup: camera and its settings.

    Attributes:
        cube: pass of the virtual cameras.
        frame: drawer of the camera's images.
    """

    cube: CubePass
    frame: CameraFrame

    def __init__(self, world: SceneBackend, drawn: DrawnScene, setup: CameraSetup):
        super().__init__(world, setup)
        self._drawn, self._sensor = drawn, setup.sensor
        self._cameras = VirtualCameras(
            setup.sensor.near_m,
            setup.sensor.far_m,
            setup.sensor.samples,
            setup.unlit,
            seen_background(world.scene, setup.unlit),
            setup.hidden,
            mirrors=setup.sensor.mirrors,
            reflection_probes=setup.sensor.reflection_probes,
        )
        self._hit_source: HitsT | None = None

    def refresh(self) -> None:
        """Update after the buffers changed."""
        self.frame.refresh()
        if self._hit_source is not None:
            self._hit_source.refresh()
        self._refresh_truth()

    def hit_source(self, details: HitDetails) -> HitsT:
        """Source of the hits for ground truth, with at least these details."""
        held = self._hit_source
        needed = details.of_texels.joined(NO_DETAILS if held is None else held.details)
        if held is None or needed != held.details:
            self._hit_source = held = self._make_hits(needed)
            held.camera_rays = self._camera_rays
            collect_garbage(self._drawn.buffers.context)
        return held

    def count_drawn(self, poses: ScenePoses) -> int:
        """Draw an image once more, and count the triangles that its virtual cameras draw."""
        counter = self.cube.counter = TriangleCounter(self._drawn.buffers.context)
        try:
            self.frame.draw(poses, linear=False)
        finally:
            self.cube.counter = None
        return counter.triangles

    @cached_property
    def _camera_rays(self) -> CameraRays:
        return self.world.rays.camera(self.setup)

    @abstractmethod
    def _make_hits(self, details: HitDetails) -> HitsT:
        """Hits behind ground truth with these details."""

    def _begin_ideal(self, request: FrameRequest) -> Pending[Readback]:
        return self.frame.begin(SubFrames((SubFrame(request.poses),), linear=request.linear))

    def _cube_pass(self, plan: TilePlan, whole: TilePlan | None = None) -> CubePass:
        return CubePass(self._drawn.buffers, self._drawn.programs, plan, self._cameras, whole)

    def _use(self, frame: CameraFrame) -> None:
        """Render images with a frame, degraded if the sensor is."""
        self.frame = frame
        if not self._sensor.degradation.is_ideal:
            from omnisim.rendering.degraded_camera import DegradedCamera

            self._degraded = DegradedCamera(self.world, self.setup, frame.begin).begin

    def _degradation_pass(self) -> DegradationPass | None:
        """Passes of the sensor's degradation; None: it is ideal."""
        degradation = self._sensor.degradation
        if degradation.is_ideal:
            return None
        from omnisim.core.random_numbers import key_of
        from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
        from omnisim.rendering.opengl.degradation.degradation_pass import DegradationPass

        geometry = ImageGeometry.of_camera(self._sensor.model)
        return DegradationPass(
            self._drawn.buffers.context,
            (geometry.width_px, geometry.height_px),
            degradation.optics_steps(geometry),
            degradation.sensor_steps(geometry, key_of("noise", self.setup.seed)),
            degradation.encoding_step(),
        )


class CubeCamera(OpenGLCamera["CubeHits"]):
    """Camera with a single viewpoint."""

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
        degradation = self._degradation_pass()
        self._use(CameraFrame(self.cube, samples, sensor.supersampling, degradation, parts))

    def refresh(self) -> None:
        """Update after the buffers changed."""
        super().refresh()
        if "whole_cube" in self.__dict__:
            self.whole_cube.refresh()
        batches: FrameBatches | None = self.__dict__.get("batches")
        if batches is not None:
            batches.refresh()

    def begin_batch(
        self, poses: Sequence[ScenePoses], out: Bytes, frame_number: int = 0
    ) -> Pending[None]:
        """Begin to render images; those of an ideal camera are drawn together."""
        if self.batches is None:
            return super().begin_batch(poses, out, frame_number)
        return self.batches.begin(poses, out)

    @cached_property
    def batches(self) -> FrameBatches | None:
        """Drawer of batches; None: a degraded image, or one in parts, is drawn by itself."""
        from omnisim.rendering.opengl.capture.image_pass import RemapPass
        from omnisim.rendering.opengl.frame_batches import FrameBatches

        frame, image_pass = self.frame, self.frame.image_pass
        if self._degraded is not None or not isinstance(image_pass, RemapPass):
            return None
        return FrameBatches(self.cube, image_pass, frame.size_px, frame.readback)

    def _make_hits(self, details: HitDetails) -> CubeHits:
        from omnisim.rendering.opengl.hits.drawn_hits import CubeHits

        return CubeHits(self._drawn.buffers, self._sensor, self._cameras, details)

    def faces(self, poses: ScenePoses) -> dict[str, Floats32]:
        """Linear images (size, size, 3) of the virtual cameras by name, rendered for this call."""
        cube = self.whole_cube
        cube.draw((poses,))
        return {tile.face_name: cube.read_face(tile) for tile in cube.plan.tiles}

    @cached_property
    def whole_cube(self) -> CubePass:
        """Virtual cameras of whole faces, in one piece each."""
        return self._cube_pass(whole_faces(self.cube.plan))
