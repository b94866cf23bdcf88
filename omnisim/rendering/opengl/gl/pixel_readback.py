"""Readback through persistently mapped buffers: what was drawn is read while the next is drawn.

The GPU copies pixels as they are stored into a buffer that stays mapped, and a fence says when.
Conversions, and dropping components, are left to the copy out of the buffer: drivers would do them
on the processor, too, and wait for the GPU first.
"""

from __future__ import annotations

import ctypes
from collections import deque
from itertools import accumulate
from typing import Any, NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Bytes
from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl.buffers import (
    check_allocation,
    copy_buffer,
    gpu_allocation,
    immutable_buffer,
)
from omnisim.rendering.opengl.gl.functions import (
    ENUM,
    INT,
    POINTER,
    SIZE,
    Fences,
    end_pass,
    flush,
    gl_function,
)

LENGTH = 3  # one buffer is drawn, one read, one copied

_READ_FRAMEBUFFER, _COLOR_ATTACHMENT, _PIXEL_PACK_BUFFER = 0x8CA8, 0x8CE0, 0x88EB
_MAPPED, _CLIENT_STORAGE = 0x1 | 0x40 | 0x80, 0x200  # for reading, persistent, coherent
_FORMATS = {1: 0x1903, 2: 0x8227, 4: 0x1908}  # by number of components
_INTEGER_FORMATS = {1: 0x8D94, 2: 0x8228, 4: 0x8D99}
_TYPES = {  # OpenGL's and NumPy's by moderngl's
    "f1": (0x1401, "u1"), "u1": (0x1401, "u1"), "u4": (0x1405, "<u4"),
    "f2": (0x140B, "<f2"), "f4": (0x1406, "<f4"),
}  # fmt: skip
_ALIGNMENT = 16  # bytes


class TargetPixels(NamedTuple):
    """Pixels of a framebuffer."""

    target: moderngl.Framebuffer  # already drawn; not multisampled
    attachment: int = 0  # number of a color attachment
    region: tuple[int, int, int, int] | None = None  # left, top, width and height; None: all


Source = TargetPixels | moderngl.Texture | moderngl.Buffer
Read = tuple[Source, NDArray[Any]]  # source, and the array to fill


class MappedBuffer:
    """Buffer that the GPU fills and the processor reads, mapped for as long as it exists.

    Where the driver cannot map it while the GPU writes, as virgl cannot, it is copied.

    Attributes:
        buffer, content: OpenGL's buffer, and its bytes, to be read after a fence and `update`.

    Raises:
        GraphicsError: no memory for it.
    """

    def __init__(self, context: moderngl.Context, size: int):
        what = f"a readback of {-(-size // 2**20)} MiB"
        self._is_mapped = "GL_ARB_buffer_storage" in context.extensions
        with gpu_allocation(what, "render fewer or smaller images at once"):
            access = _MAPPED | _CLIENT_STORAGE if self._is_mapped else 0
            self.buffer = immutable_buffer(context, size, access)
            if not self._is_mapped:
                self.content: Bytes = np.empty(size, dtype=np.uint8)
                return
            map_range = gl_function(
                "glMapNamedBufferRange", ENUM, SIZE, SIZE, ENUM, returns=POINTER
            )
            address = map_range(self.buffer.glo, 0, size, _MAPPED)
            check_allocation(context, what)
        content = (ctypes.c_uint8 * size).from_address(address)
        self.content = np.ctypeslib.as_array(content)

    def update(self) -> None:
        """Bring `content` up to date, once the GPU has filled the buffer."""
        if not self._is_mapped:
            copy_buffer(self.buffer, self.content)


class PixelReading:
    """Readback in progress."""

    def __init__(
        self, owner: PixelReadback, buffer: MappedBuffer, copies: list[tuple[Any, NDArray[Any]]]
    ):
        self._owner, self._buffer, self._copies = owner, buffer, copies
        self._fence: int | None = owner.fences.create()

    def finish(self) -> None:
        """Wait for the GPU, and fill the arrays; a second call does nothing.

        Raises:
            GraphicsError: the GPU does not finish.
        """
        if self._fence is None:
            return
        self._owner.fences.wait(self._fence)
        self._buffer.update()
        for out, pixels in self._copies:
            if pixels.size == out.size:
                np.copyto(out, pixels.reshape(out.shape))
                continue
            pixels = pixels.reshape(*out.shape[:-1], -1)
            for component in range(out.shape[-1]):  # far quicker than pixel by pixel
                np.copyto(out[..., component], pixels[..., component])
        self.discard()

    def discard(self) -> None:
        """Leave the arrays as they are, unless they are filled."""
        if self._fence is not None:
            self._owner.fences.release(self._fence)
            self._owner._readings.remove(self)
            self._owner._free.append(self._buffer)
            self._fence = None


class PixelReadback:
    """Ring of mapped buffers, which are created when they are needed."""

    def __init__(self, context: moderngl.Context):
        self.context = context
        self.fences: Fences = context.extra.fences
        self._readings: deque[PixelReading] = deque()  # oldest first
        self._free: list[MappedBuffer] = []
        self._bind = gl_function("glBindBuffer", ENUM, ENUM)
        self._bind_target = gl_function("glBindFramebuffer", ENUM, ENUM)
        self._select = gl_function("glNamedFramebufferReadBuffer", ENUM, ENUM)
        self._read_pixels = gl_function("glReadPixels", INT, INT, INT, INT, ENUM, ENUM, POINTER)
        self._read_texture = gl_function("glGetTextureImage", ENUM, INT, ENUM, ENUM, INT, POINTER)

    def start(self, *reads: Read) -> PixelReading:
        """Start to read what has been drawn; in a full ring, finish the oldest reading first.

        Args:
            reads: pixels, whole textures or whole buffers, each with the array that
                `PixelReading.finish` fills: (..., width, n) with the first n components, or
                (..., width) with the only one; of any type that holds the values.

        Raises:
            GraphicsError: an error of OpenGL, in this frame or in its readback.
        """
        if len(self._readings) == LENGTH:
            self._readings[0].finish()
        stored = [_stored(*read) for read in reads]
        ends = [*accumulate(-(-array.size // _ALIGNMENT) * _ALIGNMENT for array in stored)]
        buffer = self._buffer(ends[-1])
        end_pass(self.context)
        self._bind(_PIXEL_PACK_BUFFER, buffer.buffer.glo)
        copies: list[tuple[Any, NDArray[Any]]] = []
        for (source, out), array, first in zip(reads, stored, [0, *ends], strict=False):
            self._copy(source, array, buffer, first)
            copies.append((out, buffer.content[first : first + array.size].view(array.dtype)))
        self._bind(_PIXEL_PACK_BUFFER, 0)
        self._check()
        self._readings.append(PixelReading(self, buffer, copies))
        flush()
        return self._readings[-1]

    def read(self, *reads: Read) -> None:
        """Read what has been drawn, and wait for it; see `start`."""
        self.start(*reads).finish()

    def _copy(self, source: Source, stored: _Stored, buffer: MappedBuffer, first: int) -> None:
        """Let the GPU copy a source to a byte of a bound buffer."""
        if isinstance(source, moderngl.Buffer):
            self.context.copy_buffer(buffer.buffer, source, stored.size, write_offset=first)
        elif isinstance(source, moderngl.Texture):
            self._read_texture(source.glo, 0, stored.form, stored.kind, stored.size, first)
        else:
            target, attachment, region = source
            self._select(target.glo, _COLOR_ATTACHMENT + attachment)
            self._bind_target(_READ_FRAMEBUFFER, target.glo)
            self._read_pixels(*(region or (0, 0, *target.size)), stored.form, stored.kind, first)

    def _buffer(self, size: int) -> MappedBuffer:
        """Free buffer of at least `size` bytes; one that is too small is dropped."""
        if self._free and (buffer := self._free.pop()).buffer.size >= size:
            return buffer
        self._check()
        return MappedBuffer(self.context, size)

    def _check(self) -> None:
        if (error := self.context.error) != "GL_NO_ERROR":
            raise GraphicsError(f"OpenGL failed to draw or to read an image: {error}")


def read_once(context: moderngl.Context, *reads: Read) -> None:
    """Read what no frame reads, through a buffer that is freed; see `PixelReadback.start`."""
    PixelReadback(context).read(*reads)


class _Stored(NamedTuple):
    """Pixels as they are stored: size in bytes, NumPy's type, OpenGL's format and type."""

    size: int
    dtype: str
    form: int = 0
    kind: int = 0


def _stored(source: Source, out: NDArray[Any]) -> _Stored:
    if isinstance(source, moderngl.Buffer):
        return _Stored(source.size, out.dtype.str)
    if isinstance(source, moderngl.Texture):
        attachment: moderngl.Texture | moderngl.Renderbuffer = source
        width, height = source.size
    else:
        width, height = source.target.size if source.region is None else source.region[2:]
        attachment = source.target.color_attachments[source.attachment]
    kind, dtype = _TYPES[attachment.dtype]
    formats = _INTEGER_FORMATS if attachment.dtype.startswith("u") else _FORMATS
    size = width * height * attachment.components * np.dtype(dtype).itemsize
    return _Stored(size, dtype, formats[attachment.components], kind)
