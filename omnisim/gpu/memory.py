"""Errors where something does not fit on the GPU."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl

from omnisim.errors import GraphicsError


@contextmanager
def fits_on_gpu(what: str, remedy: str) -> Iterator[None]:
    """Allocate in a `with` block; a failure names what was allocated, and what helps.

    Raises:
        GraphicsError: OpenGL refused.
    """
    try:
        yield
    except moderngl.Error as reason:
        raise GraphicsError(f"{what} does not fit on this GPU ({reason}): {remedy}") from None
