"""Resident memory of this process."""

from __future__ import annotations

import os
from pathlib import Path

from benchmarks.errors import BenchmarkError

_STATM = Path("/proc/self/statm")  # in pages: all of it, what is resident, …


def resident_bytes() -> int:
    """Resident size of this process in bytes, including shared memory.

    Raises:
        BenchmarkError: the system does not provide the number.
    """
    try:
        pages = int(_STATM.read_text(encoding="ascii").split()[1])
    except (OSError, ValueError, IndexError) as reason:
        raise BenchmarkError(f"{_STATM}: cannot be read ({reason}): Linux is needed") from None
    return pages * os.sysconf("SC_PAGE_SIZE")
