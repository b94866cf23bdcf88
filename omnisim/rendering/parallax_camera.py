"""Non-central cameras on the back end of virtual cameras: one viewpoint, with its depth.

Each pixel's own ray finds its surface by the depth that the viewpoint sees.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import NonCentralCamera
from omnisim.cameras.optics.centrality import common_point
from omnisim.core.errors import GraphicsError
from omnisim.core.extras import missing_packages
from omnisim.ground_truth.hits import HitDetails
from omnisim.rendering.backend import CameraSetup, SceneBackend
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.camera.parallax_plan import parallax_tiles, sample_rays
from omnisim.rendering.opengl.capture.parallax_pass import ChromaticPass, DepthPyramid, ParallaxPass
from omnisim.rendering.opengl.capture.parallax_rays import ParallaxRays, SampleRays
from omnisim.rendering.opengl.capture.pixel_map import PixelMap
from omnisim.rendering.opengl.gl.context import Context
from omnisim.rendering.opengl.gl.gpu_textures import fits_texture
from omnisim.rendering.opengl.parallax_pipeline import ParallaxPipeline
from omnisim.rendering.opengl.pipeline import check_image_size
from omnisim.rendering.opengl_camera import DrawnScene, OpenGLCamera
from omnisim.rendering.readback import FrameRequest, Pending, Readback, ScenePoses

if TYPE_CHECKING:
    from omnisim.rendering.truth.parallax_hits import ParallaxHits

_RAYS_PER_BATCH = 1 << 12
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
        colors, viewpoint_m = _rays_by_color(sensor)
        self._viewpoint_m = viewpoint_m
        plan = parallax_tiles(colors, sensor.texels_per_pixel, sensor.near_m)
        self.cube = self._cube_pass(plan)
        longest_m = max(rays.longest_m for rays in colors)
        pyramid = DepthPyramid(context, plan, sensor.near_m, sensor.far_m, longest_m)
        fog = None if setup.unlit else world.scene.lighting.fog
        parallax = (
            ParallaxPass(context, colors[0], plan, pyramid, fog=fog)
            if len(colors) == 1
            else ChromaticPass(context, colors, plan, pyramid, fog)
        )
        self._casts = not missing_packages("rays")
        self._parallax = ParallaxPipeline(
            self.cube,
            PixelMap(context, sensor.supersampled_model),
            parallax,
            viewpoint_m,
            self._cast if self._casts else None,
            sensor.supersampling,
            "f2" if sensor.degradation.is_ideal else "f4",
        )
        self._use(self._parallax)

    def begin(self, request: FrameRequest) -> Pending[tuple[Readback, dict[str, Any]]]:
        """Begin to render an image; its metadata also counts undecided samples."""
        self._parallax.undecided_samples = 0
        taken = super().begin(request)
        undecided = {"samples": self._parallax.undecided_samples, "cast": self._casts}
        return taken.then(lambda image: (image[0], image[1] | {"undecided": undecided}))

    def _make_hits(self, details: HitDetails) -> ParallaxHits:
        return self.make_hits(details, self._casts)

    def make_hits(self, details: HitDetails, casts: bool) -> ParallaxHits:
        """Hits behind ground truth; `casts`: cast undecided pixels as rays."""
        from omnisim.rendering.truth.parallax_hits import (
            ParallaxHits,  # for frames with ground truth
        )

        return ParallaxHits(
            self._drawn.buffers,
            self._sensor,
            self._cameras,
            self._viewpoint_m,
            details,
            self.world.ray_scene if casts else None,
        )

    def faces(self, poses: ScenePoses) -> dict[str, NDArray[np.float32]]:
        """Refuse: the virtual cameras are parts of faces.

        Raises:
            GraphicsError: always.
        """
        raise GraphicsError("faces: expected a central camera, got an optical system")

    def _cast(self, poses: ScenePoses, rays: SampleRays) -> NDArray[np.float32]:
        """Linear RGB (n, 3) along rays (n,) with their own origins, rig frame."""
        from omnisim.rendering.rays.caster import DepthLimits
        from omnisim.rendering.rays.ray_scene import ObjectState

        scene, rotation = self.world.ray_scene(), poses.world_from_rig[:3, :3]
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
    colors, _ = _rays_by_color(dataclasses.replace(sensor, model=model.scaled(1.0 / scale)))
    plan = parallax_tiles(colors, sensor.texels_per_pixel, sensor.near_m)
    texels, side_px = scale**2 * plan.texels, int(context.info["GL_MAX_TEXTURE_SIZE"])
    if not fits_texture((side_px, math.ceil(texels / side_px)), has_half_floats=True):
        raise GraphicsError(
            f"an optical system's image of {model.width_px} × {model.height_px} px needs about "
            f"{texels / 1e6:.0f} million texels of virtual cameras, more than a texture holds, and "
            "only central cameras are drawn in parts: make it smaller, or choose --quality fast or "
            "--backend rays"
        )


def _rays_by_color(sensor: OmniCamera) -> tuple[list[ParallaxRays], NDArray[np.float64]]:
    """Sample rays from the viewpoint, one set or one each for R, G and B; and the viewpoint (3,).

    Raises:
        GraphicsError: no ray sees anything.
    """
    assert isinstance(sensor.model, NonCentralCamera)
    cameras = sensor.model.by_color()
    rays = [sample_rays(one, sensor.supersampling, sensor.mesh_polygons) for one in cameras]
    if not all(one.shown.any() for one in rays):
        raise GraphicsError("camera: no pixel of the image sees anything of the scene")
    directions, origins_m = rays[len(rays) // 2].centers()
    every = slice(None, None, max(1, len(directions) // 10_000))
    viewpoint_m = common_point(origins_m[every], directions[every])
    return [one.seen_from(viewpoint_m) for one in rays], viewpoint_m
