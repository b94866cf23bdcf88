"""Readback rate: bytes per second from the GPU into NumPy's memory."""

from __future__ import annotations

from collections.abc import Callable

import moderngl
import numpy as np

from benchmarks.probes.probe import Probe, repeated

SIDES_PX = (360, 1024)


def readback_name(components: int, side_px: int) -> str:
    """Name of the probe that reads squares with a number of components per pixel."""
    return f"readback, {'RGBA8' if components == 4 else 'RGB8'}, {side_px}²"


def readback_probes(context: moderngl.Context) -> list[Probe]:
    """Probes that read images of two sizes, with and without alpha, into allocated memory."""
    return [
        repeated(
            context,
            readback_name(components, side),
            "bytes",
            components * side**2,
            _reading(context, components, side),
        )
        for side in SIDES_PX
        for components in (4, 3)
    ]


def _reading(context: moderngl.Context, components: int, side_px: int) -> Callable[[int], None]:
    with context:
        target = context.framebuffer([context.renderbuffer((side_px, side_px), 4)])
        target.clear(0.2, 0.4, 0.6, 1.0)
    pixels = np.empty((side_px, side_px, components), dtype=np.uint8)

    def read(_: int) -> None:
        target.read_into(pixels, components=components)

    return read
