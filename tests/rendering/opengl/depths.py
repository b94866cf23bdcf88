"""Depth textures with given values."""

from omnisim.rendering.opengl.gl.gpu_textures import depth_texture

PLANE = """
#version 430 core
uniform sampler2D u_values;
void main() { gl_FragDepth = texelFetch(u_values, ivec2(gl_FragCoord.xy), 0).r; }
"""
TRIANGLE = """
#version 430 core
void main() { gl_Position = vec4(4.0 * (gl_VertexID & 1) - 1.0, 2.0 * (gl_VertexID & 2) - 1.0, 0.5, 1.0); }
"""  # noqa: E501


def drawn_depth(context, values):
    """Depth texture with values (height, width)."""
    height, width = values.shape
    depth = depth_texture(context, (width, height))
    target = context.framebuffer([], depth)
    target.use()
    target.clear(depth=0.0)
    texture = context.texture((width, height), 1, values, dtype="f4")
    texture.filter = (context.NEAREST, context.NEAREST)
    texture.use(0)
    context.enable_only(context.DEPTH_TEST)
    context.depth_func = ">"
    program = context.program(vertex_shader=TRIANGLE, fragment_shader=PLANE)
    context.vertex_array(program, []).render(vertices=3)
    context.enable_only(context.NOTHING)
    return depth
