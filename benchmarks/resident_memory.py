"""Resident memory of a process."""

from __future__ import annotations

import os
from pathlib import Path

from benchmarks.errors import BenchmarkError

_STATM = "/proc/{}/statm"  # in pages: all of it, what is resident, …


def resident_bytes(process: int | str = "self") -> int:
    """Resident size of a process, by default this one, in bytes, including shared memory.

    Raises:
        BenchmarkError: the system does not provide the number.
    """
    path = Path(_STATM.format(process))
    try:
        pages = int(path.read_text(encoding="ascii").split()[1])
    except (OSError, ValueError, IndexError) as reason:
        raise BenchmarkError(f"{path}: cannot be read ({reason}): Linux is needed") from None
    return pages * os.sysconf("SC_PAGE_SIZE")
