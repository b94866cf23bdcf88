"""Map from a camera's pixels to rays, and through an atlas to colors or UVs."""

from __future__ import annotations

from enum import StrEnum
from functools import cached_property

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, HyperbolicCamera, MirroredCamera
from omnisim.cameras.mirrors import tessellate
from omnisim.rendering.opengl.atlas.tile_plan import TilePlan
from omnisim.rendering.opengl.capture.tile_uniforms import bind_tiles
from omnisim.rendering.opengl.gl.buffers import gpu_buffer
from omnisim.rendering.opengl.gl.framebuffers import clear_target, framebuffer
from omnisim.rendering.opengl.gl.gpu_textures import texture_2d
from omnisim.rendering.opengl.gl.pixel_readback import read_once
from omnisim.rendering.opengl.gl.shader_files import build_program
from omnisim.rendering.opengl.gl.uniforms import find_uniform

RAYS_UNIT = 1  # texture unit of the rays, for programs that read them


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

    Attributes:
        context, camera, polygons: see the arguments.
        size_px: width and height of the image.
    """

    def __init__(
        self, context: moderngl.Context, camera: CentralCamera, polygons: int | None = None
    ):
        self.context, self.camera, self.polygons = context, camera, polygons
        self.size_px = (camera.width_px, camera.height_px)

    @cached_property
    def rays(self) -> moderngl.Texture:
        """Texture of unit rays in the optical frame; w: 1 where the pixel has a ray.

        Raises:
            AllocationError: too large for the GPU.
        """
        rays = texture_2d(self.context, self.size_px, 4)
        target = framebuffer(self.context, [rays])
        self.context.disable(moderngl.BLEND | moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        clear_target(target)
        self._model_array(CaptureOutput.RAY).render()
        return rays

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

    @property
    def _model_file(self) -> str:
        return f"camera/{self.camera.model_name}.glsl"

    def _model_array(self, emit: CaptureOutput) -> moderngl.VertexArray:
        if self.polygons is not None and isinstance(self.camera, HyperbolicCamera):
            return self._mesh_array(self.camera, self.polygons, emit)
        defines = ("MIRRORED",) if isinstance(self.camera, MirroredCamera) else ()
        array = self._full_screen_array("capture/lens.frag", emit, defines)
        for name, value in self.camera.uniforms().items():
            array.program[name] = value
        return array

    def _full_screen_array(
        self, fragment: str, emit: CaptureOutput, defines: tuple[str, ...] = ()
    ) -> moderngl.VertexArray:
        program = build_program(
            self.context,
            "common/full_screen.vert",
            fragment,
            defines,
            {"EMIT": emit, "CAMERA_MODEL": self._model_file},
        )
        array = self.context.vertex_array(program, [])
        array.vertices = 3
        return array

    def _mesh_array(
        self, camera: HyperbolicCamera, polygons: int, emit: CaptureOutput
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
        mesh = tessellate(camera.mirror, polygons)
        positions = (mesh.vertices_m / camera.mirror.c_m).astype("<f4")
        return self.context.vertex_array(
            program,
            [(gpu_buffer(self.context, positions), "3f4", "in_position")],
            gpu_buffer(self.context, mesh.triangles.astype("<u4")),
            index_element_size=4,
        )
