"""Objects of OpenGL that a context holds, by any owner: names are small numbers."""

import ctypes
from collections import Counter

KINDS = (
    *("Buffer", "Framebuffer", "Program", "Renderbuffer", "Sampler", "Shader", "Texture"),
    "VertexArray",
)
_MAX_NAMES = 1 << 13


def gl_objects() -> Counter[str]:
    """Objects of the context that is current, by kind."""
    egl = ctypes.CDLL("libEGL.so.1")
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    found: Counter[str] = Counter()
    for kind in KINDS:
        address = egl.eglGetProcAddress(f"glIs{kind}".encode())
        exists = ctypes.CFUNCTYPE(ctypes.c_ubyte, ctypes.c_uint)(address)
        found[kind] = sum(exists(name) for name in range(1, _MAX_NAMES))
    return found
