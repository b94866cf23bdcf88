"""Non-central cameras: virtual cameras at one viewpoint, whose depth all rays search.

Each pixel's own ray finds its surface by the depth that the viewpoint sees.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from omnisim.core.arrays import Floats, Floats32
from omnisim.core.errors import GraphicsError
from omnisim.core.extras import missing_packages
from omnisim.core.pending import Pending
from omnisim.ground_truth.hits import HitDetails
from omnisim.rendering.atlas.parallax_plan import (
    SampleRays,
    parallax_tiles,
    rays_by_color,
)
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.contract import CameraSetup, FrameRequest, SceneBackend, ScenePoses, Taken
from omnisim.rendering.opengl.camera_frame import CameraFrame, CubePass
from omnisim.rendering.opengl.capture.mesh_and_lens import PixelMap
from omnisim.rendering.opengl.capture.parallax_pass import DepthPyramid, ParallaxPass
from omnisim.rendering.opengl.gl.context import Context
from omnisim.rendering.opengl.gl.gpu_textures import check_image_size, fits_texture
from omnisim.rendering.opengl.opengl_camera import DrawnScene, OpenGLCamera

if TYPE_CHECKING:
    from omnisim.rendering.opengl.degradation.degradation_pass import DegradationPass
    from omnisim.rendering.opengl.hits.parallax_hits import ParallaxHits

# Linear RGB (n, 3) along rays (n,), with the scene at some poses.
CastAt = Callable[[ScenePoses, SampleRays], Floats32]
# Longer side of the image by which the atlas of a larger one is estimated, and how much larger.
_ESTIMATE_PX, _MIN_SCALE = 256, 6.0


class ParallaxCamera(OpenGLCamera["ParallaxHits"]):
    """Passes of one optical system.

    The virtual cameras are at the point nearest to all rays; each sample searches the depth until
    it meets its own surface. Undecided samples are cast as rays if embreex is installed, or keep
    the last candidate; the image's metadata counts them.

    Raises:
        GraphicsError: several samples per texel, or sizes beyond the GPU's limits.
    """

    def __init__(self, world: SceneBackend, drawn: DrawnScene, setup: CameraSetup):
        super().__init__(world, drawn, setup)
        sensor = setup.sensor
        if sensor.samples > 1:
            raise GraphicsError(
                f"virtual_cameras.samples: expected 1 for an optical system, got {sensor.samples}"
            )
        context = drawn.buffers.context
        _check_atlas(context, sensor)
        colors, viewpoint_m = rays_by_color(sensor)
        self._viewpoint_m = viewpoint_m
        plan = parallax_tiles(colors, sensor.texels_per_pixel, sensor.near_m)
        self.cube = self._cube_pass(plan)
        longest_m = max(rays.longest_m for rays in colors)
        pyramid = DepthPyramid(context, plan, sensor.near_m, sensor.far_m, longest_m)
        fog = None if setup.unlit else world.scene.lighting.fog
        self._casts = not missing_packages("rays")
        self._parallax = ParallaxFrame(
            self.cube,
            PixelMap(context, sensor.supersampled_model),
            ParallaxPass(context, colors, plan, pyramid, fog),
            viewpoint_m,
            self._cast if self._casts else None,
            sensor.supersampling,
            self._degradation_pass(),
        )
        self._use(self._parallax)

    def begin(self, request: FrameRequest) -> Pending[Taken]:
        """Begin to render an image; its metadata also counts undecided samples."""
        self._parallax.undecided_samples = 0
        taken = super().begin(request)
        undecided = {"samples": self._parallax.undecided_samples, "cast": self._casts}
        return taken.then(lambda image: (image[0], image[1] | {"undecided": undecided}))

    def _make_hits(self, details: HitDetails) -> ParallaxHits:
        return self.make_hits(details, self._casts)

    def make_hits(self, details: HitDetails, casts: bool) -> ParallaxHits:
        """Hits behind ground truth; `casts`: cast undecided pixels as rays."""
        from omnisim.rendering.opengl.hits.parallax_hits import ParallaxHits

        return ParallaxHits(
            self._drawn.buffers,
            self._sensor,
            self._cameras,
            self._viewpoint_m,
            details,
            self._camera_rays if casts else None,
        )

    def faces(self, poses: ScenePoses) -> dict[str, Floats32]:
        """Refuse: the virtual cameras are parts of faces.

        Raises:
            GraphicsError: always.
        """
        raise GraphicsError("faces: expected a central camera, got an optical system")

    def _cast(self, poses: ScenePoses, rays: SampleRays) -> Floats32:
        """Linear RGB (n, 3) along rays (n,) with their own origins, rig frame."""
        origins_m = rays.origins_m + self._viewpoint_m
        return self._camera_rays.radiance(poses, origins_m, rays.directions, rays.footprints)


class ParallaxFrame(CameraFrame):
    """Draws images from the viewpoint nearest to all rays.

    Args:
        cube: virtual cameras.
        samples: pixel map of the supersampled camera; sets the size.
        parallax: pass that samples the atlas.
        viewpoint_m: (3,) rig frame.
        cast: function that colors undecided samples by rays; None: treat occluders as thin.
        supersampling, degradation: see `CameraFrame`.

    Attributes:
        undecided_samples: number of undecided samples since the attribute was last set to 0.
    """

    def __init__(
        self,
        cube: CubePass,
        samples: PixelMap,
        parallax: ParallaxPass,
        viewpoint_m: Floats,
        cast: CastAt | None,
        supersampling: int,
        degradation: DegradationPass | None,
    ):
        self._parallax, self._viewpoint_m, self._cast = parallax, viewpoint_m, cast
        self.undecided_samples = 0
        super().__init__(cube, samples, supersampling, degradation)

    def _make_pass(self, samples: PixelMap, supersampling: int) -> None:
        """Do nothing: the parallax pass is the image pass."""

    def draw(self, poses: ScenePoses, linear: bool) -> None:
        """Draw the encoded image and, on request, the linear one."""
        pose, cast = poses.world_from_rig.copy(), self._cast
        pose[:3, 3] += pose[:3, :3] @ self._viewpoint_m
        self._cube.draw((ScenePoses(pose, poses.world_from_objects),))
        self._parallax.draw(
            self._cube.atlas,
            self._cube.depth,
            self._both_targets if linear else self.encoded_target,
            None if cast is None else lambda rays: cast(poses, rays),
        )
        self.undecided_samples += self._parallax.undecided_samples


def _check_atlas(context: Context, sensor: OmniCamera) -> None:
    """Refuse an image that needs too many texels, as a small one tells, before it is traced.

    Raises:
        GraphicsError: no texture holds the atlas, however it is packed.
    """
    model = sensor.model
    check_image_size(context, model.width_px, model.height_px, "an optical system's image")
    scale = max(model.width_px, model.height_px) / _ESTIMATE_PX
    if scale < _MIN_SCALE:
        return
    colors, _ = rays_by_color(dataclasses.replace(sensor, model=model.scaled(1.0 / scale)))
    texels = scale**2 * parallax_tiles(colors, sensor.texels_per_pixel, sensor.near_m).texels
    side_px = int(context.info["GL_MAX_TEXTURE_SIZE"])
    if not fits_texture((side_px, math.ceil(texels / side_px)), has_half_floats=True):
        raise GraphicsError(
            f"an optical system's image of {model.width_px} × {model.height_px} px needs about "
            f"{texels / 1e6:.0f} million texels of virtual cameras, more than a texture holds, and "
            "only central cameras are drawn in parts: make it smaller, or choose --quality fast or "
            "--backend rays"
        )
