"""Calls of OpenGL's functions, counted below moderngl: its loader gets functions that count.

Each is some machine code of x86-64 that counts, and then jumps into the driver: arguments and
results stay where they are.
"""

import ctypes
import mmap
import platform
import sys
from collections import Counter, deque
from functools import cache

import glcontext
import pytest

from omnisim.rendering.opengl.gl import context as contexts
from omnisim.rendering.opengl.gl import functions as gl_functions

_STUB_BYTES = 32
_MAX_FUNCTIONS = 4096
_ALL: list[object] = []  # a context may call their code for as long as it lives


class GlCalls:
    """Counts the calls of contexts that are opened from now on.

    Args:
        monkeypatch: of the test, whose end ends it.
    """

    def __init__(self, monkeypatch):
        if platform.machine() != "x86_64":
            pytest.skip("counting stubs are of x86-64")
        size = _STUB_BYTES * _MAX_FUNCTIONS
        self._code = mmap.mmap(-1, size, prot=mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC)
        self._first = ctypes.addressof(ctypes.c_char.from_buffer(self._code))
        self._counts = (ctypes.c_uint64 * _MAX_FUNCTIONS)()
        self._names: list[str] = []
        open_backend = glcontext.get_backend_by_name
        monkeypatch.setattr(
            glcontext, "get_backend_by_name", lambda name: self._opener(open_backend(name))
        )
        get_address = gl_functions.gl_function.__wrapped__

        def counted(name, *parameters, returns=None):
            found = get_address(name, *parameters, returns=returns)
            address = ctypes.cast(found, ctypes.c_void_p).value
            return ctypes.CFUNCTYPE(returns, *parameters)(self._counting(name, address))

        own = cache(counted)
        for name, module in list(sys.modules.items()):
            if name.startswith("omnisim.rendering.opengl.gl.") and hasattr(module, "gl_function"):
                monkeypatch.setattr(module, "gl_function", own)
        # contexts of other tests do not count, and others shall not get these
        monkeypatch.setattr(contexts, "_idle", deque())
        monkeypatch.setattr(contexts, "_MAX_IDLE", 0)
        _ALL.append(self)

    def _opener(self, backend):
        return lambda **settings: _Backend(backend(**settings), self._counting)

    def _counting(self, name, address):
        """Address of a function that counts and then does the same."""
        if not address:
            return address
        number = len(self._names)
        self._names.append(name)
        counter = ctypes.addressof(self._counts) + 8 * number
        stub = b"\x49\xbb" + counter.to_bytes(8, "little")  # mov r11, counter
        stub += b"\xf0\x49\xff\x03"  # lock inc qword [r11]
        stub += b"\x49\xbb" + address.to_bytes(8, "little") + b"\x41\xff\xe3"  # jmp address
        self._code[_STUB_BYTES * number : _STUB_BYTES * number + len(stub)] = stub
        return self._first + _STUB_BYTES * number

    def of(self, draw):
        """Calls of one run, by name; fences are deleted only when there are many."""
        before = list(self._counts)
        draw()
        made = Counter()
        for name, then, now in zip(self._names, before, self._counts, strict=False):
            made[name] += now - then
        del made["glDeleteSync"]
        return +made


class _Backend:
    """Backend of glcontext whose functions count."""

    def __init__(self, backend, counting):
        self._backend, self._counting = backend, counting

    def load_opengl_function(self, name):
        return self._counting(name, self._backend.load_opengl_function(name))

    def __enter__(self):
        return self._backend.__enter__()

    def __exit__(self, *reason):
        return self._backend.__exit__(*reason)

    def release(self):
        self._backend.release()
