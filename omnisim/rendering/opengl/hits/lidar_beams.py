"""Hits of a spinning lidar's beams, slice by slice of the revolution."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache, partial

import moderngl
import numpy as np

from omnisim.cameras import CylindricalCamera
from omnisim.core.coordinate_frames import BASE_FROM_OPTICAL_LOOKING_AHEAD
from omnisim.core.poses import pose_from_rotation, rotation_from_yaw
from omnisim.core.world import ObjectPart
from omnisim.ground_truth.hits import BeamHits, LidarBeams, LidarPoses, Revolution, Slice
from omnisim.rendering.atlas.tile_plan import TilePlan, plan_tiles
from omnisim.rendering.contract import PlacedMesh, ScenePoses, SceneRays
from omnisim.rendering.opengl.gl.buffers import gpu_allocation
from omnisim.rendering.opengl.gl.framebuffers import framebuffer, within
from omnisim.rendering.opengl.gl.gpu_textures import texture_2d
from omnisim.rendering.opengl.gl.pixel_readback import PixelReadback
from omnisim.rendering.opengl.gl.shader_files import build_program, columns_first, uniform
from omnisim.rendering.opengl.hits.ray_hit_pass import HitTables
from omnisim.rendering.opengl.hits.visibility_pass import VisibilityPass
from omnisim.rendering.opengl.scene_view import VirtualCameras
from omnisim.rendering.opengl.world.draw_item import InstanceTransforms
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers

# A triangle is hit if a texel near the beam shows it or an adjacent one. Measured in mapping: 0.06
# % of the beams of five revolutions miss one at 1.5 texels per beam, 0.03 % at 2, 0.02 % at 2.5; a
# revolution takes a sixth longer at 2.5 than at 2.
TEXELS_PER_BEAM = 2.5
# Margin of a slice's virtual camera, for objects that turn during the slice.
MARGIN_RAD = 0.05
# Maximum number of texels of an atlas: 512 MiB of triangle IDs and depth. Beams that need more are
# drawn in parts.
MAX_TEXELS = 1 << 26
_RAYS_UNIT = 1


class LidarPass:
    """Intersects a lidar's beams with the triangles that virtual cameras see.

    Surfaces reflect on both sides.

    The virtual cameras of a slice width are created once.

    Args:
        buffers: scene and dynamic objects.
        beams: beams of the lidar.
        near_m: minimum range.
        hidden: parts of dynamic objects that beams pass through.
        scene_rays: rays at the scene, which look up the surfaces that beams hit.

    Raises:
        GraphicsError: more beams than fit on the GPU.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        beams: LidarBeams,
        near_m: float,
        hidden: Collection[ObjectPart],
        scene_rays: SceneRays,
    ):
        self._buffers, self._beams, self._scene_rays = buffers, beams, scene_rays
        self._cameras = VirtualCameras(
            near_m, beams.max_range_m, hidden=frozenset(hidden), both_sides=True
        )
        context, size = buffers.context, (len(beams.azimuths_rad), len(beams.elevations_rad))
        buffers.check_readable("to look up what its beams hit")
        with gpu_allocation(f"a lidar of {size[0]} × {size[1]} beams", "use fewer"):
            self._rays = texture_2d(context, size, 4)
            self._hits = texture_2d(context, size, 4, dtype="u4")
            self._target = framebuffer(context, [self._hits])
        self._readback = PixelReadback(context)
        self._sector = lru_cache(maxsize=4)(partial(_Sector, buffers, beams, self._cameras))

    def refresh(self) -> None:
        """Update after the buffers changed."""
        self._sector.cache_clear()
        self.__dict__.pop("_meshes", None)

    @property
    def draws(self) -> Sequence[ObjectPart]:
        """Dynamic object and name of each instance, indexed by `BeamHits.draw_ids` − 1."""
        return [(item.object_index, item.name) for item in self._buffers.draw_items]

    def cast(self, revolution: Revolution) -> BeamHits:
        """Hits of all beams of a revolution."""
        directions = self._beams.directions
        size = directions.shape[:2]
        texels = np.empty((*size, 4), dtype=np.float32)
        rays = np.einsum("fij,rfj->rfi", revolution.rotations, directions)
        texels[..., :3], texels[..., 3] = rays, revolution.shares
        self._rays.write(texels)
        slices, azimuths_rad = revolution.slices, self._beams.azimuths_rad
        for span in slices:
            sector = self._sector(slices[0].last, len(slices) == 1)
            for first in range(span.first, span.last, sector.firings):
                part = replace(span, first=first, last=min(first + sector.firings, span.last))
                heading_rad = 0.0  # of the middle; of a whole revolution any
                if part.last - part.first < len(azimuths_rad):
                    ends_rad = azimuths_rad[part.first], azimuths_rad[part.last - 1]
                    heading_rad = float(0.5 * (ends_rad[0] + ends_rad[1]))
                sector.render(part, self._target, self._rays, heading_rad)
        hits = np.empty((*size, 4), dtype=np.uint32)
        self._readback.read((self._hits, hits))
        triangles = hits[..., 2].view(np.int32)
        found = BeamHits(hits[..., 1].view(np.float32), hits[..., 0], triangles=triangles)
        return self._scene_rays.with_intensities(self._beams, revolution, self._meshes, found)

    @cached_property
    def _meshes(self) -> list[PlacedMesh]:
        return [
            PlacedMesh(
                item.object_index, item.name, item.object_from_mesh.tobytes(), item.triangles
            )
            for item in self._buffers.draw_items
        ]


class _Sector:
    """Virtual cameras of a slice, or of a part of it, centered on its middle azimuth.

    Args:
        buffers, beams, cameras: see `LidarPass`.
        firings: number of firings in the slice.
        is_whole: the slice is a whole revolution.

    Attributes:
        firings: number of firings that are drawn at once.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        beams: LidarBeams,
        cameras: VirtualCameras,
        firings: int,
        is_whole: bool,
    ):
        self._buffers = buffers
        rig_from_optical = BASE_FROM_OPTICAL_LOOKING_AHEAD
        limit_px = int(buffers.context.info["GL_MAX_TEXTURE_SIZE"])
        self.firings, plan = _plan_part(beams, firings, is_whole, limit_px)
        self._visibility = VisibilityPass(buffers, plan, cameras)
        self._tables = HitTables(self._visibility)
        context = buffers.context
        program = build_program(context, "common/full_screen.vert", "ground_truth/firings.frag")
        self._tables.bind_program(program, rig_from_optical)
        uniform(program, "u_rays").value = _RAYS_UNIT
        self._array = context.vertex_array(program, [])
        self._array.vertices = 3
        self._rig_from_viewpoint = uniform(program, "u_rig_from_viewpoint")
        self._path_m = uniform(program, "u_path_m")

    def render(
        self, span: Slice, target: moderngl.Framebuffer, rays: moderngl.Texture, heading_rad: float
    ) -> None:
        """Draw the hits of a slice's beams."""
        world_from_rig = span.middle.world_from_lidar @ pose_from_rotation(
            rotation_from_yaw(heading_rad), np.zeros(3)
        )
        self._visibility.render([ScenePoses(world_from_rig, span.middle.world_from_objects)])
        start, end = self._transforms(span.start), self._transforms(span.end)
        self._rig_from_viewpoint.write(columns_first(world_from_rig[:3, :3].T))
        self._path_m.write(span.path_m.astype("<f4"))
        self._tables.update([start], [end.viewpoint_from_mesh[:, :3]])
        rays.use(_RAYS_UNIT)
        with within(target, (span.first, 0, span.last - span.first, target.size[1])):
            self._array.render()

    def _transforms(self, poses: LidarPoses) -> InstanceTransforms:
        return self._buffers.instance_transforms(poses.origin_m, poses.world_from_objects)


def _plan_part(
    beams: LidarBeams, firings: int, is_whole: bool, limit_px: int
) -> tuple[int, TilePlan]:
    """Number of a slice's firings that fit into an atlas, and its tiles.

    Beams too dense for any atlas share texels: their hits stay exact, but more are missed.
    """
    count, density = firings, TEXELS_PER_BEAM
    while True:
        camera = _plan_camera(beams, count, is_whole and count == firings)
        subdivides = count < firings or density < TEXELS_PER_BEAM
        plan = plan_tiles(camera, BASE_FROM_OPTICAL_LOOKING_AHEAD, density, subdivide=subdivides)
        if plan.fits(limit_px, MAX_TEXELS):
            return count, plan
        width_rad = 2.0 * math.pi * count / len(beams.azimuths_rad)
        if count > 1 and width_rad > 2.0 * MARGIN_RAD:
            count = -(-count // 2)
        else:
            density *= 0.5


def _plan_camera(beams: LidarBeams, firings: int, is_whole: bool) -> CylindricalCamera:
    """Camera with the field of view of a slice, as dense as its beams."""
    steps_rad = np.append(np.diff(beams.elevations_rad), 2.0 * math.pi / len(beams.azimuths_rad))
    focal_length_px = 1.0 / float(steps_rad.min())
    width_rad = 2.0 * math.pi
    if not is_whole:
        width_rad *= firings / len(beams.azimuths_rad)
        width_rad = min(width_rad + 2.0 * MARGIN_RAD, 2.0 * math.pi)
    margin_rad = 0.1 * MARGIN_RAD if is_whole else MARGIN_RAD
    low, high = np.tan(
        [beams.elevations_rad.min() - margin_rad, beams.elevations_rad.max() + margin_rad]
    ).tolist()
    return CylindricalCamera(
        math.ceil(focal_length_px * width_rad),
        math.ceil(focal_length_px * (high - low)),
        focal_length_px,
        (0.5 * focal_length_px * width_rad - 0.5, focal_length_px * high - 0.5),
    )
