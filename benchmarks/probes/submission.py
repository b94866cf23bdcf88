"""Submission rate: calls per second from Python to the GPU."""

from __future__ import annotations

from collections.abc import Callable

import moderngl
import numpy as np

from benchmarks.probes.probe import Probe, repeated
from omnisim.rendering.opengl.gl.shader_files import uniform

_DRAWS = 256
_TARGET_PX = 16
_VERTEX = """
#version 430 core
uniform mat4 u_clip_from_mesh;
uniform mat4 u_viewpoint_from_mesh;
uniform mat3 u_normal_from_mesh;
uniform vec4 u_base_color;
in vec3 in_position;
flat out vec4 v_color;
void main() {
    gl_Position = u_clip_from_mesh * vec4(in_position, 1.0);
    v_color = u_base_color + vec4(u_normal_from_mesh * u_viewpoint_from_mesh[0].xyz, 0.0);
}
"""
_FRAGMENT = """
#version 430 core
uniform sampler2D u_texture;
flat in vec4 v_color;
layout(location = 0) out vec4 out_color;
void main() { out_color = v_color * texelFetch(u_texture, ivec2(0), 0); }
"""
UNIFORM, NOTHING = "call: a matrix", "call: a draw of nothing"
DRAW, DRAW_WITH_STATE = "draw of a triangle", "draw with its own matrices and texture"
INDIRECT = "draw of an indirect list"


def submission_probes(context: moderngl.Context) -> list[Probe]:
    """Probes of draws of triangles without area, submitted one by one and as a list on the GPU."""
    with context:
        program = context.program(vertex_shader=_VERTEX, fragment_shader=_FRAGMENT)
        target = context.framebuffer([context.renderbuffer((_TARGET_PX, _TARGET_PX), 4)])
        points = context.buffer(np.zeros((3, 3), dtype="<f4"))
        indices = context.buffer(np.arange(3, dtype="<u4"))
        vertex_array = context.vertex_array(program, [(points, "3f4", "in_position")], indices)
        texture = context.texture((1, 1), 4, bytes(4))
        # per draw: indices, instances, first index, first vertex, first instance
        listed = context.buffer(np.tile(np.array([3, 1, 0, 0, 0], dtype="<u4"), (_DRAWS, 1)))
    uniforms = [uniform(program, f"u_{name}_from_mesh") for name in ("clip", "viewpoint", "normal")]
    matrices = [np.eye(size, dtype=np.float32) for size in (4, 4, 3)]
    color = uniform(program, "u_base_color")

    def matrix() -> None:
        uniforms[0].write(matrices[0])

    def draw_nothing() -> None:
        vertex_array.render(moderngl.TRIANGLES, vertices=0)

    def draw() -> None:
        vertex_array.render(moderngl.TRIANGLES, vertices=3)

    def draw_with_state() -> None:
        for matrix_uniform, value in zip(uniforms, matrices, strict=True):
            matrix_uniform.write(value)
        color.value = (0.5, 0.5, 0.5, 1.0)
        texture.use(0)
        vertex_array.render(moderngl.TRIANGLES, vertices=3)

    def often(call: Callable[[], None]) -> Callable[[int], None]:
        def calls(_: int) -> None:
            target.use()
            context.enable_only(moderngl.NOTHING)
            texture.use(0)
            for _draw in range(_DRAWS):
                call()

        return calls

    def draw_list(_: int) -> None:
        target.use()
        context.enable_only(moderngl.NOTHING)
        texture.use(0)
        vertex_array.render_indirect(listed, moderngl.TRIANGLES, count=_DRAWS)

    works = {
        UNIFORM: often(matrix),
        NOTHING: often(draw_nothing),
        DRAW: often(draw),
        DRAW_WITH_STATE: often(draw_with_state),
        INDIRECT: draw_list,
    }
    return [repeated(context, name, "calls", _DRAWS, work) for name, work in works.items()]
