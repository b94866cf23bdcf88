"""Silence of libraries in C that print errors which they also return.

Standard error itself stays: Python's messages, progress bars, other threads and new processes write
to the descriptor. Only C's stream `stderr`, through which libraries print, is replaced meanwhile.
"""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property

_LINE_BYTES = 256


class _ErrorStream:
    """C's variable `stderr`, which is another stream while any thread wants silence.

    It is left alone without glibc: in other C libraries it is constant.
    """

    def __init__(self) -> None:
        self._library = ctypes.CDLL(None)
        self._is_glibc = hasattr(self._library, "gnu_get_libc_version")
        self._forget()
        # A child has only the thread that forked: those that held the lock are not in it.
        os.register_at_fork(after_in_child=self._restart)

    @contextmanager
    def discarded(self) -> Iterator[None]:
        """Discard what is written to C's `stderr` within the block, in all threads."""
        if not self._is_glibc:
            yield
            return
        self._enter()
        try:
            yield
        finally:
            self._leave()

    @cached_property
    def _variable(self) -> ctypes.c_void_p:
        return ctypes.c_void_p.in_dll(self._library, "stderr")

    @cached_property
    def _sink(self) -> int | None:
        """Address of a stream into memory, which ignores what is more than a line.

        It needs no descriptor, which could be the number of a closed standard error. It is never
        closed, since a thread may be writing to it.
        """
        create = self._library.fmemopen
        create.argtypes = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p
        create.restype = ctypes.c_void_p
        return create(None, _LINE_BYTES, b"w")

    def _forget(self) -> None:
        self._lock = threading.Lock()
        self._users = 0
        self._kept: int | None = None

    def _restart(self) -> None:
        if self._users:
            self._variable.value = self._kept
        self._forget()

    def _enter(self) -> None:
        with self._lock:
            self._users += 1
            if self._users == 1:
                self._kept = self._variable.value
                self._variable.value = self._sink or self._kept

    def _leave(self) -> None:
        with self._lock:
            self._users -= 1
            if self._users == 0:
                self._variable.value = self._kept


quiet_libraries = _ErrorStream().discarded
