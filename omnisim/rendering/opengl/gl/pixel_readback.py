"""Readback through persistently mapped buffers: what was drawn is read while the next is drawn.

The GPU copies pixels as they are stored into a buffer that stays mapped; a fence tells when it has
done so. Conversions and dropped components are left to the copy out of the buffer: drivers make
them on the processor, too, and wait for the GPU first.
"""

from __future__ import annotations

import ctypes
from collections import deque
from typing import Any, NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl.fences import Fences, end_pass
from omnisim.rendering.opengl.gl.functions import flush, gl_function
from omnisim.rendering.opengl.gl.memory import gpu_allocation

LENGTH = 3  # one buffer is drawn, one read, one copied
DEPTH_ATTACHMENT = -1

_READ_FRAMEBUFFER, _COLOR_ATTACHMENT, _PIXEL_PACK_BUFFER = 0x8CA8, 0x8CE0, 0x88EB
_MAP_READ, _PERSISTENT, _COHERENT, _CLIENT_STORAGE = 0x1, 0x40, 0x80, 0x200
_MAPPED = _MAP_READ | _PERSISTENT | _COHERENT
_DEPTH_COMPONENT = 0x1902
_FORMATS = {1: 0x1903, 2: 0x8227, 4: 0x1908}  # by number of components
_INTEGER_FORMATS = {1: 0x8D94, 2: 0x8228, 4: 0x8D99}
_TYPES = {"f1": 0x1401, "u1": 0x1401, "f2": 0x140B, "f4": 0x1406, "u4": 0x1405}
_DTYPES = {"f1": "u1", "u1": "u1", "f2": "<f2", "f4": "<f4", "u4": "<u4"}  # by moderngl's
_ALIGNMENT = 16  # bytes
_ENUM, _INT, _SIZE, _POINTER = ctypes.c_uint, ctypes.c_int, ctypes.c_ssize_t, ctypes.c_void_p


class Pixels(NamedTuple):
    """Pixels of a framebuffer.

    Attributes:
        target: already drawn; not multisampled.
        attachment: number of a color attachment, or `DEPTH_ATTACHMENT`.
        region: left, top, width and height; None: all.
    """

    target: moderngl.Framebuffer
    attachment: int = 0
    region: tuple[int, int, int, int] | None = None


Source = Pixels | moderngl.Texture | moderngl.Buffer
Read = tuple[Source, NDArray[Any]]  # source, and the array to fill


class MappedBuffer:
    """Buffer that the GPU fills and the processor reads, mapped for as long as it exists.

    Args:
        context: OpenGL context.
        size: its size in bytes.

    Attributes:
        buffer: its OpenGL object.
        content: its bytes, to be read after a fence.

    Raises:
        GraphicsError: no memory for it.
    """

    def __init__(self, context: moderngl.Context, size: int):
        what = f"a readback of {-(-size // 2**20)} MiB"
        with gpu_allocation(what, "render fewer or smaller images at once"):
            self.buffer = context.buffer(reserve=size)
            allocate = gl_function("glNamedBufferStorage", _ENUM, _SIZE, _POINTER, _ENUM)
            allocate(self.buffer.glo, size, None, _MAPPED | _CLIENT_STORAGE)
            map_range = gl_function(
                "glMapNamedBufferRange", _ENUM, _SIZE, _SIZE, _ENUM, returns=_POINTER
            )
            address = map_range(self.buffer.glo, 0, size, _MAPPED)
            if address is None:
                raise moderngl.Error(context.error)
        self.content: NDArray[np.uint8] = np.ctypeslib.as_array(
            (ctypes.c_uint8 * size).from_address(address)
        )


class _Copy(NamedTuple):
    """Array, and the pixels in a mapped buffer that fill it."""

    out: NDArray[Any]
    first: int
    size: int
    dtype: str
    components: int

    def take(self, content: NDArray[np.uint8]) -> None:
        """Copy as many components as the array has, in its type."""
        out = self.out
        stored = content[self.first : self.first + self.size].view(self.dtype)
        if stored.size == out.size:
            np.copyto(out, stored.reshape(out.shape))
            return
        pixels = stored.reshape(*out.shape[:-1], self.components)
        for component in range(out.shape[-1]):  # far quicker than pixel by pixel
            np.copyto(out[..., component], pixels[..., component])


class Reading:
    """Readback in progress."""

    def __init__(self, owner: PixelReadback, buffer: MappedBuffer, copies: list[_Copy]):
        self._owner, self._buffer, self._copies = owner, buffer, copies
        self._fence: int | None = owner.fences.create()

    def finish(self) -> None:
        """Wait for the GPU, and fill the arrays; a second call does nothing.

        Raises:
            GraphicsError: the GPU does not finish.
        """
        if self._fence is not None:
            self._owner.fences.wait(self._fence)
            for copy in self._copies:
                copy.take(self._buffer.content)
            self.discard()

    def discard(self) -> None:
        """Leave the arrays as they are."""
        if self._fence is not None:
            self._owner.fences.release(self._fence)
            self._fence = None
            self._owner.give_back(self, self._buffer)


class PixelReadback:
    """Ring of mapped buffers, created when they are needed.

    Args:
        context: OpenGL context, current here and in all methods.

    Attributes:
        context: OpenGL context.
        fences: fences of the context.
    """

    def __init__(self, context: moderngl.Context):
        self.context = context
        self.fences: Fences = context.extra.fences
        self._free: list[MappedBuffer] = []
        self._readings: deque[Reading] = deque()
        self._bind = gl_function("glBindBuffer", _ENUM, _ENUM)
        self._bind_target = gl_function("glBindFramebuffer", _ENUM, _ENUM)
        self._select = gl_function("glNamedFramebufferReadBuffer", _ENUM, _ENUM)
        self._read_pixels = gl_function(
            "glReadPixels", _INT, _INT, _INT, _INT, _ENUM, _ENUM, _POINTER
        )
        self._read_texture = gl_function(
            "glGetTextureImage", _ENUM, _INT, _ENUM, _ENUM, _INT, _POINTER
        )

    def start(self, *reads: Read) -> Reading:
        """Start to read what has been drawn; in a full ring, finish the oldest reading first.

        Args:
            reads: pixels, whole textures or whole buffers, each with the array that
                `Reading.finish` fills: (..., width, n) with the first n components, or (..., width)
                with the only one; of any type that holds the values.

        Raises:
            GraphicsError: an error of OpenGL, in this frame or in its readback.
        """
        if len(self._readings) == LENGTH:
            self._readings[0].finish()
        copies: list[_Copy] = []
        size = 0
        for source, out in reads:
            copies.append(_copy_of(source, out, size))
            size += -(-copies[-1].size // _ALIGNMENT) * _ALIGNMENT
        buffer = self._buffer(size)
        end_pass(self.context)
        try:
            self._bind(_PIXEL_PACK_BUFFER, buffer.buffer.glo)
            for (source, _), copy in zip(reads, copies, strict=True):
                self._copy(source, copy, buffer)
        finally:
            self._bind(_PIXEL_PACK_BUFFER, 0)
        reading = Reading(self, buffer, copies)
        self._readings.append(reading)
        flush()
        error = self.context.error
        if error != "GL_NO_ERROR":
            reading.discard()
            raise GraphicsError(f"OpenGL failed to draw or to read an image: {error}")
        return reading

    def read(self, *reads: Read) -> None:
        """Read what has been drawn, and wait for it; see `start`."""
        self.start(*reads).finish()

    def give_back(self, reading: Reading, buffer: MappedBuffer) -> None:
        """Take the buffer of a finished reading."""
        self._readings.remove(reading)
        self._free.append(buffer)

    def _copy(self, source: Source, copy: _Copy, buffer: MappedBuffer) -> None:
        """Let the GPU copy a source into a bound buffer."""
        if isinstance(source, moderngl.Buffer):
            self.context.copy_buffer(buffer.buffer, source, copy.size, write_offset=copy.first)
            return
        if isinstance(source, moderngl.Texture):
            form = _pixel_format(source)
            self._read_texture(source.glo, 0, *form, copy.size, copy.first)
            return
        target, attachment, region = source
        form = (_DEPTH_COMPONENT, _TYPES["f4"])
        if attachment != DEPTH_ATTACHMENT:
            form = _pixel_format(target.color_attachments[attachment])
            self._select(target.glo, _COLOR_ATTACHMENT + attachment)
        self._bind_target(_READ_FRAMEBUFFER, target.glo)
        self._read_pixels(*(region or (0, 0, *target.size)), *form, copy.first)

    def _buffer(self, size: int) -> MappedBuffer:
        """Free buffer of at least `size` bytes."""
        if self._free:
            buffer = self._free.pop()
            if buffer.buffer.size >= size:
                return buffer
        return MappedBuffer(self.context, size)


def read_once(context: moderngl.Context, *reads: Read) -> None:
    """Read what no frame reads, through a buffer that is freed; see `PixelReadback.start`."""
    PixelReadback(context).read(*reads)


def _copy_of(source: Source, out: NDArray[Any], first: int) -> _Copy:
    if isinstance(source, moderngl.Buffer):
        return _Copy(out, first, source.size, out.dtype.str, 1)
    if isinstance(source, Pixels):
        width, height = source.target.size if source.region is None else source.region[2:]
        if source.attachment == DEPTH_ATTACHMENT:
            return _Copy(out, first, 4 * width * height, "<f4", 1)
        attachment = source.target.color_attachments[source.attachment]
    else:
        attachment, (width, height) = source, source.size
    dtype, components = _DTYPES[attachment.dtype], attachment.components
    size = width * height * components * np.dtype(dtype).itemsize
    return _Copy(out, first, size, dtype, components)


def _pixel_format(attachment: moderngl.Texture | moderngl.Renderbuffer) -> tuple[int, int]:
    """OpenGL's format and type of pixels as they are stored."""
    formats = _INTEGER_FORMATS if attachment.dtype.startswith("u") else _FORMATS
    return formats[attachment.components], _TYPES[attachment.dtype]
