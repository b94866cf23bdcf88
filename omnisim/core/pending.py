"""Results in progress."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T", covariant=True)
U = TypeVar("U")


class Pending(Generic[T]):
    """Result in progress: it was requested, and is computed or drawn meanwhile.

    Args:
        finish: function that waits for the result.
    """

    def __init__(self, finish: Callable[[], T]):
        self._finish: Callable[[], T] | None = finish

    def result(self) -> T:
        """Wait, and return the result; each call returns the same one.

        Raises:
            GraphicsError: the renderer was closed in the meantime, or the GPU failed.
        """
        if self._finish is not None:
            self._result = self._finish()
            self._finish = None
        return self._result

    @classmethod
    def done(cls, result: U) -> Pending[U]:
        """Result that is already available."""
        return Pending(lambda: result)

    def then(self, change: Callable[[T], U]) -> Pending[U]:
        """Result of a function of this result."""
        return Pending(lambda: change(self.result()))
