"""Map from a camera's pixels to rays, and through an atlas to colors or UVs.

Which pixels have a ray, NumPy decides, as for the ray caster. The GPU's float32 decides otherwise
for pixels at a rim or fold, and where its iteration does not converge: those pixels are drawn again
with NumPy's rays, one by one. So are all pixels of a camera model that is not omnisim's own, which
has no GLSL file.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from functools import cached_property

import moderngl
import numpy as np

from omnisim.cameras import CentralCamera, HyperbolicCamera, MirroredCamera, Rays
from omnisim.cameras.mirrors import MirrorMesh, tessellate
from omnisim.cameras.mirrors.hyperbolic import mesh_rays
from omnisim.core.arrays import Bools, Floats, Floats32
from omnisim.core.cube import FACE_FROM_RIG, FACE_NAMES
from omnisim.rendering.atlas.sampling_density import dilate
from omnisim.rendering.atlas.tile_plan import MAX_TILES, TilePlan
from omnisim.rendering.opengl.gl.buffers import gpu_buffer
from omnisim.rendering.opengl.gl.framebuffers import clear_target, framebuffer
from omnisim.rendering.opengl.gl.gpu_textures import texture_2d
from omnisim.rendering.opengl.gl.pixel_readback import TargetPixels, read_once
from omnisim.rendering.opengl.gl.shader_files import (
    build_program,
    columns_first,
    set_uniforms,
    uniform,
)


def bind_tiles(program: moderngl.Program, plan: TilePlan, rig_from_optical: Floats) -> None:
    """Set a program's uniforms of tiles, mip levels, and rig_from_optical (3, 3)."""
    regions, padded, uv_from_tangent = np.zeros((3, MAX_TILES, 4), dtype=np.float32)
    px_per_tan = np.zeros(MAX_TILES, dtype=np.float32)
    atlas_px = np.array([plan.width_px, plan.height_px], dtype=np.float64)
    for index, tile in enumerate(plan.tiles):
        half_px = 0.5 * tile.face_size_px
        middle_px = np.array(tile.face_corner_px) + half_px
        uv_from_tangent[index] = np.concatenate((middle_px / atlas_px, half_px / atlas_px))
        regions[index] = np.ravel(tile.region)
        padded[index] = tile.padded_region.ravel()
        px_per_tan[index] = half_px
    face_of_tile = [tile.face for tile in plan.tiles]
    first_tiles = np.searchsorted(face_of_tile, np.arange(len(FACE_NAMES) + 1))
    values = {
        "u_max_level": float(plan.max_level),
        "u_level_bias": float(plan.level_bias),
        "u_atlas_px": atlas_px.astype("<f4"),
        "u_rig_from_optical": columns_first(rig_from_optical),
        "u_face_from_rig": columns_first(FACE_FROM_RIG),
        "u_first_tile": first_tiles.astype("<i4"),
        "u_tile_region": regions,
        "u_tile_padded_region": padded,
        "u_uv_from_tangent": uv_from_tangent,
        "u_tile_px_per_tan": px_per_tan,
    }
    set_uniforms(program, values)


STRIP_PX = 8  # height of a rectangle of the triangles that cover an image's valid pixels


def covering_triangles(valid: Bools) -> Floats32:
    """Corners (3 n, 2) in px (right, down) of triangles over all pixels of a mask."""
    height = len(valid)
    triangles = []
    for top in range(0, height, STRIP_PX):
        columns = np.flatnonzero(valid[top : top + STRIP_PX].any(axis=0))
        if not columns.size:
            continue
        left, right = int(columns[0]), int(columns[-1]) + 1
        bottom = min(top + STRIP_PX, height)
        triangles += [(left, top), (right, top), (left, bottom)]
        triangles += [(left, bottom), (right, top), (right, bottom)]
    return np.array(triangles, dtype=np.float32).reshape(-1, 2)


def valid_pixels_array(
    context: moderngl.Context, program: moderngl.Program, valid: Bools
) -> moderngl.VertexArray:
    """Vertex array over the valid pixels (height, width) for `capture/image.vert`.

    Nothing outside a mirror is drawn.
    """
    corners = covering_triangles(valid)
    if not corners.size:
        corners = np.zeros((3, 2), dtype=np.float32)  # OpenGL has no empty buffer
    uniform(program, "u_image_size_px").value = valid.shape[::-1]
    return context.vertex_array(program, [(gpu_buffer(context, corners), "2f4", "in_corner_px")])


RAYS_UNIT = 1  # texture unit of the rays, for programs that read them
_BLOCK = 8  # pixels per side of the blocks around a difference in which others are searched
_PIXELS_PER_STEP = 1 << 18


class CaptureOutput(StrEnum):
    """Output of a capture per pixel; the value is the GLSL file that writes it."""

    RAY = "capture/emit_ray.glsl"
    UV = "capture/emit_uv.glsl"


def drawn_mask(
    target: moderngl.Framebuffer,
    size_px: tuple[int, int],
    components: int,
    is_drawn: Callable[[Floats32], Bools],
) -> Bools:
    """Mask (height, width) of what a target's first attachment holds, read in bands for memory."""
    width, height = size_px
    drawn, step = np.empty((height, width), dtype=np.bool_), max(1, _PIXELS_PER_STEP // width)
    for first in range(0, height, step):
        band = drawn[first : first + step]
        values = np.empty((*band.shape, components), dtype=np.float32)
        read_once(target.ctx, (TargetPixels(target, region=(0, first, width, len(band))), values))
        band[:] = is_drawn(values)
    return drawn


class PixelMap:
    """Rays of a camera's pixels, and what an atlas holds for them.

    Rays do not depend on the pose: they are computed on first use, and kept.

    Args:
        camera: camera; for supersampling, the one of the larger image.
        polygons: polygon count of the mirror's mesh; None: exact, by the camera model's GLSL file.
        traced: rays of an optical system's pixels (height, width), which has no such file.
    """

    def __init__(
        self,
        context: moderngl.Context,
        camera: CentralCamera,
        polygons: int | None = None,
        traced: Rays | None = None,
    ):
        self.context, self.camera, self.polygons = context, camera, polygons
        self._traced, self._mesh = traced, None
        if polygons is not None and isinstance(camera, HyperbolicCamera):
            self._mesh = tessellate(camera.mirror, polygons)
        self.size_px = (camera.width_px, camera.height_px)

    @cached_property
    def rays(self) -> moderngl.Texture:
        """Texture of unit rays in the optical frame; w: 1 where the pixel has a ray.

        Raises:
            AllocationError: too large for the GPU.
        """
        if self._traced is not None:
            parts = (self._traced.directions, self._traced.valid[..., None])
            texels = np.concatenate(parts, axis=-1, dtype=np.float32)
            return texture_2d(self.context, self.size_px, 4, texels)
        texture = texture_2d(self.context, self.size_px, 4)
        target = framebuffer(self.context, [texture])
        clear_target(target)
        self._model_array(CaptureOutput.RAY).render()
        self.valid = drawn_mask(target, self.size_px, 4, lambda rays: rays[..., 3] > 0.5)
        corrections = self.corrections(self.valid)
        if len(corrections):
            self.correcting_array(CaptureOutput.RAY, corrections).render()
        columns, rows = corrections[:, :2].astype(np.intp).T
        self.valid[rows, columns] = corrections[:, 5] > 0.5
        return texture

    def read_rays(self) -> tuple[Floats32, Bools]:
        """Unit rays (height, width, 3) in the optical frame, and their validity (height, width)."""
        width, height = self.size_px
        rays = np.empty((height, width, 4), dtype=np.float32)
        read_once(self.context, (self.rays, rays))
        return rays[..., :3], rays[..., 3] > 0.5

    @cached_property
    def valid(self) -> Bools:
        """Pixels (height, width) with a ray."""
        return self.read_rays()[1]

    def corrections(self, drawn: Bools, first_px: tuple[int, int] = (0, 0)) -> Floats32:
        """Pixels that NumPy finds to have a ray and the GPU does not, or the other way round.

        The search begins at the edges of what is drawn. Around each difference it continues, since
        the differing pixels are connected.

        Args:
            drawn: (height, width) mask of the pixels with a ray on the GPU.
            first_px: the first of these pixels, of a rectangle of the image.

        Returns:
            (n, 6): pixel in the rectangle, right and down; NumPy's unit ray in the optical frame,
            and 1 if valid.
        """
        height, width = drawn.shape
        pending = dilate(drawn) & dilate(~drawn, outside=True) if drawn.any() else ~drawn
        left, found = np.ones_like(drawn), [np.empty((0, 6), dtype=np.float32)]
        while pending.any():
            left &= ~pending
            pixels = np.argwhere(pending)[:, ::-1]
            wrong = np.zeros((-(-height // _BLOCK), -(-width // _BLOCK)), dtype=np.bool_)
            for first in range(0, len(pixels), _PIXELS_PER_STEP):
                some = pixels[first : first + _PIXELS_PER_STEP]
                places = (some + np.array(first_px)).astype(np.float64)
                if self._mesh is not None and isinstance(self.camera, HyperbolicCamera):
                    rays = mesh_rays(self.camera, self._mesh, places)
                else:
                    rays = self.camera.ray_from_pixel(places)
                differs = rays.valid != drawn[some[:, 1], some[:, 0]]
                some = some[differs]
                wrong[some[:, 1] // _BLOCK, some[:, 0] // _BLOCK] = True
                parts = some, rays.directions[differs], rays.valid[differs, None]
                found.append(np.concatenate(parts, axis=1).astype(np.float32))
            around = dilate(wrong).repeat(_BLOCK, axis=0).repeat(_BLOCK, axis=1)
            pending = around[:height, :width] & left
        return np.concatenate(found)

    def correcting_array(
        self,
        emit: CaptureOutput,
        corrections: Floats32,
        plan: TilePlan | None = None,
        size_px: tuple[int, int] | None = None,
    ) -> moderngl.VertexArray:
        """Vertex array that draws the output of `corrections`; of colors and UVs, by an atlas."""
        shaders = "capture/single_rays.vert", "capture/single_rays.frag"
        program = build_program(self.context, *shaders, includes={"EMIT": emit})
        program["u_image_size_px"] = size_px or self.size_px
        if plan is not None:
            bind_tiles(program, plan, self.camera.rig_from_optical)
        points = (gpu_buffer(self.context, corrections), "2f4 4f4", "in_pixel_px", "in_ray")
        return self.context.vertex_array(program, [points], mode=moderngl.POINTS)

    def vertex_array(self, emit: CaptureOutput, plan: TilePlan) -> moderngl.VertexArray:
        """Vertex array that draws each pixel's output for an atlas, see `use_part`."""
        array = self._model_array(emit)
        bind_tiles(array.program, plan, self.camera.rig_from_optical)
        return array

    def use_part(
        self,
        array: moderngl.VertexArray,
        plan: TilePlan,
        first_px: tuple[int, int],
        size_px: tuple[int, int],
    ) -> None:
        """Draw a rectangle of pixels to all of the viewport, from an atlas of its own."""
        bind_tiles(array.program, plan, self.camera.rig_from_optical)
        set_uniforms(array.program, {"u_first_px": first_px, "u_target_size_px": size_px})

    def _model_array(self, emit: CaptureOutput) -> moderngl.VertexArray:
        """Vertex array that draws each pixel's output by the model's GLSL file, or by the mesh."""
        camera = self.camera
        if self._mesh is not None and isinstance(camera, HyperbolicCamera):
            return self._mesh_array(camera, self._mesh, emit)
        lens, defines = camera, tuple[str, ...]()
        if isinstance(camera, MirroredCamera):
            lens, defines = camera.lens, ("MIRRORED",)
        # a subclass that is not omnisim's has other rays than its model's file
        has_shader = type(lens).__module__.startswith("omnisim.")
        model = f"camera/{camera.model_name}" if has_shader else "capture/no_model"
        shaders = "common/full_screen.vert", "capture/lens.frag"
        includes = {"EMIT": emit, "CAMERA_MODEL": f"{model}.glsl"}
        program = build_program(self.context, *shaders, defines, includes)
        if has_shader:
            for name, value in camera.uniforms().items():
                program[name] = value
        array = self.context.vertex_array(program, [])
        array.vertices = 3
        return array

    def _mesh_array(
        self, camera: HyperbolicCamera, mesh: MirrorMesh, emit: CaptureOutput
    ) -> moderngl.VertexArray:
        shaders = "capture/mirror_mesh.vert", "capture/mirror_mesh.frag"
        program = build_program(self.context, *shaders, includes={"EMIT": emit})
        program["u_target_size_px"] = self.size_px
        program["u_focal_length_px"] = camera.focal_length_px
        program["u_principal_point_px"] = camera.principal_point_px
        positions = (mesh.vertices_m / camera.mirror.c_m).astype("<f4")
        return self.context.vertex_array(
            program,
            [(gpu_buffer(self.context, positions), "3f4", "in_position")],
            gpu_buffer(self.context, mesh.triangles.astype("<u4")),
            index_element_size=4,
        )
