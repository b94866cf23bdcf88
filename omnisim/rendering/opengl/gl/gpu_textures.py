"""Textures and renderbuffers: limits are known before, and OpenGL's error is seen after each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TypeVar

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl import debug
from omnisim.rendering.opengl.gl.buffers import AllocationError, check_allocation
from omnisim.rendering.opengl.gl.functions import ENUM, INT, POINTER, end_pass, gl_function

AnyTexture = moderngl.Texture | moderngl.Texture3D | moderngl.TextureArray
TextureT = TypeVar("TextureT", moderngl.Texture, moderngl.Texture3D, moderngl.TextureArray)

DEPTH = "d4"  # type of a renderbuffer of depth
SRGB8_ALPHA8, RGBA8 = 0x8C43, 0x8058
_DEPTH_COMPONENT32F, _RGB16F, _RGBA16F = 0x8CAC, 0x881B, 0x881A
_TEXTURE_2D, _CUBE_MAP_ARRAY = 0x0DE1, 0x9009
_MIN_FILTER, _MAG_FILTER, _LINEAR, _LINEAR_MIPMAP_LINEAR = 0x2801, 0x2800, 0x2601, 0x2703
_BASE_LEVEL, _MAX_LEVEL = 0x813C, 0x813D
_RGB, _RGBA, _HALF_FLOAT, _UNSIGNED_BYTE = 0x1907, 0x1908, 0x140B, 0x1401
_UNPACK_ALIGNMENT = 0x0CF5
_LIMITS = "GL_MAX_TEXTURE_SIZE", "GL_MAX_TEXTURE_SIZE", "GL_MAX_ARRAY_TEXTURE_LAYERS"
_PROXY_TEXTURE_2D, _WIDTH, _FLOAT, _RGBA32F = 0x8064, 0x1000, 0x1406, 0x8814


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
    return _finished(texture, is_linear)


def fits_texture(size: tuple[int, int], has_half_floats: bool) -> bool:
    """Ask OpenGL, without an allocation, whether it takes an RGBA texture of floats."""
    internal_format, width = _RGBA16F if has_half_floats else _RGBA32F, (INT * 1)()
    describe = gl_function("glTexImage2D", ENUM, *(INT,) * 5, ENUM, ENUM, POINTER)
    describe(_PROXY_TEXTURE_2D, 0, internal_format, *size, 0, _RGBA, _FLOAT, None)
    read = gl_function("glGetTexLevelParameteriv", ENUM, INT, ENUM, POINTER)
    read(_PROXY_TEXTURE_2D, 0, _WIDTH, width)
    return width[0] == size[0]


def texture_3d(
    context: moderngl.Context, size: tuple[int, int, int], content: NDArray[np.float16]
) -> moderngl.Texture3D:
    """RGBA half floats, interpolated between, and clamped to the edge."""
    with _allocation(context, "a texture", *size, limits=("GL_MAX_3D_TEXTURE_SIZE",) * 3):
        texture = context.texture3d(size, 4, content, dtype="f2")
    texture.repeat_z = False
    return _finished(texture, is_linear=True)


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
    return _finished(array)


def byte_textures(
    context: moderngl.Context, size: tuple[int, int, int], levels: int, stored: int
) -> tuple[moderngl.TextureArray, list[moderngl.Texture]]:
    """Array of 8-bit RGBA textures with mip levels, and its layers as textures, without a copy.

    Moderngl does not free the layers. They are `stored` as `RGBA8` or `SRGB8_ALPHA8`.
    """
    width, height, layers = size
    names = (ENUM * layers)()
    with _allocation(context, "a texture array", *size):
        array = context.texture_array((1, 1, 1), 4)  # moderngl has no sRGB
        _allocate(array.glo, levels, stored, *size)
        gl_function("glGenTextures", INT, POINTER)(layers, names)
        for layer, name in enumerate(names):
            view = gl_function("glTextureView", *(ENUM,) * 8)
            view(name, _TEXTURE_2D, array.glo, stored, 0, levels, layer, 1)
    views = [context.external_texture(name, (width, height), 4, 0, "f1") for name in names]
    return _finished(array), [_finished(view) for view in views]


def cube_array(context: moderngl.Context, size_px: int, levels: int, cubes: int) -> int:
    """Name of an array of cube maps of RGBA half floats with mip levels, filtered linearly."""
    names = (ENUM * 1)()
    with _allocation(context, "an array of cube maps", size_px, size_px, 6 * cubes):
        create = gl_function("glCreateTextures", ENUM, INT, POINTER)
        create(_CUBE_MAP_ARRAY, 1, names)
        _allocate(names[0], levels, _RGBA16F, size_px, size_px, 6 * cubes)
    debug.label(debug.TEXTURE, names[0])
    set_parameter = gl_function("glTextureParameteri", ENUM, ENUM, INT)
    set_parameter(names[0], _MIN_FILTER, _LINEAR_MIPMAP_LINEAR)
    set_parameter(names[0], _MAG_FILTER, _LINEAR)
    return int(names[0])


def depth_texture(
    context: moderngl.Context, size: tuple[int, int], levels: int = 1
) -> moderngl.Texture:
    """32-bit float depth; with levels, moderngl takes it for one texel: see `depth_target`."""
    with _allocation(context, "a depth texture", *size):
        # large ones without moderngl's own allocation
        texture = context.depth_texture(size if levels == 1 else (1, 1))
        _allocate(texture.glo, levels, _DEPTH_COMPONENT32F, *size)
    texture.compare_func = ""
    texture.repeat_x = texture.repeat_y = False
    return _finished(texture)


def depth_array(context: moderngl.Context, size: tuple[int, int, int]) -> moderngl.TextureArray:
    """32-bit float depth texture array: width, height and layers."""
    with _allocation(context, "a depth texture array", *size):
        # moderngl has no layered depth: its color texture gets other storage
        depth = context.texture_array((1, 1, 1), 1)
        _allocate(depth.glo, 1, _DEPTH_COMPONENT32F, *size)
    depth.repeat_x = depth.repeat_y = False
    return _finished(depth)


def renderbuffer(
    context: moderngl.Context,
    size: tuple[int, int],
    components: int,
    dtype: str = "f1",
    samples: int = 0,
) -> moderngl.Renderbuffer:
    """Renderbuffer; `samples` 0: no multisampling; `dtype` `DEPTH`: 32-bit float depth."""
    with _allocation(context, "a renderbuffer", *size):
        if dtype == DEPTH:
            buffer = context.depth_renderbuffer(size, samples=samples)
            storage = "glNamedRenderbufferStorageMultisample"
            allocate = gl_function(storage, ENUM, INT, ENUM, INT, INT)
            allocate(buffer.glo, samples, _DEPTH_COMPONENT32F, *size)
        else:
            buffer = context.renderbuffer(size, components, samples=samples, dtype=dtype)
    debug.label(debug.RENDERBUFFER, buffer.glo)
    return buffer


def limit_levels(texture: int, first: int, last: int) -> None:
    """Restrict sampling to a range of mip levels, so that another level can be a render target."""
    limit = gl_function("glTextureParameteri", ENUM, ENUM, INT)
    limit(texture, _BASE_LEVEL, first)
    limit(texture, _MAX_LEVEL, last)


def upload(
    texture: int, level: int, pixels: NDArray[np.float16 | np.uint8], layer: int | None = None
) -> None:
    """Upload RGB or RGBA (height, width, n) to a whole mip level, of a layer of an array."""
    height, width, components = pixels.shape
    size = (0, 0, width, height) if layer is None else (0, 0, layer, width, height, 1)
    gl_function("glPixelStorei", ENUM, INT)(_UNPACK_ALIGNMENT, 1)
    kinds = ENUM, INT, *(INT for _ in size), ENUM, ENUM, POINTER
    write = gl_function(f"glTextureSubImage{len(size) // 2}D", *kinds)
    texels = np.ascontiguousarray(pixels)
    kind = _HALF_FLOAT if texels.dtype == np.float16 else _UNSIGNED_BYTE
    write(texture, level, *size, (_RGB, _RGBA)[components - 3], kind, texels.ctypes.data)


def delete_texture(name: int) -> None:
    """Delete a texture that moderngl does not own."""
    gl_function("glDeleteTextures", INT, POINTER)(1, (ENUM * 1)(name))


def copy_region(
    source: int,
    target: int,
    level: int,
    first_px: tuple[int, int],
    to_px: tuple[int, int],
    size_px: tuple[int, int],
) -> None:
    """Copy a rectangle of a mip level, by left and top in both, between 2D textures by name."""
    place = ENUM, ENUM, INT, INT, INT, INT
    copy = gl_function("glCopyImageSubData", *place, *place, INT, INT, INT)
    from_place, to_place = (source, _TEXTURE_2D, level), (target, _TEXTURE_2D, level)
    copy(*from_place, *first_px, 0, *to_place, *to_px, 0, *size_px, 1)


def copy_textures(copies: Mapping[moderngl.Texture, moderngl.Texture]) -> None:
    """Copy textures of one level, by source, in a pass of their own."""
    for number, (source, target) in enumerate(copies.items()):
        if number == 0:
            end_pass(source.ctx)
        copy_region(source.glo, target.glo, 0, (0, 0), (0, 0), source.size)


def bind_texture(unit: int, texture: int) -> None:
    """Bind a texture to a unit."""
    gl_function("glBindTextureUnit", ENUM, ENUM)(unit, texture)


def bind_textures(textures: Mapping[int, AnyTexture]) -> None:
    """Bind textures to units by a single call; units between them are unbound."""
    if not textures:
        return
    first = min(textures)
    names = (ENUM * (1 + max(textures) - first))()
    for unit, texture in textures.items():
        names[unit - first] = texture.glo
    bind = gl_function("glBindTextures", ENUM, INT, POINTER)
    bind(first, len(names), names)


@contextmanager
def _allocation(
    context: moderngl.Context, kind: str, *size: int, limits: Sequence[str] = _LIMITS
) -> Iterator[None]:
    """Check a size before its allocation in a `with` block, and OpenGL's error after it."""
    what = f"{kind} of {' × '.join(map(str, size))} texels"
    for side, limit in zip(size, limits, strict=False):
        if side > int(context.info[limit]):
            raise AllocationError(what, f"this GPU takes at most {context.info[limit]}")
    yield
    check_allocation(context, what)


def _allocate(texture: int, levels: int, internal_format: int, *size: int) -> None:
    """Allocate a texture anew, with immutable storage."""
    storage = f"glTextureStorage{len(size)}D"
    allocate = gl_function(storage, ENUM, INT, ENUM, *(INT for _ in size))
    allocate(texture, levels, internal_format, *size)


def _finished(texture: TextureT, is_linear: bool = False) -> TextureT:
    """Label a new texture, and set its filter."""
    debug.label(debug.TEXTURE, texture.glo)
    texture.filter = (moderngl.LINEAR if is_linear else moderngl.NEAREST,) * 2
    if is_linear:
        texture.repeat_x = texture.repeat_y = False
    return texture


def check_image_size(
    context: moderngl.Context,
    width_px: int,
    height_px: int,
    what: str = "an image",
    has_half_floats: bool = False,
) -> None:
    """Refuse an image larger than the GPU allows, before anything is allocated.

    Args:
        context: OpenGL context.
        width_px, height_px: size of the image.
        what: for the message.
        has_half_floats: its largest texture has half floats, else floats.

    Raises:
        GraphicsError: the message names the size and the limit.
    """
    limit, size = int(context.info["GL_MAX_TEXTURE_SIZE"]), (width_px, height_px)
    if max(size) > limit:
        reason = f"this GPU takes at most {limit}"
    elif not fits_texture(size, has_half_floats):
        reason = f"this GPU takes no texture of {width_px * height_px >> 16 + has_half_floats} MiB"
    else:
        return
    raise GraphicsError(f"{what} of {width_px} × {height_px} px: {reason}; make it smaller")
