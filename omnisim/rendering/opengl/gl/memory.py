"""Allocations on the GPU."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl

from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl import debug


class AllocationError(GraphicsError):
    """OpenGL refused an allocation.

    Args:
        what: buffer or texture, with its size.
        error: OpenGL's error.
    """

    def __init__(self, what: str, error: str):
        super().__init__(
            f"{what} does not fit on this GPU ({error}): make the scene or the images smaller"
        )
        self.reason = f"{what}: {error}"


def check_allocation(context: moderngl.Context, what: str) -> None:
    """Raise OpenGL's error after an allocation: moderngl leaves it for whoever asks next.

    Raises:
        AllocationError: there is one.
    """
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
    except (moderngl.Error, AllocationError) as error:
        reason = getattr(error, "reason", error)
        raise GraphicsError(f"{what} does not fit on this GPU ({reason}): {remedy}") from None
