"""Base of the cameras that draw by OpenGL: virtual cameras, degradation, and ground truth."""

from __future__ import annotations

from abc import abstractmethod
from functools import cached_property
from typing import TYPE_CHECKING, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from omnisim.core.extras import require_extra
from omnisim.ground_truth.hits import NO_DETAILS, HitDetails, Hits, ThroughHits
from omnisim.rendering.backend import CameraBackend, CameraSetup, SceneBackend, seen_background
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.hit_source import HitSource
from omnisim.rendering.opengl.atlas.tile_plan import TilePlan
from omnisim.rendering.opengl.drawing.cube_pass import CubePass
from omnisim.rendering.opengl.drawing.surface_program import SurfacePrograms
from omnisim.rendering.opengl.drawing.tile_renderer import VirtualCameras
from omnisim.rendering.opengl.geometry.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.gl.context import collect_garbage
from omnisim.rendering.opengl.pipeline import DegradedPipeline, Pipeline
from omnisim.rendering.readback import FrameRequest, Pending, Readback, ScenePoses
from omnisim.scene.specular_materials import specular_mask

if TYPE_CHECKING:
    from omnisim.rendering.rays.through import ThroughCaster


class DrawnScene(NamedTuple):
    """Scene on the GPU."""

    buffers: SceneBuffers
    programs: SurfacePrograms


class DrawnHits(HitSource):
    """Hits on the triangles that virtual cameras see; GPU resources are created once.

    Args:
        buffers: scene on the GPU; its context must be current, here and in all methods.
        sensor: omnidirectional camera.
        cameras: virtual cameras; only depth range and hidden instances matter here.
        details: details that its hits can include.

    Attributes:
        details: see the arguments.
        through_caster: caster of rays at glass and mirrors; its camera sets it.
    """

    through_caster: ThroughCaster | None = None

    def __init__(
        self,
        buffers: SceneBuffers,
        sensor: OmniCamera,
        cameras: VirtualCameras,
        details: HitDetails,
    ):
        self.camera, self.polygons, self.details = sensor.model, sensor.mesh_polygons, details
        self._buffers, self._cameras = buffers, cameras
        self._find_draws()

    def refresh(self) -> None:
        """Update after the buffers changed."""
        self._find_draws()

    def through(self, poses: ScenePoses, hits: Hits) -> ThroughHits:
        """Surfaces behind glass and after mirrors, cast as rays where those are first."""
        draws = np.unique(hits.draw_ids)
        if not self._is_specular[draws[draws > 0] - 1].any():
            return ThroughHits.of_first(hits)
        require_extra("rays", "what pixels show behind glass and in mirrors")
        assert self.through_caster is not None
        return self.through_caster.cast(poses, hits, self._is_specular, self.draws)

    @cached_property
    def _is_specular(self) -> NDArray[np.bool_]:
        """Mask (draws,) of glass and mirrors."""
        materials = [item.material for item in self._buffers.draw_items]
        return specular_mask(materials, self._buffers.is_matte)

    def _find_draws(self) -> None:
        from omnisim.rendering.truth.deforming_draws import deforming_draws

        self.draws = [(item.object_index, item.name) for item in self._buffers.draw_items]
        self.__dict__.pop("_is_specular", None)
        self.deforming = deforming_draws(self._buffers)


HitsT = TypeVar("HitsT", bound=DrawnHits)


class OpenGLCamera(CameraBackend, Generic[HitsT]):
    """Passes of one camera by OpenGL; rarely needed ones are created on first use.

    Args:
        world: the back end's scene; its context must be current, here and in all methods.
        drawn: scene on the GPU.
        setup: camera and its settings.

    Attributes:
        cube: pass of the virtual cameras.
    """

    cube: CubePass
    _pipeline: Pipeline

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
        self.cube.refresh()
        if self._hit_source is not None:
            self._hit_source.refresh()
        self._refresh_ground_truth()

    def hit_source(self, details: HitDetails) -> HitsT:
        """Source of the hits for ground truth, with at least these details."""
        held = self._hit_source
        needed = details.of_texels.joined(NO_DETAILS if held is None else held.details)
        if held is None or needed != held.details:
            self._hit_source = held = self._make_hits(needed)
            held.through_caster = self._through_caster
            collect_garbage(self._drawn.buffers.context)
        return held

    @cached_property
    def _through_caster(self) -> ThroughCaster:
        from omnisim.rendering.rays.through import ThroughCaster  # seldom needed

        return ThroughCaster(self.world.ray_scene, self.setup)

    @abstractmethod
    def _make_hits(self, details: HitDetails) -> HitsT:
        """Hits behind ground truth with these details."""

    def _begin_ideal(self, request: FrameRequest) -> Pending[Readback]:
        return self._pipeline.begin(request.poses, request.linear)

    def _cube_pass(self, plan: TilePlan, whole: TilePlan | None = None) -> CubePass:
        return CubePass(self._drawn.buffers, self._drawn.programs, plan, self._cameras, whole)

    def _use(self, pipeline: Pipeline) -> None:
        """Render images with a pipeline, degraded if the sensor is."""
        self._pipeline = pipeline
        degradation = self._sensor.degradation
        if degradation.is_ideal:
            return
        # an ideal camera needs none of them
        from omnisim.core.random_numbers import key_of
        from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
        from omnisim.rendering.opengl.degradation.degradation_pass import DegradationPass

        geometry = ImageGeometry.of_camera(self._sensor.model)
        passes = DegradationPass(
            pipeline.context,
            (geometry.width_px, geometry.height_px),
            degradation.optics_steps(geometry),
            degradation.sensor_steps(geometry, key_of("noise", self.setup.seed)),
            degradation.encoding_step(),
        )
        self._degrade(DegradedPipeline(pipeline, passes).begin)
