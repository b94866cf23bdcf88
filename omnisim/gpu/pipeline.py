"""The corridor from a scene to a picture: cube pass, capture, encoding, readback."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera
from omnisim.errors import GraphicsError
from omnisim.gpu.capture_pass import Capture, connect_cube
from omnisim.gpu.cube_pass import CubePass
from omnisim.gpu.shader_files import build_program


class Picture(NamedTuple):
    """What was read back; first row at the top."""

    rgba: NDArray[np.uint8]  # (height, width, 4): sRGB, alpha 255 where the camera sees something
    linear: NDArray[np.float32] | None  # (height, width, 3), where asked for


class Pipeline:
    """Renders one camera in one scene; everything on the GPU is made once.

    The picture has `supersampling` times fewer pixels to a side than the camera: as many of the
    camera's are averaged.

    Raises:
        GraphicsError: a picture larger than the GPU allows.
    """

    def __init__(
        self,
        context: moderngl.Context,
        camera: CentralCamera,
        rig_from_optical: NDArray[np.float64],
        cube: CubePass,
        capture: Capture,
        supersampling: int = 1,
    ):
        self._context, self._cube, self._capture = context, cube, capture
        self._size = (camera.width_px // supersampling, camera.height_px // supersampling)
        check_picture_size(context, camera.width_px, camera.height_px)
        connect_cube(capture.program, cube.plan, rig_from_optical)
        try:
            self._linear = context.texture(self._size, 4, dtype="f2")
            self._linear_target = context.framebuffer([self._linear])
            self._fine = self._fine_target = None
            if supersampling > 1:
                fine_size = (camera.width_px, camera.height_px)
                self._fine = context.texture(fine_size, 4, dtype="f2")
                self._fine_target = context.framebuffer([self._fine])
            self._encoded_target = context.framebuffer([context.renderbuffer(self._size, 4)])
        except moderngl.Error as reason:
            raise GraphicsError(
                f"a capture of {camera.width_px} × {camera.height_px} px does not fit on this GPU "
                f"({reason}): make the picture or camera.supersampling smaller"
            ) from None
        if self._fine is not None:
            average = build_program(context, "common/full_screen.vert", "capture/average.frag")
            average["u_fine"] = 0
            average["u_supersampling"] = supersampling
            self._average = context.vertex_array(average, [])
        encode = build_program(context, "common/full_screen.vert", "capture/encode.frag")
        encode["u_linear"] = 0
        self._encode = context.vertex_array(encode, [])

    def render(
        self,
        world_from_rig: NDArray[np.float64],
        linear: bool = False,
        world_from_movers: Sequence[NDArray[np.float64]] = (),
    ) -> Picture:
        """Render from a pose (4, 4), movers at theirs; linear colours where they are asked for."""
        atlas = self._cube.render(world_from_rig, world_from_movers)
        captured = self._fine_target or self._linear_target
        captured.use()
        captured.clear()
        atlas.use(0)
        self._capture.draw()
        if self._fine is not None:
            self._linear_target.use()
            self._fine.use(0)
            self._average.render(moderngl.TRIANGLES, vertices=3)
        self._encoded_target.use()
        self._linear.use(0)
        self._encode.render(moderngl.TRIANGLES, vertices=3)
        width, height = self._size
        rgba = np.empty((height, width, 4), dtype=np.uint8)
        self._encoded_target.read_into(rgba, components=4)
        if not linear:
            return Picture(rgba, None)
        floats = np.empty((height, width, 3), dtype=np.float32)
        self._linear_target.read_into(floats, components=3, dtype="f4")
        return Picture(rgba, floats)


def check_picture_size(context: moderngl.Context, width_px: int, height_px: int) -> None:
    """Refuse a picture larger than the GPU allows.

    Raises:
        GraphicsError: naming the size and the limit.
    """
    limit = int(context.info["GL_MAX_TEXTURE_SIZE"])
    if max(width_px, height_px) > limit:
        raise GraphicsError(
            f"a capture of {width_px} × {height_px} px: this GPU takes at most {limit}; "
            "make the picture or camera.supersampling smaller"
        )


def capture_rays(
    context: moderngl.Context, camera: CentralCamera, capture: Capture
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Unit rays (height, width, 3), optical frame, and validity that a capture made with
    `Emit.RAY` gives each pixel.

    Raises:
        GraphicsError: a picture larger than the GPU allows.
    """
    check_picture_size(context, camera.width_px, camera.height_px)
    size = (camera.width_px, camera.height_px)
    target = context.framebuffer([context.renderbuffer(size, 4, dtype="f4")])
    context.disable(moderngl.BLEND | moderngl.DEPTH_TEST | moderngl.CULL_FACE)
    target.use()
    target.clear()
    capture.draw()
    values = np.empty((camera.height_px, camera.width_px, 4), dtype=np.float32)
    target.read_into(values, components=4, dtype="f4")
    return values[..., :3], values[..., 3] > 0.5
