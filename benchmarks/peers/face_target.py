"""Faces of 90° for the OpenGL peers, drawn object by object."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.gl.framebuffers import framebuffer
from omnisim.rendering.opengl.gl.gpu_textures import DEPTH, renderbuffer
from omnisim.rendering.opengl.gl.shader_files import columns_first, find_uniform, uniform
from omnisim.rendering.opengl.gl.state import CLEAR_DEPTH
from omnisim.rendering.opengl.surfaces.surface_program import (
    SurfaceProgram,
    SurfacePrograms,
    variant_of,
)
from omnisim.rendering.opengl.world.draw_item import DrawItem
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.world.vertex_format import vertex_array
from omnisim.scene.model import Material, Scene

SHADERS = Path(__file__).parent / "shaders"
NEAR_M = 0.05
SRGB8_ALPHA8 = 0x8C43
FRAMEBUFFER_SRGB = 0x8DB9
# 90° wide and high, clip-space y down the image, reversed depth with an infinite far plane.
CLIP_FROM_FACE: NDArray[np.float64] = np.array(
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, NEAR_M], [0.0, 0.0, 1.0, 0.0]]
)


def peer_program(context: moderngl.Context, vertex: str, fragment: str) -> moderngl.Program:
    """Compile a vertex and a fragment shader from the peers' own folder."""
    vertex, fragment = ((SHADERS / name).read_text(encoding="utf-8") for name in (vertex, fragment))
    return context.program(vertex_shader=vertex, fragment_shader=fragment)


def srgb_texture(context: moderngl.Context, size: tuple[int, int]) -> moderngl.Texture:
    """Texture of 8-bit sRGB colors, filtered bilinearly in linear light."""
    texture = context.texture(size, 4, internal_format=SRGB8_ALPHA8)
    texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
    texture.repeat_x = texture.repeat_y = False
    return texture


def face_target(context: moderngl.Context, texture: moderngl.Texture) -> moderngl.Framebuffer:
    """Framebuffer for one face, with a depth buffer."""
    return framebuffer(context, [texture], renderbuffer(context, texture.size, 1, DEPTH))


class ObjectDrawer:
    """Draws a scene's objects one by one with omnisim's surface shaders.

    Args:
        context: OpenGL context.
        scene: scene to draw.

    Attributes:
        opaque, blended: indices of the objects, sorted by material.
        counts: (n,) number of triangles per object.
    """

    def __init__(self, context: moderngl.Context, scene: Scene):
        self._context = context
        self._background = scene.background
        self._buffers = SceneBuffers(context, scene)
        surfaces = SurfacePrograms(self._buffers, scene.lighting)
        self.draws = self._buffers.draw_items
        variants = [variant_of(draw, unlit=False) for draw in self.draws]
        self._used = [surfaces[variant] for variant in set(variants)]
        shaders = {one: _SurfaceShader(self._buffers, surfaces[one]) for one in set(variants)}
        self._shaders = [shaders[variant] for variant in variants]
        self._is_blended = [draw.is_blended for draw in self.draws]
        self.opaque = np.flatnonzero(~np.array(self._is_blended))
        self.blended = np.flatnonzero(self._is_blended)
        self.counts = np.array([draw.count // 3 for draw in self.draws])

    def set_viewpoint(self, viewpoint_m: NDArray[np.float64]) -> None:
        """Set the viewpoint (3,), world, for the next faces."""
        placement = self._buffers.instance_transforms(viewpoint_m)
        self._viewpoint_from_mesh = placement.viewpoint_from_mesh
        self._viewpoint_matrices = columns_first(placement.viewpoint_from_mesh)
        self._normal_matrices = columns_first(placement.normal_from_mesh)
        self.centers_m = placement.centers_m
        for program in self._used:
            program.set_viewpoint(viewpoint_m)

    def back_to_front(self, indices: NDArray[np.intp]) -> NDArray[np.intp]:
        """Indices sorted from back to front, for blending."""
        distances = np.linalg.norm(self.centers_m[indices], axis=1)
        return indices[np.argsort(-distances, kind="stable")]

    def front_to_back(self, indices: NDArray[np.intp]) -> NDArray[np.intp]:
        """Indices sorted from front to back, to reduce overdraw."""
        return self.back_to_front(indices)[::-1]

    def draw_face(
        self,
        target: moderngl.Framebuffer,
        face_from_world: NDArray[np.float64],
        order: NDArray[np.intp],
    ) -> None:
        """Clear a face's framebuffer, and draw objects into it in the given order.

        Args:
            target: framebuffer of the face.
            face_from_world: (3, 3), rows: the face's right, down and forward axes.
            order: indices of the objects.
        """
        context = self._context
        target.use()
        target.depth_mask = True
        target.clear(*self._background, 1.0, depth=CLEAR_DEPTH)
        context.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        context.enable_direct(FRAMEBUFFER_SRGB)
        context.depth_func = ">"  # as reversed depth needs
        context.cull_face = "back"
        context.blend_func = (  # type: ignore[assignment]  # the stub knows no factors of alpha
            moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA, moderngl.ZERO, moderngl.ONE
        )  # fmt: skip
        clip_from_viewpoint = CLIP_FROM_FACE.copy()
        clip_from_viewpoint[:, :3] = CLIP_FROM_FACE[:, :3] @ face_from_world
        clip_matrices = columns_first(clip_from_viewpoint @ self._viewpoint_from_mesh)
        front, texture, culled, blended = None, None, True, False
        for index in order:
            draw = self.draws[index]
            winding = "ccw" if draw.flips_winding else "cw"  # y of the clip space runs down
            if winding != front:
                context.front_face = front = winding
            if culled == draw.material.double_sided:
                culled = not culled
                (context.enable if culled else context.disable)(moderngl.CULL_FACE)
            if blended != self._is_blended[index]:
                blended = not blended
                (context.enable if blended else context.disable)(moderngl.BLEND)
                target.depth_mask = not blended
            if draw.texture is not texture:
                texture = draw.texture
                texture.use(0)
            shader = self._shaders[index]
            shader.set_matrices(
                clip_matrices[index], self._viewpoint_matrices[index], self._normal_matrices[index]
            )
            shader.draw(draw)
        target.depth_mask = True
        context.disable(moderngl.CULL_FACE | moderngl.BLEND | moderngl.DEPTH_TEST)
        context.disable_direct(FRAMEBUFFER_SRGB)


class _SurfaceShader:
    """Variant of the surface shader with its vertex array; skips uniforms that are already set."""

    def __init__(self, buffers: SceneBuffers, surface: SurfaceProgram):
        program = surface.program
        self._vertex_array = vertex_array(
            buffers.context, program, buffers.vertices, buffers.indices
        )
        self._clip_from_mesh = uniform(program, "u_clip_from_mesh")
        self._base_color = uniform(program, "u_base_color")
        self._alpha_cutoff = find_uniform(program, "u_alpha_cutoff")
        # removed by the compiler if the scene has no punctual lights
        self._viewpoint_from_mesh = find_uniform(program, "u_viewpoint_from_mesh")
        self._normal_from_mesh = find_uniform(program, "u_normal_from_mesh")
        self._material: Material | None = None

    def set_matrices(
        self,
        clip_from_mesh: NDArray[np.float32],
        viewpoint_from_mesh: NDArray[np.float32],
        normal_from_mesh: NDArray[np.float32],
    ) -> None:
        """Set the next object's matrices (4, 4) and (3, 3), column-major."""
        self._clip_from_mesh.write(clip_from_mesh)
        if self._viewpoint_from_mesh is not None:
            self._viewpoint_from_mesh.write(viewpoint_from_mesh)
        if self._normal_from_mesh is not None:
            self._normal_from_mesh.write(normal_from_mesh)

    def draw(self, draw: DrawItem) -> None:
        """Draw an object."""
        material = draw.material
        if material is not self._material:
            self._material = material
            self._base_color.value = material.base_color
            if self._alpha_cutoff is not None:
                self._alpha_cutoff.value = material.alpha_cutoff
        self._vertex_array.render(moderngl.TRIANGLES, vertices=draw.count, first=draw.first)
