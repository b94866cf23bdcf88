"""Allocations on the GPU."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl

from omnisim.core.errors import GraphicsError


@contextmanager
def gpu_allocation(what: str, remedy: str) -> Iterator[None]:
    """Explain a failing allocation in a `with` block, with a remedy.

    Raises:
        GraphicsError: OpenGL refused the allocation.
    """
    try:
        yield
    except moderngl.Error as reason:
        raise GraphicsError(f"{what} does not fit on this GPU ({reason}): {remedy}") from None
