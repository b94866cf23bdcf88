"""OpenGL functions that moderngl does not wrap, called through their addresses."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

_COLOR = 0x1800  # GL_COLOR
_LOWER_LEFT, _ZERO_TO_ONE = 0x8CA1, 0x935F
_RENDERBUFFER, _DEPTH_COMPONENT32F = 0x8D41, 0x8CAC
_TEXTURE_2D, _TEXTURE_2D_ARRAY, _TEXTURE_CUBE_MAP_ARRAY = 0x0DE1, 0x8C1A, 0x9009
_MIN_FILTER, _MAG_FILTER, _LINEAR, _LINEAR_MIPMAP_LINEAR = 0x2801, 0x2800, 0x2601, 0x2703
_RGB, _RGBA, _HALF_FLOAT, _UNPACK_ALIGNMENT = 0x1907, 0x1908, 0x140B, 0x0CF5
_HALF_FLOATS = {3: 0x881B, 4: 0x881A}  # internal formats by number of components
_UNSIGNED_BYTE, _UNSIGNED_INT, _TRIANGLES = 0x1401, 0x1405, 4
_DRAW_INDIRECT_BUFFER, _PARAMETER_BUFFER, _SHADER_STORAGE_BUFFER = 0x8F3F, 0x80EE, 0x90D2
_BASE_LEVEL, _MAX_LEVEL = 0x813C, 0x813D
_ENUM, _INT = ctypes.c_uint, ctypes.c_int

COMMAND_BYTES = 20  # of an indirect draw command

AnyTexture = moderngl.Texture | moderngl.Texture3D | moderngl.TextureArray


@cache
def gl_function(name: str, *parameters: type, returns: type | None = None) -> Callable[..., Any]:
    """OpenGL function by name, parameter types and return type."""
    egl = ctypes.CDLL("libEGL.so.1")
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    return ctypes.CFUNCTYPE(returns, *parameters)(egl.eglGetProcAddress(name.encode()))


def constant_call(function: Callable[..., Any], *arguments: int) -> Callable[[], Any]:
    """Call of an OpenGL function with constant arguments.

    They are converted here, once: that takes longer than most calls.
    """
    typed: Any = function
    converted = [kind(value) for kind, value in zip(typed.argtypes, arguments, strict=True)]
    address: Any = ctypes.cast(typed, ctypes.c_void_p).value
    return partial(ctypes.CFUNCTYPE(typed.restype)(address), *converted)


def clip_depth_from_zero_to_one() -> None:
    """Clip depth to [0, w] in the current context, as reversed depth requires."""
    gl_function("glClipControl", ctypes.c_uint, ctypes.c_uint)(_LOWER_LEFT, _ZERO_TO_ONE)


def clear_integers(attachment: int) -> None:
    """Clear an integer attachment of the bound framebuffer to 0: moderngl clears floats only."""
    zeros = (ctypes.c_uint * 4)()
    clear = gl_function("glClearBufferuiv", ctypes.c_uint, ctypes.c_int, ctypes.c_void_p)
    clear(_COLOR, attachment, ctypes.addressof(zeros))


def flush() -> None:
    """Submit all pending commands to the driver."""
    gl_function("glFlush")()


def allocate_float_depth(renderbuffer: int, size: tuple[int, int], samples: int) -> None:
    """Allocate 32-bit float depth for a renderbuffer; `samples` 0: no multisampling."""
    gl_function("glBindRenderbuffer", ctypes.c_uint, ctypes.c_uint)(_RENDERBUFFER, renderbuffer)
    allocate = gl_function(
        "glRenderbufferStorageMultisample",
        ctypes.c_uint, ctypes.c_int, ctypes.c_uint, ctypes.c_int, ctypes.c_int,
    )  # fmt: skip
    allocate(_RENDERBUFFER, samples, _DEPTH_COMPONENT32F, *size)


def allocate_depth_texture(size: tuple[int, int], levels: int = 1) -> None:
    """Allocate 32-bit float depth with `levels` mip levels for the bound 2D texture."""
    allocate = gl_function("glTexStorage2D", _ENUM, _INT, _ENUM, _INT, _INT)
    allocate(_TEXTURE_2D, levels, _DEPTH_COMPONENT32F, *size)


def limit_levels(texture: int, first: int, last: int) -> None:
    """Restrict sampling to a range of mip levels, so that another level can be a render target."""
    limit = gl_function("glTextureParameteri", _ENUM, _ENUM, _INT)
    limit(texture, _BASE_LEVEL, first)
    limit(texture, _MAX_LEVEL, last)


def allocate_half_floats(size: tuple[int, ...], levels: int, components: int = 4) -> None:
    """Allocate half floats for the bound texture or texture array.

    Args:
        size: width, height and, for an array, layers.
        levels: number of mip levels.
        components: 3 or 4.
    """
    kind = _TEXTURE_2D if len(size) == 2 else _TEXTURE_2D_ARRAY
    allocate = gl_function(f"glTexStorage{len(size)}D", _ENUM, _INT, _ENUM, *(_INT for _ in size))
    allocate(kind, levels, _HALF_FLOATS[components], *size)


def create_cube_array(size_px: int, levels: int, cubes: int) -> int:
    """Create an array of cube maps of RGBA half floats, filtered linearly; return its name.

    Args:
        size_px: texels across a face.
        levels: number of mip levels.
        cubes: number of cube maps.
    """
    name = ctypes.c_uint()
    create = gl_function("glCreateTextures", _ENUM, _INT, ctypes.c_void_p)
    create(_TEXTURE_CUBE_MAP_ARRAY, 1, ctypes.addressof(name))
    allocate = gl_function("glTextureStorage3D", _ENUM, _INT, _ENUM, _INT, _INT, _INT)
    allocate(name.value, levels, _HALF_FLOATS[4], size_px, size_px, 6 * cubes)
    set_parameter = gl_function("glTextureParameteri", _ENUM, _ENUM, _INT)
    set_parameter(name.value, _MIN_FILTER, _LINEAR_MIPMAP_LINEAR)
    set_parameter(name.value, _MAG_FILTER, _LINEAR)
    return name.value


def upload_half_floats(texture: int, level: int, pixels: NDArray[np.float16]) -> None:
    """Upload RGB (height, width, 3), contiguous, to a whole mip level of a 2D texture."""
    height, width, _ = pixels.shape
    gl_function("glPixelStorei", _ENUM, _INT)(_UNPACK_ALIGNMENT, 1)
    upload = gl_function(
        "glTextureSubImage2D", _ENUM, _INT, _INT, _INT, _INT, _INT, _ENUM, _ENUM, ctypes.c_void_p
    )
    upload(texture, level, 0, 0, width, height, _RGB, _HALF_FLOAT, pixels.ctypes.data)


def allocate_texture_array(internal_format: int, levels: int, size: tuple[int, int, int]) -> None:
    """Allocate the bound texture array: width, height and layers."""
    allocate = gl_function("glTexStorage3D", _ENUM, _INT, _ENUM, _INT, _INT, _INT)
    allocate(_TEXTURE_2D_ARRAY, levels, internal_format, *size)


def upload_layer(level: int, layer: int, size: tuple[int, int], rgba: bytes) -> None:
    """Upload 8-bit RGBA to one mip level of one layer of the bound texture array."""
    upload = gl_function(
        "glTexSubImage3D",
        _ENUM, _INT, _INT, _INT, _INT, _INT, _INT, _INT, _ENUM, _ENUM, ctypes.c_char_p,
    )  # fmt: skip
    upload(_TEXTURE_2D_ARRAY, level, 0, 0, layer, *size, 1, _RGBA, _UNSIGNED_BYTE, rgba)


def view_layer(array: int, internal_format: int, levels: int, layer: int) -> int:
    """Create a 2D texture view of one layer, without a copy; return its name."""
    name = ctypes.c_uint()
    gl_function("glGenTextures", _INT, ctypes.c_void_p)(1, ctypes.addressof(name))
    view = gl_function(
        "glTextureView", _ENUM, _ENUM, _ENUM, _ENUM, _ENUM, _ENUM, _ENUM, _ENUM
    )  # fmt: skip
    view(name.value, _TEXTURE_2D, array, internal_format, 0, levels, layer, 1)
    return name.value


def delete_texture(name: int) -> None:
    """Delete a texture that moderngl does not own."""
    names = ctypes.c_uint(name)
    gl_function("glDeleteTextures", _INT, ctypes.c_void_p)(1, ctypes.addressof(names))


def copy_region(
    source: int,
    target: int,
    level: int,
    first_px: tuple[int, int],
    to_px: tuple[int, int],
    size_px: tuple[int, int],
) -> None:
    """Copy a rectangle between two 2D textures.

    Args:
        source, target: texture names.
        level: mip level of both.
        first_px, to_px: left and top, in the source and in the target.
        size_px: width and height.
    """
    copy = gl_function(
        "glCopyImageSubData",
        _ENUM, _ENUM, _INT, _INT, _INT, _INT,
        _ENUM, _ENUM, _INT, _INT, _INT, _INT, _INT, _INT, _INT,
    )  # fmt: skip
    copy(
        source, _TEXTURE_2D, level, *first_px, 0, target, _TEXTURE_2D, level, *to_px, 0, *size_px, 1
    )


class IndirectDraws:
    """Multi-draws of indexed triangles; commands and draw counts are in GPU buffers.

    Moderngl needs the draw count on the CPU, and calling it takes longer than a short draw. Each
    function is therefore looked up once.
    """

    def __init__(self) -> None:
        self.use_program = gl_function("glUseProgram", _ENUM)
        self._bind_vertex_array = gl_function("glBindVertexArray", _ENUM)
        self._bind_buffer = gl_function("glBindBuffer", _ENUM, _ENUM)
        self._draw = gl_function(
            "glMultiDrawElementsIndirectCountARB",
            _ENUM, _ENUM, ctypes.c_void_p, ctypes.c_void_p, _INT, _INT,
        )  # fmt: skip

    def bind(self, commands: int, counts: int, vertex_array: int) -> None:
        """Bind the buffers that the next draws use."""
        self._bind_buffer(_DRAW_INDIRECT_BUFFER, commands)
        self._bind_buffer(_PARAMETER_BUFFER, counts)
        self._bind_vertex_array(vertex_array)

    def drawing(
        self, first_command: int, count_index: int, max_commands: int
    ) -> Callable[[], object]:
        """Call that draws as many commands as the counter says, with the bindings at that time."""
        return constant_call(
            self._draw, _TRIANGLES, _UNSIGNED_INT,
            COMMAND_BYTES * first_command, 4 * count_index, max_commands, COMMAND_BYTES,
        )  # fmt: skip


def bind_texture(unit: int, texture: int) -> None:
    """Bind a texture to a unit."""
    gl_function("glBindTextureUnit", _ENUM, _ENUM)(unit, texture)


def bind_textures(textures: Mapping[int, AnyTexture]) -> None:
    """Bind textures to units by a single call; units between them are unbound."""
    if not textures:
        return
    first = min(textures)
    names = (ctypes.c_uint * (1 + max(textures) - first))()
    for unit, texture in textures.items():
        names[unit - first] = texture.glo
    bind = gl_function("glBindTextures", _ENUM, _INT, ctypes.c_void_p)
    bind(first, len(names), ctypes.addressof(names))


class StorageBindings:
    """Buffers bound to consecutive storage bindings.

    Args:
        buffers: buffers in order.
        first: first binding.
    """

    def __init__(self, buffers: Sequence[moderngl.Buffer], first: int = 0):
        self.buffers = tuple(buffers)
        self._names = (ctypes.c_uint * len(buffers))(*(one.glo for one in buffers))
        bind = gl_function("glBindBuffersBase", _ENUM, _ENUM, _INT, ctypes.c_void_p)
        address = ctypes.addressof(self._names)
        self.bind = constant_call(bind, _SHADER_STORAGE_BUFFER, first, len(buffers), address)

    @property
    def size(self) -> int:
        """Size of the buffers in bytes."""
        return sum(one.size for one in self.buffers)
