"""Ring of pixel-pack buffers: images are read while the next ones are drawn."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.gl.fences import end_pass
from omnisim.rendering.opengl.gl.functions import flush
from omnisim.rendering.opengl.gl.memory import gpu_allocation

LENGTH = 3  # one buffer is drawn, one read, one copied


class _Read(NamedTuple):
    buffer: moderngl.Buffer
    out: NDArray[np.uint8]


class ReadbackRing:
    """Reads 8-bit images in the order in which they were drawn.

    Args:
        context: OpenGL context.
    """

    def __init__(self, context: moderngl.Context):
        self._context = context
        self._free: list[moderngl.Buffer] = []
        self._reads: deque[_Read] = deque()

    def start(self, target: moderngl.Framebuffer, out: NDArray[np.uint8]) -> None:
        """Start to read the first rows of a target; with a full ring, finish the oldest read first.

        Args:
            target: already drawn.
            out: (..., width, components), contiguous; filled when `finish` returns.
        """
        if len(self._reads) == LENGTH:
            self._finish_one()
        buffer = self._buffer(out.nbytes)
        components = out.shape[-1]
        rows = out.size // (target.width * components)
        end_pass(self._context)
        target.read_into(buffer, (0, 0, target.width, rows), components=components)
        flush()
        self._reads.append(_Read(buffer, out))

    def finish(self) -> None:
        """Finish all reads."""
        while self._reads:
            self._finish_one()

    def discard(self) -> None:
        """Discard interrupted reads: their arrays are no longer written."""
        while self._reads:
            self._free.append(self._reads.popleft().buffer)

    def _finish_one(self) -> None:
        read = self._reads.popleft()
        read.buffer.read_into(read.out, size=read.out.nbytes)
        self._free.append(read.buffer)

    def _buffer(self, size: int) -> moderngl.Buffer:
        """Free buffer of at least `size` bytes."""
        if self._free and self._free[-1].size >= size:
            return self._free.pop()
        if self._free:
            self._free.pop()  # too small
        with gpu_allocation(f"a readback of {size >> 20} MiB", "render fewer images at once"):
            return self._context.buffer(reserve=size, dynamic=True)
