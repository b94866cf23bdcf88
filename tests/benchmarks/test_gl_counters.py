"""OpenGL's counters, with draws whose counts follow from their shape."""

import moderngl
import pytest

from benchmarks.gl_counters import count
from benchmarks.probes.probe import CONSTANT

SQUARES = """
#version 430 core
void main() {
    int corner = gl_VertexID % 3 + gl_VertexID % 6 / 3;  // 0 1 2, 1 2 3
    float beside = gl_VertexID < 6 ? 0.0 : 9.0;
    gl_Position = vec4(vec2(corner & 1, corner >> 1) - vec2(1.0 - beside, 1.0), 0.5, 1.0);
}
"""


def test_counts_are_those_of_the_draw(context):
    target = context.framebuffer([context.renderbuffer((32, 32), 4)])
    target.use()
    context.enable_only(moderngl.NOTHING)
    program = context.program(vertex_shader=SQUARES, fragment_shader=CONSTANT)
    squares = context.vertex_array(program, [])
    # a square of a quarter of the image, and one that is far beside it
    counted = count(context, lambda: squares.render(moderngl.TRIANGLES, vertices=12))
    assert counted.samples == 16 * 16
    assert counted.triangles == 4
    if counted.triangles_inside is None:
        pytest.skip("this driver does not count what is left by the edges")
    assert counted.triangles_inside == 2
    assert counted.vertices == 12
    assert counted.lanes >= counted.samples
