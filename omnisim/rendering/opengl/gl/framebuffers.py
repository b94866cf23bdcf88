"""Render targets: complete when they are made, with each pass ended before the next."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import moderngl

from omnisim.rendering.opengl.gl import debug
from omnisim.rendering.opengl.gl.buffers import AllocationError
from omnisim.rendering.opengl.gl.functions import ENUM, INT, POINTER, end_pass, gl_function
from omnisim.rendering.opengl.gl.gpu_textures import depth_array
from omnisim.rendering.opengl.gl.state import CLEAR_DEPTH, GlState

COLORS, DEPTH = 0x8CE0, 0x8D00  # attachments; further colors follow the first
LAYER_EXTENSIONS = {"GL_ARB_shader_draw_parameters", "GL_ARB_shader_viewport_layer_array"}


def framebuffer(
    context: moderngl.Context,
    colors: Sequence[moderngl.Texture | moderngl.TextureArray | moderngl.Renderbuffer] = (),
    depth: moderngl.Texture | moderngl.Renderbuffer | None = None,
) -> moderngl.Framebuffer:
    """Framebuffer of attachments of one size; an `AllocationError` names them."""
    try:
        target = context.framebuffer(list(colors), depth)
    except moderngl.Error as error:
        kinds = [f"{color.size}, {color.components} × {color.dtype}" for color in colors]
        kinds += [] if depth is None else [f"{depth.size}, depth"]
        raise AllocationError(f"a framebuffer of {'; '.join(kinds)}", str(error)) from None
    debug.label(debug.FRAMEBUFFER, target.glo)
    # moderngl enables all attachments only when it binds a target
    attachments = (ENUM * len(colors))(*range(COLORS, COLORS + len(colors)))
    draw = gl_function("glNamedFramebufferDrawBuffers", ENUM, INT, POINTER)
    draw(target.glo, len(colors), attachments)
    return target


def depth_target(
    context: moderngl.Context, texture: moderngl.Texture, size: tuple[int, int], level: int
) -> moderngl.Framebuffer:
    """Render target of `size` that draws into a mip level of a depth texture with levels."""
    target = context.empty_framebuffer(size)
    target.depth_mask = True
    attach_texture(target.glo, texture.glo, DEPTH, level)
    return target


def draws_layers(context: moderngl.Context) -> bool:
    """True if a vertex shader can choose the layer, and knows its draw call."""
    return context.extensions >= LAYER_EXTENSIONS


def layered_target(
    context: moderngl.Context, *colors: moderngl.TextureArray
) -> tuple[moderngl.Framebuffer, moderngl.TextureArray]:
    """Framebuffer with all layers of texture arrays, and its readable 32-bit float depth array."""
    width, height, layers = colors[0].size
    depth = depth_array(context, (width, height, layers))
    target = framebuffer(context, colors)
    attach_texture(target.glo, depth.glo, DEPTH)
    return target, depth


def attach_texture(
    framebuffer: int, texture: int, attachment: int = COLORS, level: int = 0
) -> None:
    """Attach a mip level of a texture, or of all layers of an array, to a framebuffer."""
    attach = gl_function("glNamedFramebufferTexture", ENUM, ENUM, ENUM, INT)
    attach(framebuffer, attachment, texture, level)


def attach_layer(
    framebuffer: int, array: int, layer: int, attachment: int = COLORS, level: int = 0
) -> None:
    """Attach one layer of a texture array to a framebuffer."""
    attach = gl_function("glNamedFramebufferTextureLayer", ENUM, ENUM, ENUM, INT, INT)
    attach(framebuffer, attachment, array, level, layer)


def use_target(target: moderngl.Framebuffer) -> None:
    """Draw to a target, with moderngl's state of it."""
    end_pass(target.ctx)
    target.use()


@contextmanager
def within(target: moderngl.Framebuffer, rectangle_px: tuple[int, int, int, int]) -> Iterator[None]:
    """Draw to a rectangle of a target only: left, top, width and height."""
    target.scissor = rectangle_px
    try:
        use_target(target)
        yield
    finally:
        target.scissor = None  # type: ignore[assignment]  # moderngl's stub lacks it


def clear_target(
    target: moderngl.Framebuffer, *colors: tuple[float, float, float, float] | None
) -> None:
    """Clear each attachment in a pass of its own, by default to 0; None: one of integers."""
    use_target(target)
    nothing = [(0.0, 0.0, 0.0, 0.0)] * len(target.color_attachments)
    GlState().clear(colors or nothing, CLEAR_DEPTH)


def resolve(target: moderngl.Framebuffer, multisampled: moderngl.Framebuffer) -> None:
    """Average the samples of a target into another, in a pass of its own."""
    end_pass(target.ctx)
    target.ctx.copy_framebuffer(target, multisampled)
