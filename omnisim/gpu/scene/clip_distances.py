"""Clip distances at the edges of tiles, in shaders/scene/vertex.glsl."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl

_CLIP_DISTANCES = tuple(range(0x3000, 0x3004))


@contextmanager
def clip_distances(context: moderngl.Context) -> Iterator[None]:
    """Clip at the edges of tiles."""
    for distance in _CLIP_DISTANCES:
        context.enable_direct(distance)
    try:
        yield
    finally:
        for distance in _CLIP_DISTANCES:
            context.disable_direct(distance)
