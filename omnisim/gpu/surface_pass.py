"""What the rays of a picture hit: which triangle, how far, and how it is turned; exactly."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import GraphicsError
from omnisim.gpu.capture_pass import Capture, Emit, connect_cube
from omnisim.gpu.scene_buffers import Draw, Placement
from omnisim.gpu.shader_files import build_program
from omnisim.gpu.uniforms import columns_first
from omnisim.gpu.visibility_pass import VisibilityPass, alpha_cutoff, clear_integers

_RECORD = np.dtype(  # DrawRecord in shaders/ground_truth/surface_lookup.glsl
    [
        ("here_from_mesh", "<f4", (3, 4)),
        ("normal_from_mesh", "<f4", (3, 4)),
        ("first", "<u4"),
        ("kind", "<u4"),
        ("unused", "<u4", 2),
    ]
)
_VERTICES, _INDICES, _DRAWS, _NEIGHBOURS = range(4)  # bindings
# What a record says of a draw's material, in the bits of one number.
_HOLED, _DOUBLE_SIDED, _MIRRORED = 1, 2, 4
_HITS, _SURFACES, _NORMALS, _ALBEDOS = range(4)  # attachments


class Surfaces(NamedTuple):
    """What each pixel's ray hits; first row at the top.

    "Here" has the world's axes and its origin in the effective viewpoint.
    """

    points_m: NDArray[np.float32]  # (height, width, 3), here; nothing is hit: direction
    ranges_m: NDArray[np.float32]  # (height, width); +inf: nothing is hit
    draws: NDArray[np.int32]  # (height, width), into `SceneBuffers.draws`; −1: nothing is hit
    triangles: NDArray[np.uint32]  # (height, width), of the draw
    valid: NDArray[np.bool_]  # (height, width): the pixel has a ray
    normals: NDArray[np.float32] | None  # (height, width, 3), here, unit; 0: nothing is hit
    albedos: NDArray[np.float32] | None  # (height, width, 3) linear RGB; 0: nothing is hit


class GivenRays:
    """A capture whose rays are given anew each time; in the rig frame.

    Attributes:
        program: for `SurfacePass`.
    """

    def __init__(self, context: moderngl.Context, size: tuple[int, int]):
        self.program = build_program(
            context,
            "common/full_screen.vert",
            "ground_truth/given_rays.frag",
            defines=Emit.SURFACE.defines,
        )
        self.program["u_rays"] = 2
        self._rays = context.texture(size, 4, dtype="f4")
        self._rays.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._vertex_array = context.vertex_array(self.program, [])

    def write(self, rays_rig: NDArray[np.float32]) -> None:
        """Give the rays (height, width, 4): directions of any length, and 1 where there is one."""
        self._rays.write(rays_rig)

    def draw(self) -> None:
        """Draw into the framebuffer in use."""
        self._rays.use(2)
        self._vertex_array.render(moderngl.TRIANGLES, vertices=3)


class SurfacePass:
    """Looks every ray of a capture up in the visible triangles; everything is made once.

    Args:
        context: where.
        visibility: which triangles are visible.
        capture: of the rays.
        size: width and height of the picture.
        rig_from_optical: (3, 3).
        emit: what the capture was made to emit: a surface alone, or more.

    Raises:
        GraphicsError: a picture or a scene that does not fit on the GPU.
    """

    def __init__(
        self,
        context: moderngl.Context,
        visibility: VisibilityPass,
        capture: Capture | GivenRays,
        size: tuple[int, int],
        rig_from_optical: NDArray[np.float64],
        emit: Emit = Emit.SURFACE,
    ):
        self._context, self._visibility, self._capture = context, visibility, capture
        self._size, self._rig_from_optical = size, rig_from_optical
        buffers = visibility.buffers
        buffers.check_readable("to look up what its pixels show")
        connect_cube(capture.program, visibility.plan, rig_from_optical)
        capture.program["u_depth_limits_m"] = (visibility.near_m, min(visibility.far_m, 3e38))
        self._has_albedo = emit is Emit.SURFACE_NORMAL_ALBEDO
        if self._has_albedo:
            capture.program["u_albedos"] = 1
        try:
            attachments = [
                context.renderbuffer(size, 4, dtype="f4"),
                context.renderbuffer(size, 2, dtype="u4"),
            ]
            if emit is not Emit.SURFACE:
                attachments.append(context.renderbuffer(size, 4, dtype="f4"))
            if self._has_albedo:
                attachments.append(context.renderbuffer(size, 4, dtype="f2"))
            self._target = context.framebuffer(attachments)
        except moderngl.Error as reason:
            raise GraphicsError(
                f"ground truth of {size[0]} × {size[1]} px does not fit on this GPU ({reason}): "
                "make the picture smaller"
            ) from None
        self._records = np.zeros(len(buffers.draws), dtype=_RECORD)
        self._records["first"] = [draw.first for draw in buffers.draws]
        self._records["kind"] = [_kind(draw) for draw in buffers.draws]
        self._record_buffer = context.buffer(reserve=self._records.nbytes)

    def render(
        self,
        world_from_rig: NDArray[np.float64],
        world_from_movers: Sequence[NDArray[np.float64]] = (),
        normals: bool = False,
        albedos: bool = False,
    ) -> Surfaces:
        """Look all rays up from a pose (4, 4), movers at theirs.

        The last two are read back where they are asked for, if the capture emits them.
        """
        visibility, buffers = self._visibility, self._visibility.buffers
        placement = buffers.place(world_from_rig[:3, 3], world_from_movers)
        visibility.render(world_from_rig, placement)
        self._write_records(placement)
        here_from_optical = world_from_rig[:3, :3] @ self._rig_from_optical
        self._capture.program["u_here_from_optical"].write(columns_first(here_from_optical))
        target = self._target
        target.use()
        target.clear()
        clear_integers(_SURFACES)
        visibility.surfaces.use(0)
        if visibility.albedos is not None:
            visibility.albedos.use(1)
        buffers.vertices.bind_to_storage_buffer(_VERTICES)
        buffers.indices.bind_to_storage_buffer(_INDICES)
        self._record_buffer.bind_to_storage_buffer(_DRAWS)
        buffers.neighbours.bind_to_storage_buffer(_NEIGHBOURS)
        self._capture.draw()
        return self._read(normals, albedos)

    def _write_records(self, placement: Placement) -> None:
        self._records["here_from_mesh"] = placement.here_from_mesh[:, :3]
        self._records["normal_from_mesh"][..., :3] = placement.normal_from_mesh
        self._record_buffer.write(self._records)

    def _read(self, normals: bool, albedos: bool) -> Surfaces:
        width, height = self._size
        hits = np.empty((height, width, 4), dtype=np.float32)
        surfaces = np.empty((height, width, 2), dtype=np.uint32)
        self._target.read_into(hits, components=4, attachment=_HITS, dtype="f4")
        self._target.read_into(surfaces, components=2, attachment=_SURFACES, dtype="u4")
        turned = colors = None
        if normals:
            turned = np.empty((height, width, 3), dtype=np.float32)
            self._target.read_into(turned, components=3, attachment=_NORMALS, dtype="f4")
        if albedos:
            colors = np.empty((height, width, 3), dtype=np.float32)
            self._target.read_into(colors, components=3, attachment=_ALBEDOS, dtype="f4")
        draws = surfaces[..., 0].astype(np.int32) - 1
        ranges_m = hits[..., 3]
        # where a mirror's mesh draws nothing the target is as it was cleared
        ranges_m[draws < 0] = np.inf
        return Surfaces(
            points_m=hits[..., :3],
            ranges_m=ranges_m,
            draws=draws,
            triangles=surfaces[..., 1],
            valid=(surfaces[..., 0] | surfaces[..., 1]) != 0,
            normals=turned,
            albedos=colors,
        )


def _kind(draw: Draw) -> int:
    return (
        _HOLED * (alpha_cutoff(draw.material) > 0.0)
        + _DOUBLE_SIDED * draw.material.double_sided
        + _MIRRORED * draw.mirrored
    )
