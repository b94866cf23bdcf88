"""The ray of each pixel: found once, as no pose changes it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import GraphicsError
from omnisim.gpu.capture.coverage import covering

if TYPE_CHECKING:
    from omnisim.gpu.capture.capture_pass import Capture


class RayTable:
    """Rays of a capture. A mirror's mesh costs a frame no more than a lens.

    Args:
        context: where.
        size: width and height of the picture.
        capture: made with `Emit.RAY`.

    Attributes:
        size: as given.
        rays: texture, unit rays in the optical frame; and 1 where the pixel has one.
        valid: (height, width), which pixels have one.

    Raises:
        GraphicsError: no memory for it.
    """

    def __init__(self, context: moderngl.Context, size: tuple[int, int], capture: Capture):
        self.size, self._context = size, context
        width, height = size
        try:
            self.rays = context.texture(size, 4, dtype="f4")
            self._target = context.framebuffer([self.rays])
        except moderngl.Error as reason:
            raise GraphicsError(
                f"ground truth of {width} × {height} px does not fit on this GPU ({reason}): "
                "make the picture smaller"
            ) from None
        self.rays.filter = (moderngl.NEAREST, moderngl.NEAREST)
        context.disable(moderngl.BLEND | moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._target.use()
        self._target.clear()
        capture.draw()
        self.valid = self._read()[..., 3] > 0.5
        self._corners = covering(self.valid)

    def directions(self) -> NDArray[np.float32]:
        """Rays (n, 3) of the pixels that have one, row by row."""
        return self._read()[..., :3][self.valid]

    def vertex_array(self, program: moderngl.Program) -> moderngl.VertexArray | None:
        """What draws the pixels that have a ray, for `capture/picture.vert`; None: there are
        none."""  # fmt: skip
        if not self._corners.size:
            return None
        program["u_picture_size_px"] = self.size
        corners = self._context.buffer(self._corners)
        return self._context.vertex_array(program, [(corners, "2f4", "in_corner_px")])

    def _read(self) -> NDArray[np.float32]:
        width, height = self.size
        values = np.empty((height, width, 4), dtype=np.float32)
        self._target.read_into(values, components=4, dtype="f4")
        return values
