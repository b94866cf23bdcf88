"""The corridor from a scene to a picture: cube pass, capture, encoding, readback."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera
from omnisim.errors import GraphicsError
from omnisim.gpu.capture.capture_pass import Capture, Emit, connect_cube
from omnisim.gpu.capture.coverage import covering
from omnisim.gpu.capture.remap_table import RemapTable
from omnisim.gpu.degradation.degradation_pass import DegradationPass
from omnisim.gpu.scene.cube_pass import CubePass
from omnisim.gpu.shader_files import build_program


class Picture(NamedTuple):
    """What was read back; first row at the top."""

    rgba: NDArray[np.uint8]  # (height, width, 4): sRGB, alpha 255 where the camera sees something
    linear: NDArray[np.float32] | None  # (height, width, 3), where asked for


class SubFrame(NamedTuple):
    """A part of the time in which a picture is taken."""

    world_from_rig: NDArray[np.float64]  # (4, 4)
    world_from_objects: Sequence[NDArray[np.float64]]
    row_weights: NDArray[np.float32] | None  # (height,) share of each row's exposure; None: all


class Pipeline:
    """Renders one camera in one scene; everything on the GPU is made once.

    Args:
        context: where.
        camera: whose pixels are captured.
        rig_from_optical: (3, 3).
        cube: the virtual cameras.
        make_capture: makes the capture of the camera's rays that emits what is asked for.
        supersampling: the picture has as many times fewer pixels to a side than the camera: as many
            of the camera's are averaged.
        degradation: passes before the encoding.

    Raises:
        GraphicsError: a picture larger than the GPU allows.
    """

    def __init__(
        self,
        context: moderngl.Context,
        camera: CentralCamera,
        rig_from_optical: NDArray[np.float64],
        cube: CubePass,
        make_capture: Callable[[Emit], Capture],
        supersampling: int = 1,
        degradation: DegradationPass | None = None,
    ):
        self._context, self._cube = context, cube
        self._degradation = degradation
        self._size = (camera.width_px // supersampling, camera.height_px // supersampling)
        check_picture_size(context, camera.width_px, camera.height_px)
        fine_size = (camera.width_px, camera.height_px)
        self._lookups = self._capture = None
        valid = np.ones(self._size[::-1], dtype=np.bool_)
        if RemapTable.fits(self._size, supersampling):
            capture = make_capture(Emit.LOOKUP)
            self._lookups = RemapTable(
                context, self._size, supersampling, capture, cube.plan, rig_from_optical
            )
            valid = self._lookups.valid
        else:
            self._capture = make_capture(Emit.COLOR)
            connect_cube(self._capture.program, cube.plan, rig_from_optical)
        try:
            linear_type = "f2" if degradation is None else "f4"
            self._linear = context.texture(self._size, 4, dtype=linear_type)
            self._linear_target = context.framebuffer([self._linear])
            encoded = context.renderbuffer(self._size, 4)
            self._encoded_target = context.framebuffer([encoded])
            self._both_targets = context.framebuffer([encoded, self._linear])
            if self._capture is not None:
                self._fine = context.texture(fine_size, 4, dtype="f2")
                self._fine_target = context.framebuffer([self._fine])
        except moderngl.Error as reason:
            raise GraphicsError(
                f"a capture of {camera.width_px} × {camera.height_px} px does not fit on this GPU "
                f"({reason}): make the picture or camera.supersampling smaller"
            ) from None
        # once: nothing is ever drawn where nothing is valid
        self._both_targets.clear()
        self._picture = self._picture_array(supersampling, valid)
        if degradation is not None:
            encode = build_program(context, "common/full_screen.vert", "capture/encode.frag")
            encode["u_linear"] = 0
            self._encode = context.vertex_array(encode, [])

    def _picture_array(
        self, supersampling: int, valid: NDArray[np.bool_]
    ) -> moderngl.VertexArray | None:
        """What draws the valid pixels; None: there are none."""
        corners = covering(valid)
        if not corners.size:
            return None
        stored = () if self._lookups is None else self._lookups.defines
        program = build_program(
            self._context,
            "capture/picture.vert",
            "capture/picture.frag",
            (f"SUPERSAMPLING {supersampling}", *stored),
        )
        program["u_picture_size_px"] = self._size
        if self._lookups is None:
            program["u_fine"] = 0
        else:
            program["u_atlas"] = 0
            program["u_width_px"] = self._size[0]
        content = [(self._context.buffer(corners), "2f4", "in_corner_px")]
        return self._context.vertex_array(program, content)

    def render(
        self,
        world_from_rig: NDArray[np.float64],
        linear: bool = False,
        world_from_objects: Sequence[NDArray[np.float64]] = (),
    ) -> Picture:
        """Render from a pose (4, 4), objects at theirs; linear colours where asked for."""
        target = self._both_targets if linear else self._encoded_target
        self._draw(target, world_from_rig, world_from_objects)
        rgba = self._read_encoded()
        if not linear:
            return Picture(rgba, None)
        width, height = self._size
        floats = np.empty((height, width, 3), dtype=np.float32)
        self._linear_target.read_into(floats, components=3, dtype="f4")
        return Picture(rgba, floats)

    def render_degraded(
        self,
        sub_frames: Iterable[SubFrame],
        expose: Callable[[float | None], Mapping[str, Any]],
        metered: bool = False,
        linear: bool = False,
    ) -> Picture:
        """Render what the degradation makes of sub-frames.

        Args:
            sub_frames: at least one.
            expose: from the mean luminance to the values of this frame's uniforms.
            metered: whether `expose` wants to know the luminance.
            linear: whether linear colours are asked for.
        """
        degradation = self._degradation
        for sub_frame in sub_frames:
            self._draw(self._both_targets, sub_frame.world_from_rig, sub_frame.world_from_objects)
            degradation.add(self._linear, sub_frame.row_weights)
        finished = degradation.finish(expose(degradation.mean_luminance() if metered else None))
        self._encode_degraded(finished)
        rgba = self._read_encoded()
        floats = np.ascontiguousarray(degradation.read()[..., :3]) if linear else None
        return Picture(rgba, floats)

    def _draw(
        self,
        target: moderngl.Framebuffer,
        world_from_rig: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]],
    ) -> None:
        """DrawItem the ideal picture: encoded, and linear where the target has a place for it."""
        atlas = self._cube.render(world_from_rig, world_from_objects)
        atlas.use(0)
        if self._lookups is not None:
            self._lookups.use()
        else:
            self._fine_target.use()
            self._fine_target.clear()
            self._capture.draw()
            self._fine.use(0)
        target.use()
        if self._picture is not None:
            self._picture.render(moderngl.TRIANGLES)

    def _encode_degraded(self, linear: moderngl.Texture) -> None:
        if self._degradation.encodes:
            self._degradation.encode(self._encoded_target)
        else:
            self._encoded_target.use()
            linear.use(0)
            self._encode.render(moderngl.TRIANGLES, vertices=3)

    def _read_encoded(self) -> NDArray[np.uint8]:
        """The values of the file (height, width, 4)."""
        width, height = self._size
        rgba = np.empty((height, width, 4), dtype=np.uint8)
        self._encoded_target.read_into(rgba, components=4)
        return rgba


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
