"""Optical systems on the back end of virtual cameras: one viewpoint, and range for the rest."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import NonCentralCamera
from omnisim.cameras.optics.centrality import common_point
from omnisim.core.errors import GraphicsError
from omnisim.core.extras import missing_packages
from omnisim.ground_truth.hits import NO_DETAILS, HitDetails
from omnisim.rendering.backend import (
    CameraBackend,
    CameraSetup,
    FrameRequest,
    SceneBackend,
    seen_background,
)
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.rendering.camera.degradations.random_numbers import key_of
from omnisim.rendering.camera.degraded_camera import DegradedCamera
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.camera.parallax_plan import parallax_tiles
from omnisim.rendering.opengl.capture.chromatic_pass import ChromaticPass
from omnisim.rendering.opengl.capture.depth_pyramid import DepthPyramid
from omnisim.rendering.opengl.capture.parallax_pass import ParallaxPass
from omnisim.rendering.opengl.capture.parallax_rays import ParallaxRays, SampleRays
from omnisim.rendering.opengl.capture.pixel_map import PixelMap
from omnisim.rendering.opengl.context import collect_garbage
from omnisim.rendering.opengl.degradation.degradation_pass import DegradationPass
from omnisim.rendering.opengl.drawing.cube_pass import CubePass
from omnisim.rendering.opengl.drawing.surface_program import SurfacePrograms
from omnisim.rendering.opengl.drawing.tile_renderer import VirtualCameras
from omnisim.rendering.opengl.geometry.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.parallax_pipeline import ParallaxPipeline
from omnisim.rendering.opengl.pipeline import DegradedPipeline
from omnisim.rendering.readback import Readback, ScenePoses
from omnisim.rendering.truth.moving_boxes import MovingBoxes
from omnisim.rendering.truth.sample_rays import sample_rays

if TYPE_CHECKING:
    from omnisim.rendering.rays.ray_scene import RayScene
    from omnisim.rendering.truth.parallax_hits import ParallaxHits

_RAYS_PER_BATCH = 1 << 12


class Drawn(NamedTuple):
    """Scene on the GPU."""

    buffers: SceneBuffers
    programs: SurfacePrograms


class ParallaxCamera(CameraBackend):
    """Passes of one optical system.

    The virtual cameras stand at the point nearest to all rays; each sample looks up range until it
    has met its own surface. Samples in doubt are cast as rays, where those are installed, or keep
    what they found last; the image's metadata counts them.

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
        self._sensor, self._drawn, context = sensor, drawn, drawn.buffers.context
        self._rays: RayScene | None = None
        colors = _rays_by_color(sensor)
        directions, origins_m = colors[len(colors) // 2].centers()
        every = slice(None, None, max(1, len(directions) // 10_000))
        viewpoint_m = common_point(origins_m[every], directions[every])
        colors = [rays.seen_from(viewpoint_m) for rays in colors]
        self._viewpoint_m = viewpoint_m
        plan = parallax_tiles(colors, sensor.texels_per_pixel, sensor.near_m)
        self._cameras = VirtualCameras(
            sensor.near_m,
            sensor.far_m,
            1,
            setup.unlit,
            seen_background(world.scene, setup.unlit),
            setup.hidden,
        )
        is_ideal = sensor.degradation.is_ideal
        self._cube = CubePass(
            drawn.buffers,
            drawn.programs,
            plan,
            self._cameras,
        )
        longest_m = max(rays.longest_m for rays in colors)
        pyramid = DepthPyramid(context, plan, sensor.near_m, sensor.far_m, longest_m)
        fog = None if setup.unlit else world.scene.lighting.fog
        parallax = (
            ParallaxPass(context, colors[0], plan, pyramid, fog=fog)
            if len(colors) == 1
            else ChromaticPass(context, colors, plan, pyramid, fog)
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
        self._hit_source: ParallaxHits | None = None

    def refresh(self) -> None:
        """Draw what the buffers have now."""
        self._cube.refresh()
        self._rays = None
        if self._hit_source is not None:
            self._hit_source.refresh()
        self._refresh_ground_truth()

    def take(self, request: FrameRequest) -> tuple[Readback, dict[str, Any]]:
        """Take an image; also return the metadata of its degradation and undecided samples."""
        self._pipeline.undecided_samples = 0
        if self._degraded is not None:
            image, metadata = self._degraded.take(request)
            found: dict[str, Any] = {"degradation": metadata}
        else:
            image, found = self._pipeline.render(request.poses, request.linear), {}
        undecided = {"samples": self._pipeline.undecided_samples, "cast": self._casts}
        return image, {**found, "undecided": undecided}

    def hit_source(self, details: HitDetails) -> ParallaxHits:
        """Source of its ground truth, able to give these details."""
        held = self._hit_source
        wanted = details.of_texels.joined(NO_DETAILS if held is None else held.details)
        if held is None or wanted != held.details:
            self._hit_source = held = self.make_hits(wanted, self._casts)
            collect_garbage(self._drawn.buffers.context)
        return held

    def make_hits(self, details: HitDetails, casts: bool) -> ParallaxHits:
        """Source of ground truth, with undecided pixels cast as rays or not."""
        from omnisim.rendering.truth.parallax_hits import (
            ParallaxHits,  # of frames with ground truth
        )

        return ParallaxHits(
            self._drawn.buffers,
            self._sensor,
            self._cameras,
            self._viewpoint_m,
            details,
            self._ray_scene if casts else None,
        )

    def faces(self, poses: ScenePoses) -> dict[str, NDArray[np.float32]]:
        """Refuse them: the virtual cameras are parts of faces.

        Raises:
            GraphicsError: always.
        """
        raise GraphicsError("faces: expected a camera with one viewpoint, got an optical system")

    def _ray_scene(self) -> RayScene:
        from omnisim.rendering.rays.ray_scene import RayScene  # of an extra

        if self._rays is None:
            self._rays = RayScene(self.world.scene, tuple(self.world.objects.values()))
        return self._rays

    def _cast(self, poses: ScenePoses, rays: SampleRays) -> NDArray[np.float32]:
        """Linear RGB (n, 3) along rays (n,) from beside the viewpoint, rig frame."""
        from omnisim.rendering.rays.depth_limits import DepthLimits
        from omnisim.rendering.rays.ray_scene import ObjectState

        scene, rotation = self._ray_scene(), poses.world_from_rig[:3, :3]
        aimed = DepthLimits(self._sensor.near_m, self._sensor.far_m).aim(
            rays.directions, poses.world_from_rig
        )
        offsets_m = np.einsum("nj,ij->ni", rays.origins_m + self._viewpoint_m, rotation)
        aimed = aimed._replace(origins_m=aimed.origins_m + offsets_m)
        footprints = np.einsum("nsj,ij->nsi", rays.footprints, rotation.astype(np.float32))
        objects = ObjectState(poses.world_from_objects, self.setup.hidden)

        def of_batch(first: int) -> NDArray[np.float32]:
            batch = np.arange(first, min(first + _RAYS_PER_BATCH, len(footprints)))
            return scene.radiance(aimed.take(batch), footprints[batch], objects, self.setup.unlit)

        return np.concatenate(
            scene.in_threads(of_batch, range(0, len(footprints), _RAYS_PER_BATCH))
        )

    def _degraded_camera(self) -> DegradedCamera:
        sensor, seed = self._sensor, self.setup.seed
        degradation, geometry = sensor.degradation, ImageGeometry.of_camera(sensor.model)
        passes = DegradationPass(
            self._pipeline.context,
            (geometry.width_px, geometry.height_px),
            degradation.optics_steps(geometry),
            degradation.sensor_steps(geometry, key_of("noise", seed)),
            degradation.encoding_step(),
        )
        boxes = MovingBoxes(self.world.scene, self.world.objects.values())
        return DegradedCamera(sensor, seed, DegradedPipeline(self._pipeline, passes), boxes)


def _rays_by_color(sensor: OmniCamera) -> list[ParallaxRays]:
    """Rays of the samples, or those of R, G and B.

    Raises:
        GraphicsError: none sees anything.
    """
    assert isinstance(sensor.model, NonCentralCamera)
    cameras = sensor.model.by_color()
    rays = [sample_rays(one, sensor.supersampling, sensor.mesh_polygons) for one in cameras]
    if not all(one.shown.any() for one in rays):
        raise GraphicsError("camera: no pixel of the image sees anything of the scene")
    return rays
