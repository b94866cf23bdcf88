"""OpenGL's pipeline statistics, which are equal in every run.

moderngl supports two of the counters. The others belong to OpenGL 4.6 or an extension; counters
that the driver lacks are left out.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass

import moderngl

from omnisim.rendering.opengl.gl.functions import gl_function

_STATISTICS = "GL_ARB_pipeline_statistics_query"
_VERTEX_SHADER_INVOCATIONS, _FRAGMENT_SHADER_INVOCATIONS = 0x82F0, 0x82F4
_CLIPPING_OUTPUT_PRIMITIVES = 0x82F7
_QUERY_RESULT = 0x8866


@dataclass(frozen=True)
class Counts:
    """Pipeline statistics of a draw; None: the driver does not count.

    Attributes:
        samples: samples that pass the depth test. With early depth tests, the rule for opaque
            surfaces, they are the samples that are shaded and kept.
        triangles: triangles from the vertex stage.
        triangles_inside: triangles left after clipping.
        vertices: invocations of the vertex shader.
        lanes: invocations of the fragment shader, as counted by the driver: a software renderer
            counts whole blocks.
    """

    samples: int
    triangles: int
    triangles_inside: int | None
    vertices: int | None
    lanes: int | None


def count(context: moderngl.Context, draw: Callable[[], object]) -> Counts:
    """Count a draw in the current context; the draw is repeated for each counter."""
    query = context.query(samples=True, primitives=True)
    with query:
        draw()
    has_statistics = context.version_code >= 460 or _STATISTICS in context.extensions

    def counted(target: int) -> int | None:
        return _counted(target, draw) if has_statistics else None

    return Counts(
        query.samples,
        query.primitives,
        counted(_CLIPPING_OUTPUT_PRIMITIVES),
        counted(_VERTEX_SHADER_INVOCATIONS),
        counted(_FRAGMENT_SHADER_INVOCATIONS),
    )


def _counted(target: int, draw: Callable[[], object]) -> int:
    integer, pointer = ctypes.c_uint, ctypes.c_void_p
    query, result = ctypes.c_uint(), ctypes.c_uint64()
    gl_function("glGenQueries", integer, pointer)(1, ctypes.addressof(query))
    gl_function("glBeginQuery", integer, integer)(target, query.value)
    draw()
    gl_function("glEndQuery", integer)(target)
    read = gl_function("glGetQueryObjectui64v", integer, integer, pointer)
    read(query.value, _QUERY_RESULT, ctypes.addressof(result))
    gl_function("glDeleteQueries", integer, pointer)(1, ctypes.addressof(query))
    return result.value
