"""Allocations on the GPU."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl

from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl import debug

MAX_SLICE_BYTES = 256 * 2**20  # of the textures and buffers of a batch, for any number of images


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
