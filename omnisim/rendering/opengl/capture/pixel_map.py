"""Map from a camera's pixels to rays, and through an atlas to colors or UVs.

Which pixels have a ray, NumPy decides, as for the ray caster. The GPU's float32 decides otherwise
for pixels at a rim or fold, and where its iteration does not converge: those pixels are drawn again
with NumPy's rays, one by one. So are all pixels of a camera model that is not omnisim's own, which
has no GLSL file.
"""

from __future__ import annotations

from enum import StrEnum
from functools import cached_property

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, HyperbolicCamera, MirroredCamera, Rays
from omnisim.cameras.mirrors import MirrorMesh, tessellate
from omnisim.cameras.mirrors.mirror_mesh_rays import mesh_rays
from omnisim.rendering.opengl.atlas.tile_plan import TilePlan
from omnisim.rendering.opengl.capture.tile_uniforms import bind_tiles
from omnisim.rendering.opengl.gl.buffers import gpu_buffer
from omnisim.rendering.opengl.gl.framebuffers import clear_target, framebuffer
from omnisim.rendering.opengl.gl.gpu_textures import texture_2d
from omnisim.rendering.opengl.gl.pixel_readback import Pixels, read_once
from omnisim.rendering.opengl.gl.shader_files import build_program
from omnisim.rendering.opengl.gl.uniforms import find_uniform

RAYS_UNIT = 1  # texture unit of the rays, for programs that read them
_BLOCK = 8  # pixels per side of the blocks around a difference in which others are searched
_PIXELS_PER_STEP = 1 << 18


class CaptureOutput(StrEnum):
    """Output of a capture per pixel; the value is the GLSL file that writes it."""

    RAY = "capture/emit_ray.glsl"
    UV = "capture/emit_uv.glsl"


class PixelMap:
    """Rays of a camera's pixels, and what an atlas holds for them.

    Rays do not depend on the pose: they are computed on first use, and kept.

    Args:
        context: OpenGL context.
        camera: camera; for supersampling, the one of the larger image.
        polygons: polygon count of the mirror's mesh; None: exact, by the camera model's GLSL file.
        traced: rays of an optical system's pixels (height, width), which has no such file.

    Attributes:
        context, camera, polygons: see the arguments.
        size_px: width and height of the image.
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
        rays = texture_2d(self.context, self.size_px, 4)
        target = framebuffer(self.context, [rays])
        self.valid, corrections = self.draw_rays(target)
        if len(corrections):
            self.correcting_array(CaptureOutput.RAY, corrections).render()
        return rays

    def draw_rays(
        self, target: moderngl.Framebuffer
    ) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
        """Draw the rays to a target of four components.

        Returns:
            Mask (height, width) of the pixels with a ray, and `corrections` of what is drawn.
        """
        self.context.disable(moderngl.BLEND | moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        clear_target(target)
        self._model_array(CaptureOutput.RAY).render()
        width, height = self.size_px
        drawn = np.empty((height, width), dtype=np.bool_)
        step = max(1, _PIXELS_PER_STEP // width)
        for first in range(0, height, step):
            part = drawn[first : first + step]
            rays = np.empty((*part.shape, 4), dtype=np.float32)
            region = (0, first, width, len(part))
            read_once(self.context, (Pixels(target, region=region), rays))
            part[:] = rays[..., 3] > 0.5
        corrections = self.corrections(drawn)
        columns, rows = corrections[:, :2].astype(np.intp).T
        drawn[rows, columns] = corrections[:, 5] > 0.5
        return drawn, corrections

    def read_rays(self) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """Unit rays (height, width, 3) in the optical frame, and their validity (height, width)."""
        width, height = self.size_px
        rays = np.empty((height, width, 4), dtype=np.float32)
        read_once(self.context, (self.rays, rays))
        return rays[..., :3], rays[..., 3] > 0.5

    @cached_property
    def valid(self) -> NDArray[np.bool_]:
        """Pixels (height, width) with a ray."""
        return self.read_rays()[1]

    def corrections(
        self, drawn: NDArray[np.bool_], first_px: tuple[int, int] = (0, 0)
    ) -> NDArray[np.float32]:
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
        pending = _grown(drawn, False) & _grown(~drawn, True) if drawn.any() else ~drawn
        left, found = np.ones_like(drawn), [np.empty((0, 6), dtype=np.float32)]
        while pending.any():
            left &= ~pending
            pixels = np.argwhere(pending)[:, ::-1]
            wrong = np.zeros((-(-height // _BLOCK), -(-width // _BLOCK)), dtype=np.bool_)
            for first in range(0, len(pixels), _PIXELS_PER_STEP):
                some = pixels[first : first + _PIXELS_PER_STEP]
                rays = self._reference((some + np.array(first_px)).astype(np.float64))
                differs = rays.valid != drawn[some[:, 1], some[:, 0]]
                some = some[differs]
                wrong[some[:, 1] // _BLOCK, some[:, 0] // _BLOCK] = True
                parts = some, rays.directions[differs], rays.valid[differs, None]
                found.append(np.concatenate(parts, axis=1).astype(np.float32))
            around = _grown(wrong, False).repeat(_BLOCK, axis=0).repeat(_BLOCK, axis=1)
            pending = around[:height, :width] & left
        return np.concatenate(found)

    def correcting_array(
        self,
        emit: CaptureOutput,
        corrections: NDArray[np.float32],
        plan: TilePlan | None = None,
        size_px: tuple[int, int] | None = None,
    ) -> moderngl.VertexArray:
        """Vertex array that draws the output of `corrections`; of colors and UVs, by an atlas."""
        program = build_program(
            self.context,
            "capture/single_rays.vert",
            "capture/single_rays.frag",
            includes={"EMIT": emit},
        )
        program["u_image_size_px"] = size_px or self.size_px
        if plan is not None:
            bind_tiles(program, plan, self.camera.rig_from_optical)
        points = gpu_buffer(self.context, corrections)
        return self.context.vertex_array(
            program, [(points, "2f4 4f4", "in_pixel_px", "in_ray")], mode=moderngl.POINTS
        )

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
        for name, value in (("u_first_px", first_px), ("u_target_size_px", size_px)):
            if (member := find_uniform(array.program, name)) is not None:
                member.value = value

    def _reference(self, pixels_px: NDArray[np.float64]) -> Rays:
        """NumPy's rays of pixels (n, 2)."""
        if self._mesh is not None and isinstance(self.camera, HyperbolicCamera):
            return mesh_rays(self.camera, self._mesh, pixels_px)
        return self.camera.ray_from_pixel(pixels_px)

    @property
    def _has_shader(self) -> bool:
        """True if the model's GLSL file is omnisim's; a subclass elsewhere has other rays."""
        lens = self.camera.lens if isinstance(self.camera, MirroredCamera) else self.camera
        return type(lens).__module__.startswith("omnisim.")

    def _model_array(self, emit: CaptureOutput) -> moderngl.VertexArray:
        if self._mesh is not None and isinstance(self.camera, HyperbolicCamera):
            return self._mesh_array(self.camera, self._mesh, emit)
        defines = ("MIRRORED",) if isinstance(self.camera, MirroredCamera) else ()
        array = self._full_screen_array("capture/lens.frag", emit, defines)
        if self._has_shader:
            for name, value in self.camera.uniforms().items():
                array.program[name] = value
        return array

    def _full_screen_array(
        self, fragment: str, emit: CaptureOutput, defines: tuple[str, ...] = ()
    ) -> moderngl.VertexArray:
        model = f"camera/{self.camera.model_name}" if self._has_shader else "capture/no_model"
        program = build_program(
            self.context,
            "common/full_screen.vert",
            fragment,
            defines,
            {"EMIT": emit, "CAMERA_MODEL": f"{model}.glsl"},
        )
        array = self.context.vertex_array(program, [])
        array.vertices = 3
        return array

    def _mesh_array(
        self, camera: HyperbolicCamera, mesh: MirrorMesh, emit: CaptureOutput
    ) -> moderngl.VertexArray:
        program = build_program(
            self.context,
            "capture/mirror_mesh.vert",
            "capture/mirror_mesh.frag",
            includes={"EMIT": emit},
        )
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


def _grown(mask: NDArray[np.bool_], outside: bool) -> NDArray[np.bool_]:
    """Mask (rows, columns) of the cells that are set, or have a neighbor that is."""
    padded = np.pad(mask, 1, constant_values=outside)
    padded = padded[:-2] | padded[1:-1] | padded[2:]
    return np.asarray(padded[:, :-2] | padded[:, 1:-1] | padded[:, 2:])
