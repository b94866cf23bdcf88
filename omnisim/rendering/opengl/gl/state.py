"""OpenGL state that the passes of each frame set themselves.

Moderngl sets all state of a target whenever it is bound, cleared or read; here only what differs is
set. Between passes blending, culling, depth test, clipping and scissor are off: a pass that enables
one disables it again, also if it is interrupted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import moderngl

from omnisim.rendering.opengl.gl.functions import (
    BOOLEAN,
    ENUM,
    FLOAT,
    INT,
    POINTER,
    constant_call,
    end_pass,
    gl_function,
)

_FRAMEBUFFER, _COLOR, _DEPTH = 0x8D40, 0x1800, 0x1801
_PACK_ALIGNMENT = 0x0D05
_CULL_FACE, _DEPTH_TEST, _BLEND, _SCISSOR_TEST = 0x0B44, 0x0B71, 0x0BE2, 0x0C11
_CLIP_DISTANCES = range(0x3000, 0x3004)  # at tile edges, see shaders/scene/vertex.glsl
_MIRROR_CLIP_DISTANCE = 0x3004  # at a mirror, see shaders/scene/mirror_clip.glsl
_EQUAL, _ALWAYS, _BACK = 0x0202, 0x0207, 0x0405
_CLOCKWISE, _COUNTERCLOCKWISE = 0x0900, 0x0901
_SRC_ALPHA, _ONE_MINUS_SRC_ALPHA, _ZERO, _ONE = 0x0302, 0x0303, 0, 1
_SRC1_COLOR, _SEAMLESS_CUBES = 0x88F9, 0x884F


def set_constants() -> None:
    """Set the state that all passes of a context share.

    Reversed depth, winding, blend function, filters across the edges of cube
    maps, and readback without gaps between rows. Clip-space y points down the image, which reverses
    the winding.
    """
    reverse_depth()
    gl_function("glFrontFace", ENUM)(_CLOCKWISE)
    gl_function("glCullFace", ENUM)(_BACK)
    gl_function("glEnable", ENUM)(_SEAMLESS_CUBES)
    gl_function("glPixelStorei", ENUM, INT)(_PACK_ALIGNMENT, 1)
    blend = gl_function("glBlendFuncSeparate", ENUM, ENUM, ENUM, ENUM)
    blend(_SRC_ALPHA, _ONE_MINUS_SRC_ALPHA, _ZERO, _ONE)


class GlState:
    """Setters of the current context's state; each OpenGL function is looked up once."""

    def __init__(self) -> None:
        self._bind = gl_function("glBindFramebuffer", ENUM, ENUM)
        self._viewport = gl_function("glViewport", INT, INT, INT, INT)
        self._scissor = gl_function("glScissor", INT, INT, INT, INT)
        self._clear_floats = gl_function("glClearBufferfv", ENUM, INT, POINTER)
        self._clear_integers = gl_function("glClearBufferuiv", ENUM, INT, POINTER)
        self.bind_texture = gl_function("glBindTextureUnit", ENUM, ENUM)
        self._texture_barrier = gl_function("glTextureBarrier")
        depth_mask = gl_function("glDepthMask", BOOLEAN)
        self._set_depth_mask = _choice(
            constant_call(depth_mask, False), constant_call(depth_mask, True)
        )
        self._set_depth_function = gl_function("glDepthFunc", ENUM)
        self.set_culling = _capability(_CULL_FACE)
        self._set_depth_test = _capability(_DEPTH_TEST)
        self._set_blending = _capability(_BLEND)
        self._set_scissor_test = _capability(_SCISSOR_TEST)
        self._set_each_clip_distance = [_capability(distance) for distance in _CLIP_DISTANCES]
        self._set_mirror_clip = _capability(_MIRROR_CLIP_DISTANCE)
        face = gl_function("glFrontFace", ENUM)
        self.set_mirrored = _choice(
            constant_call(face, _CLOCKWISE), constant_call(face, _COUNTERCLOCKWISE)
        )
        self._set_blend_function = gl_function("glBlendFuncSeparate", ENUM, ENUM, ENUM, ENUM)

    def use(self, target: moderngl.Framebuffer, has_depth: bool = False) -> None:
        """Draw to all of a target; `has_depth`: write depth, too.

        Binding a moderngl target without depth disables depth writes.
        """
        if has_depth:
            self._set_depth_mask(True)
        end_pass(target.ctx)
        self._bind(_FRAMEBUFFER, target.glo)
        self._viewport(0, 0, *target.size)

    def clear(
        self, colors: Sequence[tuple[float, float, float, float] | None], depth: float
    ) -> None:
        """Clear the bound target: depth, and each color; None marks integer attachments."""
        for number, color in enumerate(colors):
            if color is None:
                self._clear_integers(_COLOR, number, (ENUM * 4)())
            else:
                self._clear_floats(_COLOR, number, (FLOAT * 4)(*color))
        self._clear_floats(_DEPTH, 0, (FLOAT * 1)(depth))

    @contextmanager
    def sampling(
        self,
        unit: int,
        attached: moderngl.Texture | moderngl.TextureArray,
        bound: moderngl.Framebuffer,
    ) -> Iterator[None]:
        """Let compute shaders sample what the bound target has drawn: it is not bound meanwhile.

        Otherwise this is a feedback loop, whose result OpenGL leaves undefined.
        """
        try:
            self._bind(_FRAMEBUFFER, bound.ctx.extra.lasting_target.glo)
            self._texture_barrier()
            self.bind_texture(unit, attached.glo)
            yield
        finally:
            self.bind_texture(unit, 0)
            self._bind(_FRAMEBUFFER, bound.glo)

    @contextmanager
    def drawing(self) -> Iterator[None]:
        """Test and write depth, cull back faces, and clip at tile edges."""
        try:
            self._set_depth_test(True)
            self.set_culling(True)
            self._set_clip_distances(True)
            yield
        finally:
            self._set_depth_test(False)
            self.set_culling(False)
            self._set_clip_distances(False)

    @contextmanager
    def blending(self) -> Iterator[None]:
        """Blend, without writing depth."""
        try:
            self._set_depth_mask(False)
            self._set_blending(True)
            yield
        finally:
            self._set_blending(False)

    @contextmanager
    def blending_panes(self) -> Iterator[None]:
        """Add the light of panes to that behind them times their second color; see `blending`."""
        try:
            self._set_blend_function(_ONE, _SRC1_COLOR, _ZERO, _ONE)
            yield
        finally:
            self._set_blend_function(_SRC_ALPHA, _ONE_MINUS_SRC_ALPHA, _ZERO, _ONE)

    @contextmanager
    def where_clear(self) -> Iterator[None]:
        """Draw where depth has its clear value; back-face culling stays off afterwards."""
        try:
            self.set_culling(False)
            self._set_depth_mask(False)
            self._set_depth_function(_EQUAL)
            yield
        finally:
            self._set_depth_function(GREATER)
            self._set_depth_mask(True)

    @contextmanager
    def setting_depth(self) -> Iterator[None]:
        """Write all depths, whatever the old ones are, with programs without clip distances."""
        try:
            self._set_depth_test(True)
            self._set_depth_function(_ALWAYS)
            yield
        finally:
            self._set_depth_function(GREATER)
            self._set_depth_test(False)

    @contextmanager
    def mirrored(self) -> Iterator[None]:
        """Draw with a mirrored rig, which reverses the winding of all triangles."""
        try:
            self.set_mirrored(True)
            yield
        finally:
            self.set_mirrored(False)

    @contextmanager
    def clipped_at_mirror(self) -> Iterator[None]:
        """Clip at a mirror's plane, with programs that write the distance from it."""
        try:
            self._set_mirror_clip(True)
            yield
        finally:
            self._set_mirror_clip(False)

    @contextmanager
    def within_rectangles(self, target: moderngl.Framebuffer) -> Iterator[Callable[..., None]]:
        """Draw to rectangles of the bound target only.

        Yields:
            Setter of the next rectangle: left, top, width and height; `within`: the rectangle of it
            that is drawn to; None: all.
        """

        def aim(*rectangle_px: int, within: Sequence[int] | None = None) -> None:
            self._viewport(*rectangle_px)
            self._scissor(*(rectangle_px if within is None else within))

        try:
            self._set_scissor_test(True)
            yield aim
        finally:
            self._set_scissor_test(False)
            self._viewport(0, 0, *target.size)

    @contextmanager
    def unclipped(self) -> Iterator[None]:
        """Draw with programs that write no clip distances."""
        try:
            self._set_clip_distances(False)
            yield
        finally:
            self._set_clip_distances(True)

    def _set_clip_distances(self, is_enabled: bool) -> None:
        for toggle in self._set_each_clip_distance:
            toggle(is_enabled)


def _capability(number: int) -> Callable[[bool], object]:
    """Function that enables or disables a capability."""
    enable, disable = gl_function("glEnable", ENUM), gl_function("glDisable", ENUM)
    return _choice(constant_call(disable, number), constant_call(enable, number))


def _choice(*calls: Callable[[], object]) -> Callable[[bool], object]:
    """Function that makes the first call for False, the second for True."""
    return lambda is_enabled: calls[is_enabled]()


# Reversed depth: 1 at the near plane, 0 at infinity, in 32-bit floats that store near/z.
#
# Floats then have a relative precision of 6e-8 at every distance; the usual 24 bits from −1 to 1
# confuse surfaces 10 cm apart at 500 m. The tiles' matrices in `rendering/atlas/tile_plan.py` make
# depth so; this file tells OpenGL.
#
# Source: Reed, "Depth precision visualized", 2015.


CLEAR_DEPTH = 0.0
GREATER = 0x0204  # test that nearer surfaces pass
_LOWER_LEFT, _ZERO_TO_ONE = 0x8CA1, 0x935F


def reverse_depth() -> None:
    """Clip the current context's depth to [0, w], and let the greater one pass."""
    gl_function("glClipControl", ENUM, ENUM)(_LOWER_LEFT, _ZERO_TO_ONE)
    gl_function("glDepthFunc", ENUM)(GREATER)
