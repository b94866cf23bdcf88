"""GPU memory: buffers with immutable storage, and allocations that OpenGL refuses.

No driver moves such a buffer, or guesses how it is used. Only those of `written_buffer` are written
by the processor, and only `pixel_readback` maps buffers.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Bytes
from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl import debug
from omnisim.rendering.opengl.gl.functions import ENUM, POINTER, SIZE, gl_function

MAX_SLICE_BYTES = 256 * 2**20  # of the textures and buffers of a batch, for any number of images
Content = NDArray[np.generic] | bytes | int

_DYNAMIC_STORAGE = 0x0100
_EMPTY_BYTES = 64  # OpenGL has no empty buffers


def gpu_buffer(context: moderngl.Context, content: Content) -> moderngl.Buffer:
    """Buffer that only the GPU reads and writes.

    Args:
        content: array or bytes to fill it with, or its size in bytes: then it is uninitialized.

    Raises:
        AllocationError: no room.
    """
    return immutable_buffer(context, content, 0)


def written_buffer(context: moderngl.Context, content: Content) -> moderngl.Buffer:
    """Buffer that the processor also writes, by `Buffer.write`; otherwise a `gpu_buffer`."""
    return immutable_buffer(context, content, _DYNAMIC_STORAGE)


def read_buffer(buffer: moderngl.Buffer) -> bytes:
    """Content of any buffer, once the GPU has finished it: only for what no frame waits for."""
    content = np.empty(buffer.size, dtype=np.uint8)
    copy_buffer(buffer, content)
    return content.tobytes()


def copy_buffer(buffer: moderngl.Buffer, content: Bytes) -> None:
    """Copy all bytes of any buffer to an array (size,), once the GPU has finished it."""
    read = gl_function("glGetNamedBufferSubData", ENUM, SIZE, SIZE, POINTER)
    read(buffer.glo, 0, buffer.size, content.ctypes.data)


def immutable_buffer(context: moderngl.Context, content: Content, access: int) -> moderngl.Buffer:
    """Buffer with OpenGL's bits of the access that the processor has; see `gpu_buffer`."""
    values: NDArray[np.generic] | None = None
    if isinstance(content, bytes):
        values = np.frombuffer(content, dtype=np.uint8)
    elif isinstance(content, np.ndarray):
        values = np.ascontiguousarray(content)
    size = int(content) if values is None else values.nbytes
    # moderngl's own storage is replaced before anything uses it
    buffer = context.buffer(reserve=size or _EMPTY_BYTES)
    address = None if values is None or not size else values.ctypes.data
    allocate = gl_function("glNamedBufferStorage", ENUM, SIZE, POINTER, ENUM)
    allocate(buffer.glo, buffer.size, address, access)
    check_allocation(context, f"a buffer of {buffer.size} bytes")
    debug.label(debug.BUFFER, buffer.glo)
    return buffer


class AllocationError(GraphicsError):
    """Refused allocation of a buffer, texture or framebuffer, with its size; and the reason."""

    def __init__(self, what: str, reason: str):
        super().__init__(
            f"{what} does not fit on this GPU ({reason}): make the scene or the images smaller"
        )
        self.reason = f"{what}: {reason}"


def check_allocation(context: moderngl.Context, what: str) -> None:
    """Raise OpenGL's error after an allocation: moderngl leaves it for whoever asks next."""
    if (error := context.error) != "GL_NO_ERROR":
        debug.take_messages()  # this one
        raise AllocationError(what, error)


@contextmanager
def gpu_allocation(what: str, remedy: str) -> Iterator[None]:
    """Explain a failing allocation in a `with` block, with a remedy.

    Raises:
        GraphicsError: OpenGL refused the allocation.
    """
    try:
        yield
    except AllocationError as error:
        raise GraphicsError(f"{what} does not fit on this GPU ({error.reason}): {remedy}") from None


def slice_length(
    context: moderngl.Context, height_px: int, image_bytes: int, block_bytes: int
) -> int:
    """Maximum number of images that a batch draws at once, stacked vertically.

    Args:
        context: OpenGL context.
        height_px: height of an image.
        image_bytes: memory per image.
        block_bytes: memory per image in the largest of its storage buffers.
    """
    limits = context.info
    return max(
        1,
        min(
            MAX_SLICE_BYTES // image_bytes,
            int(limits["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"]) // max(1, block_bytes),
            int(limits["GL_MAX_TEXTURE_SIZE"]) // height_px,
            int(limits["GL_MAX_ARRAY_TEXTURE_LAYERS"]),
        ),
    )
