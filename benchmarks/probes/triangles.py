"""Triangle rate: triangles per second, each covering about one sample."""

from __future__ import annotations

from collections.abc import Callable

import moderngl
import numpy as np
from numpy.typing import NDArray

from benchmarks.probes.probe import Probe, repeated
from omnisim.rendering.opengl.gl.shader_files import uniform

_SIDE = 128  # squares of two triangles to a side
_TARGET_PX = 192  # so nine pixels to four squares
# Inputs and outputs like those of a scene's vertices: two matrices, four outputs.
_VERTEX = """
#version 430 core
uniform mat4 u_clip_from_mesh;
uniform mat4 u_viewpoint_from_mesh;
in vec3 in_position;
in vec3 in_normal;
in vec2 in_texture_coordinate;
in vec4 in_color;
out vec3 v_position;
out vec3 v_normal;
out vec2 v_texture_coordinate;
out vec4 v_color;
void main() {
    gl_Position = u_clip_from_mesh * vec4(in_position, 1.0);
    v_position = (u_viewpoint_from_mesh * vec4(in_position, 1.0)).xyz;
    v_normal = mat3(u_viewpoint_from_mesh) * in_normal;
    v_texture_coordinate = in_texture_coordinate;
    v_color = in_color;
}
"""
_FRAGMENT = """
#version 430 core
in vec3 v_position;
in vec3 v_normal;
in vec2 v_texture_coordinate;
in vec4 v_color;
layout(location = 0) out vec4 out_color;
void main() { out_color = v_color + vec4(v_position + v_normal, v_texture_coordinate.x); }
"""
_LAYOUT = ("3f4 3f4 2f4 4f2", "in_position", "in_normal", "in_texture_coordinate", "in_color")
_RECORD = np.dtype([("floats", "<f4", 8), ("halves", "<f2", 4)])
VISIBLE, TURNED_AWAY = "triangles, seen", "triangles, turned away"
OUTSIDE, WITHOUT_AREA = "triangles, outside", "triangles, without area"


def triangle_probes(context: moderngl.Context) -> list[Probe]:
    """Probes of visible triangles, and of culled ones: back faces, outside, or no area."""
    vertices, triangles = _grid()
    with context:
        program = context.program(vertex_shader=_VERTEX, fragment_shader=_FRAGMENT)
        clip_from_mesh = uniform(program, "u_clip_from_mesh")
        viewpoint_from_mesh = uniform(program, "u_viewpoint_from_mesh")
        color = context.renderbuffer((_TARGET_PX, _TARGET_PX), 4, dtype="f2")
        depth = context.depth_renderbuffer((_TARGET_PX, _TARGET_PX))
        target = context.framebuffer([color], depth)
        buffer = context.buffer(vertices)

        def drawing(indices: NDArray[np.uint32], shift: float) -> Callable[[int], None]:
            content = [(buffer, *_LAYOUT)]
            vertex_array = context.vertex_array(program, content, context.buffer(indices))
            matrix = np.eye(4, dtype=np.float32)
            matrix[3, 0] = shift  # columns first

            def draw(_: int) -> None:
                target.use()
                target.clear(depth=0.0)
                context.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
                context.depth_func = ">"
                context.front_face = "ccw"
                context.cull_face = "back"
                clip_from_mesh.write(matrix)
                viewpoint_from_mesh.write(matrix)
                vertex_array.render(moderngl.TRIANGLES)

            return draw

        cases = {
            VISIBLE: drawing(triangles, 0.0),
            TURNED_AWAY: drawing(np.ascontiguousarray(triangles[:, ::-1]), 0.0),
            OUTSIDE: drawing(triangles, 3.0),
            WITHOUT_AREA: drawing(np.repeat(triangles[:, :1], 3, axis=1), 0.0),
        }
    return [
        repeated(context, name, "triangles", len(triangles), draw) for name, draw in cases.items()
    ]


def _grid() -> tuple[NDArray[np.void], NDArray[np.uint32]]:
    """Square of small triangles over the image, counter-clockwise, row by row."""
    line = np.linspace(-1.0, 1.0, _SIDE + 1, dtype=np.float32)
    x, y = np.meshgrid(line, line)
    vertices = np.zeros(x.size, dtype=_RECORD)
    vertices["floats"][:, 0], vertices["floats"][:, 1] = x.ravel(), y.ravel()
    vertices["floats"][:, 2] = 0.5
    vertices["floats"][:, 5] = 1.0
    vertices["halves"] = 0.5
    corners = np.arange(x.size, dtype=np.uint32).reshape(x.shape)
    a, b = corners[:-1, :-1].ravel(), corners[:-1, 1:].ravel()
    c, d = corners[1:, 1:].ravel(), corners[1:, :-1].ravel()
    triangles = np.stack((a, b, c, a, c, d), axis=1).reshape(-1, 3)
    return vertices, np.ascontiguousarray(triangles)
