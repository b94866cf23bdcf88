"""Textures and renderbuffers: limits are known before, and OpenGL's error is seen after each.

Depth is reversed and float: a depth buffer stores near/z. With 1 at the near plane and 0 at
infinity, floats have a relative precision of 6e-8 at every distance; the usual 24 bits from −1 to 1
confuse surfaces 10 cm apart at 500 m.

Source: Reed, "Depth precision visualized", 2015.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.gl import debug
from omnisim.rendering.opengl.gl.fences import end_pass
from omnisim.rendering.opengl.gl.functions import gl_function
from omnisim.rendering.opengl.gl.memory import AllocationError, check_allocation

AnyTexture = moderngl.Texture | moderngl.Texture3D | moderngl.TextureArray

DEPTH_FUNCTION = ">"  # set per context, see omnisim/rendering/opengl/gl/state.py
CLEAR_DEPTH = 0.0
SRGB8_ALPHA8, RGBA8 = 0x8C43, 0x8058
_DEPTH_COMPONENT32F, _RGB16F, _RGBA16F = 0x8CAC, 0x881B, 0x881A
_TEXTURE_2D, _TEXTURE_2D_ARRAY, _CUBE_MAP_ARRAY = 0x0DE1, 0x8C1A, 0x9009
_MIN_FILTER, _MAG_FILTER, _LINEAR, _LINEAR_MIPMAP_LINEAR = 0x2801, 0x2800, 0x2601, 0x2703
_BASE_LEVEL, _MAX_LEVEL = 0x813C, 0x813D
_RGB, _RGBA, _HALF_FLOAT, _UNSIGNED_BYTE = 0x1907, 0x1908, 0x140B, 0x1401
_UNPACK_ALIGNMENT = 0x0CF5
_ENUM, _INT, _POINTER = ctypes.c_uint, ctypes.c_int, ctypes.c_void_p
_LIMITS = "GL_MAX_TEXTURE_SIZE", "GL_MAX_TEXTURE_SIZE", "GL_MAX_ARRAY_TEXTURE_LAYERS"


def texture_2d(
    context: moderngl.Context,
    size: tuple[int, ...],
    components: int,
    content: NDArray[np.generic] | bytes | None = None,
    dtype: str = "f4",
    levels: int = 1,
    is_linear: bool = False,
) -> moderngl.Texture:
    """Texture whose texels are fetched.

    Args:
        context: OpenGL context.
        size: width and height.
        components: numbers per texel.
        content: texels, contiguous and row by row; None: uninitialized.
        dtype: moderngl's type of the numbers.
        levels: number of mip levels; more than one need half floats and no content.
        is_linear: interpolate between texels, and clamp to the edge.

    Raises:
        AllocationError: no room, or larger than the GPU allows.
    """
    with _allocation(context, "a texture", *size):
        texture = context.texture((size[0], size[1]), components, content, dtype=dtype)
        if levels > 1:
            _allocate(texture.glo, levels, {3: _RGB16F, 4: _RGBA16F}[components], *size)
            limit_levels(texture.glo, 0, levels - 1)
    _finish(texture, is_linear)
    return texture


def texture_3d(
    context: moderngl.Context, size: tuple[int, int, int], content: NDArray[np.float16]
) -> moderngl.Texture3D:
    """RGBA half floats that are interpolated between, and clamped to the edge."""
    with _allocation(context, "a texture", *size, limits=["GL_MAX_3D_TEXTURE_SIZE"] * 3):
        texture = context.texture3d(size, 4, content, dtype="f2")
    _finish(texture, is_linear=True)
    texture.repeat_z = False
    return texture


def texture_array(
    context: moderngl.Context,
    size: tuple[int, int, int],
    components: int,
    dtype: str = "f2",
    levels: int = 1,
) -> moderngl.TextureArray:
    """Texture array: width, height and layers; see `texture_2d`."""
    with _allocation(context, "a texture array", *size):
        array = context.texture_array(size, components, dtype=dtype)
        if levels > 1:
            _allocate(array.glo, levels, _RGBA16F, *size)
            limit_levels(array.glo, 0, levels - 1)
    _finish(array)
    return array


def byte_array(
    context: moderngl.Context, size: tuple[int, int, int], levels: int, stored: int
) -> moderngl.TextureArray:
    """Array of 8-bit RGBA textures with mip levels; `stored`: `RGBA8` or `SRGB8_ALPHA8`."""
    with _allocation(context, "a texture array", *size):
        array = context.texture_array((1, 1, 1), 4)  # moderngl has no sRGB
        _allocate(array.glo, levels, stored, *size)
    _finish(array)
    return array


def byte_layer(
    context: moderngl.Context,
    array: moderngl.TextureArray,
    size: tuple[int, int],
    levels: int,
    stored: int,
    layer: int,
) -> moderngl.Texture:
    """Layer of a `byte_array` as a 2D texture, without a copy; moderngl does not free it."""
    name = ctypes.c_uint()
    gl_function("glGenTextures", _INT, _POINTER)(1, ctypes.addressof(name))
    view = gl_function("glTextureView", *(_ENUM,) * 8)
    view(name.value, _TEXTURE_2D, array.glo, stored, 0, levels, layer, 1)
    return context.external_texture(name.value, size, 4, 0, "f1")


def cube_array(context: moderngl.Context, size_px: int, levels: int, cubes: int) -> int:
    """Name of an array of cube maps of RGBA half floats, filtered linearly.

    Args:
        context: OpenGL context.
        size_px: texels across a face.
        levels: number of mip levels.
        cubes: number of cube maps.
    """
    name = ctypes.c_uint()
    with _allocation(context, "an array of cube maps", size_px, size_px, 6 * cubes):
        create = gl_function("glCreateTextures", _ENUM, _INT, _POINTER)
        create(_CUBE_MAP_ARRAY, 1, ctypes.addressof(name))
        _allocate(name.value, levels, _RGBA16F, size_px, size_px, 6 * cubes)
    debug.label(debug.TEXTURE, name.value)
    set_parameter = gl_function("glTextureParameteri", _ENUM, _ENUM, _INT)
    set_parameter(name.value, _MIN_FILTER, _LINEAR_MIPMAP_LINEAR)
    set_parameter(name.value, _MAG_FILTER, _LINEAR)
    return name.value


def depth_texture(
    context: moderngl.Context, size: tuple[int, int], levels: int = 1
) -> moderngl.Texture:
    """32-bit float depth texture.

    Moderngl takes one with levels for a texture of one texel: see `depth_target`.
    """
    with _allocation(context, "a depth texture", *size):
        # large ones without moderngl's own allocation
        texture = context.depth_texture(size if levels == 1 else (1, 1))
        _allocate(texture.glo, levels, _DEPTH_COMPONENT32F, *size)
    _finish(texture)
    texture.compare_func = ""
    texture.repeat_x = texture.repeat_y = False
    return texture


def depth_array(context: moderngl.Context, size: tuple[int, int, int]) -> moderngl.TextureArray:
    """32-bit float depth texture array: width, height and layers."""
    with _allocation(context, "a depth texture array", *size):
        # moderngl has no layered depth: its color texture gets other storage
        depth = context.texture_array((1, 1, 1), 1)
        _allocate(depth.glo, 1, _DEPTH_COMPONENT32F, *size)
    _finish(depth)
    depth.repeat_x = depth.repeat_y = False
    return depth


def renderbuffer(
    context: moderngl.Context,
    size: tuple[int, int],
    components: int,
    dtype: str = "f1",
    samples: int = 0,
) -> moderngl.Renderbuffer:
    """Renderbuffer; `samples` 0: no multisampling."""
    with _allocation(context, "a renderbuffer", *size):
        buffer = context.renderbuffer(size, components, samples=samples, dtype=dtype)
    debug.label(debug.RENDERBUFFER, buffer.glo)
    return buffer


def depth_renderbuffer(
    context: moderngl.Context, size: tuple[int, int], samples: int
) -> moderngl.Renderbuffer:
    """32-bit float depth buffer; `samples` 0: no multisampling."""
    with _allocation(context, "a depth buffer", *size):
        buffer = context.depth_renderbuffer(size, samples=samples)
        allocate = gl_function(
            "glNamedRenderbufferStorageMultisample", _ENUM, _INT, _ENUM, _INT, _INT
        )
        allocate(buffer.glo, samples, _DEPTH_COMPONENT32F, *size)
    debug.label(debug.RENDERBUFFER, buffer.glo)
    return buffer


def limit_levels(texture: int, first: int, last: int) -> None:
    """Restrict sampling to a range of mip levels, so that another level can be a render target."""
    limit = gl_function("glTextureParameteri", _ENUM, _ENUM, _INT)
    limit(texture, _BASE_LEVEL, first)
    limit(texture, _MAX_LEVEL, last)


def upload_half_floats(texture: int, level: int, pixels: NDArray[np.float16]) -> None:
    """Upload RGB (height, width, 3), contiguous, to a whole mip level of a 2D texture."""
    height, width, _ = pixels.shape
    gl_function("glPixelStorei", _ENUM, _INT)(_UNPACK_ALIGNMENT, 1)
    upload = gl_function(
        "glTextureSubImage2D", _ENUM, _INT, _INT, _INT, _INT, _INT, _ENUM, _ENUM, _POINTER
    )
    upload(texture, level, 0, 0, width, height, _RGB, _HALF_FLOAT, pixels.ctypes.data)


def upload_layer(array: int, level: int, layer: int, pixels: NDArray[np.uint8]) -> None:
    """Upload 8-bit RGBA (height, width, 4) to a whole mip level of a layer."""
    height, width, _ = pixels.shape
    upload = gl_function(
        "glTextureSubImage3D",
        _ENUM, _INT, _INT, _INT, _INT, _INT, _INT, _INT, _ENUM, _ENUM, ctypes.c_char_p,
    )  # fmt: skip
    texels = pixels.tobytes()
    upload(array, level, 0, 0, layer, width, height, 1, _RGBA, _UNSIGNED_BYTE, texels)


def delete_texture(name: int) -> None:
    """Delete a texture that moderngl does not own."""
    names = ctypes.c_uint(name)
    gl_function("glDeleteTextures", _INT, _POINTER)(1, ctypes.addressof(names))


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


def copy_textures(copies: Mapping[moderngl.Texture, moderngl.Texture]) -> None:
    """Copy textures of one level, by source, in a pass of their own."""
    for number, (source, target) in enumerate(copies.items()):
        if number == 0:
            end_pass(source.ctx)
        copy_region(source.glo, target.glo, 0, (0, 0), (0, 0), source.size)


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
    bind = gl_function("glBindTextures", _ENUM, _INT, _POINTER)
    bind(first, len(names), ctypes.addressof(names))


@contextmanager
def _allocation(
    context: moderngl.Context,
    kind: str,
    *size: int,
    limits: Sequence[str] = _LIMITS,
) -> Iterator[None]:
    """Check a size before its allocation in a `with` block, and OpenGL's error after it."""
    what = f"{kind} of {' × '.join(map(str, size))} texels"
    for side, limit in zip(size, limits, strict=False):
        if side > int(context.info[limit]):
            raise AllocationError(what, f"it takes at most {context.info[limit]}")
    yield
    check_allocation(context, what)


def _allocate(texture: int, levels: int, internal_format: int, *size: int) -> None:
    """Allocate a texture anew, with immutable storage."""
    storage = f"glTextureStorage{len(size)}D"
    allocate = gl_function(storage, _ENUM, _INT, _ENUM, *(_INT for _ in size))
    allocate(texture, levels, internal_format, *size)


def _finish(texture: AnyTexture, is_linear: bool = False) -> None:
    """Label a new texture, and set its filter."""
    debug.label(debug.TEXTURE, texture.glo)
    texture.filter = (moderngl.LINEAR if is_linear else moderngl.NEAREST,) * 2
    if is_linear:
        texture.repeat_x = texture.repeat_y = False
