"""Buffers of clustered geometry, read back."""

import numpy as np

from omnisim.rendering.opengl.gl.buffers import read_buffer
from omnisim.rendering.opengl.world.vertex_records import CLUSTER_VERTEX


def read_vertices(geometry):
    """Vertices (n,) of type `CLUSTER_VERTEX`."""
    return np.frombuffer(read_buffer(geometry.vertices), dtype=CLUSTER_VERTEX)


def read_palette(geometry):
    """Texels (n, 4) of the palette."""
    return np.frombuffer(geometry.palette.read(), dtype=np.float32).reshape(-1, 4)


def lights_of(geometry, vertices):
    """Baked light (..., 3) on vertices (...) of white material."""
    return read_palette(geometry)[vertices["in_material"] + 2, :3]
