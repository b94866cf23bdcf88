"""Hits of rays with their own origins, on the triangles that one viewpoint sees."""

from __future__ import annotations

import math

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import Rays
from omnisim.core.arrays import Bools, Bytes, Floats
from omnisim.core.pending import Pending
from omnisim.ground_truth.hits import NO_DETAILS, HitDetails, Hits
from omnisim.rendering.atlas.parallax_plan import MARGIN_PX, ParallaxRays, parallax_tiles
from omnisim.rendering.atlas.sampling_density import MAX_ANISOTROPY
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.contract import CameraRays, ScenePoses
from omnisim.rendering.opengl.capture.mesh_and_lens import PixelMap
from omnisim.rendering.opengl.capture.parallax_pass import DepthPyramid
from omnisim.rendering.opengl.gl.gpu_textures import texture_2d
from omnisim.rendering.opengl.gl.shader_files import uniform
from omnisim.rendering.opengl.hits.drawn_hits import DrawnHits
from omnisim.rendering.opengl.hits.ray_hit_pass import RayHitPass
from omnisim.rendering.opengl.hits.visibility_pass import VisibilityPass
from omnisim.rendering.opengl.scene_view import VirtualCameras
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.rendering.pixel_rays import Band, PixelRays, moved_points, starts_of_rays

UNKNOWN_HIT = np.uint32(1 << 31)  # bit of a draw item's number, as in parallax_hits.frag
UNKNOWN_OCCLUSION = np.uint8(2)  # as in parallax_occlusion.frag
_ORIGINS = 11  # texture unit


class ParallaxHitPass(RayHitPass):
    """Intersects rays with the triangles that the viewpoint sees at their ends.

    Args:
        visibility: pass that draws the triangle IDs.
        pixels: rays of the pixels.
        pyramid: hierarchical depth of the atlas.

    Attributes:
        origins: texture (height, width) of the rays' origins, see `put_origins`.
    """

    shader = "ground_truth/parallax_hits.frag"
    occlusion_shader = "ground_truth/parallax_occlusion.frag"

    def __init__(self, visibility: VisibilityPass, pixels: PixelMap, pyramid: DepthPyramid):
        super().__init__(visibility, pixels)
        self._pyramid = pyramid
        self.origins = texture_2d(pixels.context, pixels.size_px, 4)

    def put_origins(self, origins_m: NDArray[np.floating]) -> None:
        """Upload origins (height, width, 3) relative to the viewpoint.

        For hits in the optical frame; for occlusion in the viewpoint frame.
        """
        texels = np.zeros((*origins_m.shape[:2], 4), dtype=np.float32)
        texels[..., :3] = origins_m
        self.origins.write(texels)

    def bind(self) -> None:
        """Bind rays, origins, and the depth of the last rendered atlas."""
        super().bind()
        self.origins.use(_ORIGINS)
        assert isinstance(self.visibility.depth, moderngl.Texture)  # it has no layers
        self._pyramid.update(self.visibility.depth)

    def prepare(self, program: moderngl.Program, rig_from_optical: Floats) -> None:
        """Set the constant uniforms of a program, with rig_from_optical (3, 3)."""
        super().prepare(program, rig_from_optical)
        self._pyramid.bind_program(program)
        uniform(program, "u_origins").value = _ORIGINS

    def put(self, hits: Hits) -> None:
        """Replace the points and primitives of the last hits, for occlusion."""
        self.put_points(hits)
        self.primitives.write(np.stack((hits.draw_ids, hits.triangles), axis=-1))


# As for central cameras: few visible triangles are missed by all texels around.
_TEXELS_PER_PIXEL, _MAX_TEXELS_PER_PIXEL = 1.5, 6.0
# Valid pixels of the paper's mirror at 360 px. Fewer pixels are wider, but triangles and texels are
# not.
_USUAL_PIXELS = 90_000


class ParallaxHits(DrawnHits):
    """Hits of rays with individual origins; GPU resources are created once.

    Surfaces hidden from the viewpoint are found by ray casting, if it is installed. Otherwise
    occluders are treated as thin.

    Args:
        buffers, cameras, details: see `DrawnHits`.
        sensor: camera with an optical system as its model.
        viewpoint_m: (3,) viewpoint of the virtual cameras, rig frame.
        cast_rays: rays that are cast; None: no ray casting.

    Attributes:
        undecided: (height, width) pixels of the latest hits that the viewpoint cannot decide.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        sensor: OmniCamera,
        cameras: VirtualCameras,
        viewpoint_m: Floats,
        details: HitDetails,
        cast_rays: CameraRays | None,
    ):
        super().__init__(buffers, sensor, cameras, details)
        self._viewpoint_m, self._cast_rays = viewpoint_m, cast_rays
        self._rays = _joined(PixelRays(sensor.model, sensor.mesh_polygons))
        self.has_ray = self._rays.valid
        self.undecided = np.zeros_like(self.has_ray)
        rays = self._center_rays()
        wider = max(1.0, math.sqrt(_USUAL_PIXELS / max(1, int(self.has_ray.sum()))))
        density = min(_TEXELS_PER_PIXEL * wider, _MAX_TEXELS_PER_PIXEL)
        plan = parallax_tiles([rays], density, cameras.near_m, MAX_ANISOTROPY)
        context = buffers.context
        self._passes = ParallaxHitPass(
            VisibilityPass(buffers, plan, cameras, details),
            PixelMap(context, sensor.model, traced=Rays(self.rays(), self._rays.valid)),
            DepthPyramid(context, plan, cameras.near_m, cameras.far_m, rays.longest_m),
        )
        optical_from_rig = sensor.model.rig_from_optical.T
        assert self._rays.origins_m is not None
        self._origins_m = self._placed(self._rays.origins_m - optical_from_rig @ viewpoint_m)

    def _center_rays(self) -> ParallaxRays:
        """Rays of the pixel centers relative to the viewpoint, rig frame."""
        rig_from_optical, rays = self.camera.rig_from_optical, self._rays
        assert rays.origins_m is not None
        around = ((MARGIN_PX, MARGIN_PX), (MARGIN_PX, MARGIN_PX), (0, 0))
        directions, origins_m = (
            np.pad(self._placed(values).astype(np.float32), around)
            for values in (
                np.einsum("nj,ij->ni", rays.directions, rig_from_optical),
                np.einsum("nj,ij->ni", rays.origins_m, rig_from_optical) - self._viewpoint_m,
            )
        )
        return ParallaxRays.interpolated(1, directions, origins_m, rays.valid)

    def refresh(self) -> None:
        """Update to the current buffers."""
        super().refresh()
        self._passes.refresh()

    def rays(self) -> Floats:
        """Unit rays (height, width, 3), optical frame."""
        return self._placed(self._rays.directions)

    def hits(self, poses: ScenePoses, details: HitDetails = NO_DETAILS) -> Hits:
        """Intersect all rays with the surfaces visible near their ends, and cast undecided rays."""
        pose = self._viewpoint_pose(poses)
        self._passes.put_origins(self._origins_m)
        at_viewpoint = poses._replace(world_from_rig=pose)
        (hits,) = self._passes.render([at_viewpoint], details).result()
        self.undecided = undecided = self.has_ray & (hits.draw_ids & UNKNOWN_HIT > 0)
        hits = hits._replace(draw_ids=hits.draw_ids & ~UNKNOWN_HIT)
        offset_m = (pose[:3, 3] - poses.world_from_rig[:3, 3]).astype(np.float32)
        if self._cast_rays is not None and undecided.any():
            self._cast(hits, undecided, poses, pose[:3, 3], details)
            self._passes.put(hits)
        hits.points_m[hits.draw_ids > 0] += offset_m
        self._hits, self._from_rig_m = hits, offset_m
        return hits

    def _cast(
        self,
        hits: Hits,
        undecided: Bools,
        poses: ScenePoses,
        viewpoint_m: Floats,
        details: HitDetails,
    ) -> None:
        """Cast the rays of undecided pixels (height, width), and store their hits."""
        assert self._cast_rays is not None
        assert self._rays.origins_m is not None
        some = undecided[self._rays.valid]
        band = self._rays._replace(
            directions=self._rays.directions[some],
            origins_m=self._rays.origins_m[some],
            footprints=self._rays.footprints[some],
        )
        cast = self._cast_rays.hits(poses, band, viewpoint_m, self._numbers, details)
        hits.points_and_ranges_m[undecided] = cast.points_and_ranges_m
        hits.draw_ids[undecided] = cast.draw_ids
        hits.triangles[undecided] = cast.triangles
        for name in details.components:
            getattr(hits, name)[undecided] = getattr(cast, name)

    def begin_occlusion(
        self, other: ScenePoses, other_from_current: Floats, deformed: Hits | None
    ) -> Pending[Bools]:
        """Begin to render the occlusion of the latest hits' points."""
        hits, pose = deformed or self._hits, self._viewpoint_pose(other)
        if deformed is not None:
            points = deformed.points_and_ranges_m.copy()
            points[deformed.draw_ids > 0, :3] -= self._from_rig_m
            self._passes.put_points(deformed._replace(points_and_ranges_m=points))
        draw_ids = hits.draw_ids[self.has_ray]
        points_m = moved_points(hits.points_m[self.has_ray], draw_ids, other_from_current)
        starts_m = starts_of_rays(self.camera, points_m, draw_ids > 0, other.world_from_rig)
        self._moved = other, points_m, starts_m
        offset_m = pose[:3, 3] - other.world_from_rig[:3, 3]
        self._passes.put_origins(self._placed(starts_m - offset_m))
        # from the points in the pass, relative to both viewpoints
        transforms = other_from_current.copy()
        transforms[..., 3] += other_from_current[..., :3] @ self._from_rig_m - offset_m
        bits = self._passes.occlusion.begin(other._replace(world_from_rig=pose), transforms)
        return bits.then(self._occluded)

    def _occluded(self, bits: Bytes) -> Bools:
        """Mask (height, width) of occluded points; undecided ones are cast."""
        occluded = bits & ~UNKNOWN_OCCLUSION > 0
        undecided = self.has_ray & (bits & UNKNOWN_OCCLUSION > 0)
        if self._cast_rays is not None and undecided.any():
            (other, points_m, starts_m), some = self._moved, undecided[self.has_ray]
            occluded[undecided] = self._cast_rays.occluded(
                other,
                starts_m[some],
                points_m[some],
                self._hits.draw_ids[undecided],
                self._hits.triangles[undecided],
                self._numbers,
            )
        return occluded

    def _viewpoint_pose(self, poses: ScenePoses) -> Floats:
        """Pose (4, 4) of the virtual cameras."""
        pose = poses.world_from_rig.copy()
        pose[:3, 3] += pose[:3, :3] @ self._viewpoint_m
        return pose

    def _placed(self, values: Floats) -> Floats:
        """Image (height, width, 3) from values (n, 3) of the pixels that have a ray."""
        image = np.zeros((*self.has_ray.shape, 3))
        image[self.has_ray] = values
        return image


def _joined(rays: PixelRays) -> Band:
    """Rays of all pixels as a single band."""
    bands = [rays.band(number) for number in range(len(rays.bands))]
    origins_m = [band.origins_m for band in bands if band.origins_m is not None]
    return Band(
        slice(0, rays.camera.height_px),
        np.concatenate([band.valid for band in bands]),
        np.concatenate([band.directions for band in bands]),
        np.concatenate(origins_m),
        np.concatenate([band.footprints for band in bands]),
    )
