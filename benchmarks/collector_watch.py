"""Time spent in Python's garbage collector."""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


class CollectorWatch:
    """Sum of the garbage collector's time.

    Attributes:
        seconds: time of all collections so far.
        collections: number of collections so far.
    """

    def __init__(self) -> None:
        self.seconds, self.collections = 0.0, 0
        self._start: float | None = None

    def _note(self, phase: str, _: dict[str, Any]) -> None:
        if phase == "start":
            self._start = time.perf_counter()
        elif self._start is not None:
            self.seconds += time.perf_counter() - self._start
            self.collections += 1
            self._start = None


@contextmanager
def watching_the_collector() -> Iterator[CollectorWatch]:
    """Watch the collector during a `with` block."""
    watch = CollectorWatch()
    gc.callbacks.append(watch._note)
    try:
        yield watch
    finally:
        gc.callbacks.remove(watch._note)
