"""Atlases of xatlas that end safely.

An atlas has threads of its own. At its end, it wakes them without holding their lock. A thread that
is just about to sleep misses that, and the process waits for it forever: 1 of about 1600 atlases
that ended at once, on two cores.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Set
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xatlas

_THREADS = Path("/proc/self/task")
_MAX_WAIT_S = 1.0


@contextmanager
def atlas_of_sleeping_threads() -> Iterator[xatlas.Atlas]:
    """Atlas whose threads sleep at the end of the context, after which it may be deleted."""
    import xatlas

    others = _threads()
    atlas = xatlas.Atlas()
    try:
        yield atlas
    finally:
        _wait_until_asleep(_threads() - others)


def _threads() -> Set[str]:
    """Numbers of this process's threads; empty: not on Linux."""
    return set(os.listdir(_THREADS)) if _THREADS.is_dir() else set()


def _wait_until_asleep(threads: Set[str]) -> None:
    """Wait until threads sleep, at most a second: some may be other libraries', and work on."""
    end_s = time.monotonic() + _MAX_WAIT_S
    for thread in threads:
        while _is_awake(thread) and time.monotonic() < end_s:
            time.sleep(0)  # lets it run


def _is_awake(thread: str) -> bool:
    try:
        stat = (_THREADS / thread / "stat").read_text(encoding="ascii", errors="replace")
    except OSError:  # the thread has ended
        return False
    return stat.rpartition(")")[2].split()[0] != "S"
