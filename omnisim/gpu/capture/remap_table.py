"""Where in the atlas each captured pixel looks: found once, as no pose changes it."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import GraphicsError
from omnisim.gpu.atlas.tile_plan import TilePlan
from omnisim.gpu.capture.capture_pass import Capture, connect_cube

# A larger table would take more memory than all the rest. Larger pictures find their rays in
# every frame anew.
MOST_BYTES = 128 * 2**20
_BYTES = 8  # of a captured pixel's place
_PLACES, _LEVELS = 5, 6  # bindings, as in `capture/picture.frag`


class RemapTable:
    """Atlas coordinates of every captured pixel; what `capture/picture.frag` looks up.

    A mirror's mesh, or a lens whose rays are searched for step by step, costs nothing more in a
    frame than any other.

    Args:
        context: where.
        size: width and height of the picture.
        supersampling: captured pixels to a side of a pixel.
        capture: rays of the captured pixels, made with `Emit.LOOKUP`.
        plan: the faces.
        rig_from_optical: (3, 3).

    Attributes:
        valid: (height, width), pixels of which at least one captured pixel sees something.

    Raises:
        GraphicsError: no memory for it.
    """

    @staticmethod
    def fits(size: tuple[int, int], supersampling: int) -> bool:
        """Whether a picture is small enough for a table."""
        return _BYTES * size[0] * size[1] * supersampling**2 <= MOST_BYTES

    def __init__(
        self,
        context: moderngl.Context,
        size: tuple[int, int],
        supersampling: int,
        capture: Capture,
        plan: TilePlan,
        rig_from_optical: NDArray[np.float64],
    ):
        fine_size = (size[0] * supersampling, size[1] * supersampling)
        connect_cube(capture.program, plan, rig_from_optical)
        try:
            target = context.framebuffer(
                [context.renderbuffer(fine_size, parts, dtype="f4") for parts in (2, 1)]
            )
            context.disable(moderngl.BLEND | moderngl.DEPTH_TEST | moderngl.CULL_FACE)
            target.use()
            target.clear(-1.0, -1.0)
            capture.draw()
            places = _by_pixel(target, 0, size, supersampling)
            self.valid = (places[..., 0] >= 0.0).any(axis=-1)
            self._places = context.buffer(places)
            self._levels = None
            if plan.max_level:
                self._levels = context.buffer(_by_pixel(target, 1, size, supersampling))
        except moderngl.Error as reason:
            raise GraphicsError(
                f"a capture of {fine_size[0]} × {fine_size[1]} px does not fit on this GPU "
                f"({reason}): make the picture or camera.supersampling smaller"
            ) from None

    @property
    def defines(self) -> tuple[str, ...]:
        """Of the program that looks up."""
        return ("STORED_LOOKUPS",) if self._levels is None else ("STORED_LOOKUPS", "LEVELS")

    def use(self) -> None:
        """Bind the buffers."""
        self._places.bind_to_storage_buffer(_PLACES)
        if self._levels is not None:
            self._levels.bind_to_storage_buffer(_LEVELS)


def _by_pixel(
    target: moderngl.Framebuffer, attachment: int, size: tuple[int, int], supersampling: int
) -> NDArray[np.float32]:
    """Values (height, width, supersampling², parts) of an attachment, those of a pixel together."""
    parts = (2, 1)[attachment]
    width, height = size
    fine = np.empty((height, supersampling, width, supersampling, parts), dtype=np.float32)
    target.read_into(fine, components=parts, attachment=attachment, dtype="f4")
    together = fine.transpose(0, 2, 1, 3, 4)
    return np.ascontiguousarray(together).reshape(height, width, supersampling**2, parts)
