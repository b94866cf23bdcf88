"""Triangles that cover an image's valid pixels, so that nothing outside a mirror is drawn."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.gl.buffers import gpu_buffer
from omnisim.rendering.opengl.gl.uniforms import uniform

STRIP_PX = 8  # height of a rectangle


def covering_triangles(valid: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Corners (n, 2) in px (right, down) of triangles that cover all valid pixels.

    Three corners form a triangle. The image's first corner is (0, 0).

    Args:
        valid: (height, width) mask.
    """
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
    context: moderngl.Context, program: moderngl.Program, valid: NDArray[np.bool_]
) -> moderngl.VertexArray:
    """Vertex array over the valid pixels (height, width) for `capture/image.vert`."""
    corners = covering_triangles(valid)
    if not corners.size:
        corners = np.zeros((3, 2), dtype=np.float32)  # OpenGL has no empty buffer
    height, width = valid.shape
    uniform(program, "u_image_size_px").value = (width, height)
    return context.vertex_array(program, [(gpu_buffer(context, corners), "2f4", "in_corner_px")])
