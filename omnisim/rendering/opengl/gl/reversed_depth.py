"""Reversed depth: 1 at the near plane, 0 at infinity, in 32-bit floats that store near/z.

Floats then have a relative precision of 6e-8 at every distance; the usual 24 bits from −1 to 1
confuse surfaces 10 cm apart at 500 m. The tiles' matrices in `rendering/atlas/tile_plan.py` make
depth so; this file tells OpenGL.

Source: Reed, "Depth precision visualized", 2015.
"""

from __future__ import annotations

from omnisim.rendering.opengl.gl.functions import ENUM, gl_function

CLEAR_DEPTH = 0.0
GREATER = 0x0204  # test that nearer surfaces pass
_LOWER_LEFT, _ZERO_TO_ONE = 0x8CA1, 0x935F


def reverse_depth() -> None:
    """Clip the current context's depth to [0, w], and let the greater one pass."""
    gl_function("glClipControl", ENUM, ENUM)(_LOWER_LEFT, _ZERO_TO_ONE)
    gl_function("glDepthFunc", ENUM)(GREATER)
