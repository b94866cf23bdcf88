"""The virtual cameras: the scene drawn into the faces of the cube at the effective viewpoint."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import GraphicsError
from omnisim.gpu.face_drawing import FaceDrawing
from omnisim.gpu.face_plan import Face, FacePlan
from omnisim.gpu.reversed_depth import float_depth
from omnisim.gpu.scene_buffers import Placement, SceneBuffers, is_blended
from omnisim.gpu.surface_program import SurfacePrograms, variant_of
from omnisim.gpu.uniforms import columns_first


class CubePass:
    """Draws the faces into one atlas texture.

    Args:
        context: where.
        buffers: the scene and its movers; other passes may draw from them, too.
        surfaces: their programs, lit by the scene's lamps.
        plan: the faces.
        near_m, far_m, samples: of the virtual cameras.
        unlit: show plain base colours.
        background: linear RGB where nothing is hit.
        hidden: names of the movers' instances that are not drawn.

    Attributes:
        plan: the faces and their places.
        atlas: linear RGBA, half floats, first row of each face's picture first.

    Raises:
        GraphicsError: the atlas is larger than the GPU allows.
        SceneError: a hidden name that no mover has.
    """

    def __init__(
        self,
        context: moderngl.Context,
        buffers: SceneBuffers,
        surfaces: SurfacePrograms,
        plan: FacePlan,
        near_m: float,
        far_m: float,
        samples: int,
        unlit: bool,
        background: tuple[float, float, float],
        hidden: Collection[str] = (),
    ):
        self._context, self._buffers, self.plan = context, buffers, plan
        self._background = background
        self._drawing = FaceDrawing(context, buffers, plan, near_m, far_m)
        size = (plan.width_px, plan.height_px)
        limit = int(context.info["GL_MAX_TEXTURE_SIZE"])
        if max(size) > limit:
            raise GraphicsError(
                f"virtual cameras of {max(face.size_px for face in plan.faces)} px need an atlas "
                f"of {size[0]} × {size[1]} px: this GPU takes at most {limit}; "
                "make the picture, virtual_cameras.texels_per_pixel or size_px smaller"
            )
        self.atlas = _texture(context, size)
        self.atlas.repeat_x = self.atlas.repeat_y = False
        mipmapped = moderngl.LINEAR_MIPMAP_LINEAR if plan.max_level else moderngl.LINEAR
        self.atlas.filter = (mipmapped, moderngl.LINEAR)
        samples = min(samples, int(context.max_samples))
        try:
            self._resolved = context.framebuffer([self.atlas]) if samples > 1 else None
            color = (
                context.renderbuffer(size, 4, samples=samples, dtype="f2")
                if samples > 1
                else self.atlas
            )
            depth = float_depth(context, size, samples if samples > 1 else 0)
            self._target = context.framebuffer([color], depth)
        except moderngl.Error as reason:
            raise GraphicsError(
                f"virtual cameras of {max(face.size_px for face in plan.faces)} px with {samples} "
                f"samples do not fit on this GPU ({reason}): make the picture, "
                "virtual_cameras.size_px or virtual_cameras.samples smaller"
            ) from None
        self._programs = [surfaces[variant_of(draw.material, unlit)] for draw in buffers.draws]
        blended = [is_blended(draw.material) for draw in buffers.draws]
        shown = buffers.shown(hidden)
        self._opaque = np.flatnonzero(shown & ~np.array(blended))
        self._blended = np.flatnonzero(shown & np.array(blended))

    def render(
        self,
        world_from_rig: NDArray[np.float64],
        world_from_movers: Sequence[NDArray[np.float64]] = (),
    ) -> moderngl.Texture:
        """Draw all faces from a pose (4, 4), movers at theirs, and return the atlas."""
        context, target = self._context, self._target
        viewpoint_m = world_from_rig[:3, 3]
        placement = self._buffers.place(viewpoint_m, world_from_movers)
        for program in set(self._programs):
            program.set_viewpoint(viewpoint_m)
        order = self._order(placement)
        here_matrices = columns_first(placement.here_from_mesh)
        normal_matrices = columns_first(placement.normal_from_mesh)

        self._drawing.begin(target, (*self._background, 1.0))
        context.blend_func = (
            moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA, moderngl.ZERO, moderngl.ONE
        )  # fmt: skip

        def paint(index: int, clip_from_mesh: NDArray[np.float32]) -> None:
            draw = self._buffers.draws[index]
            blended = is_blended(draw.material)
            target.depth_mask = not blended
            toggle = context.enable if blended else context.disable
            toggle(moderngl.BLEND)
            self._programs[index].draw(
                draw, clip_from_mesh, here_matrices[index], normal_matrices[index]
            )

        self._drawing.draw(target, world_from_rig, placement, order, paint)
        self._drawing.end(target)
        if self._resolved is not None:
            context.copy_framebuffer(self._resolved, target)
        if self.plan.max_level:
            self.atlas.build_mipmaps(0, self.plan.max_level)
        return self.atlas

    def read_face(self, face: Face) -> NDArray[np.float32]:
        """The 90° of a face as last drawn, linear RGB (size, size, 3), first row at the top.

        The plan must have the whole face.
        """
        framebuffer = self._resolved or self._target
        pixels = np.empty((face.size_px, face.size_px, 3), dtype=np.float32)
        region = (*face.corner_px, face.size_px, face.size_px)
        framebuffer.read_into(pixels, region, components=3, dtype="f4")
        return pixels

    def _order(self, placement: Placement) -> NDArray[np.intp]:
        """Draws in the order to draw them: opaque ones from near to far, so that most of what is
        hidden is never shaded; then blended ones from far to near."""
        opaque = self._buffers.from_near_to_far(self._opaque, placement)
        distances = np.linalg.norm(placement.centres_m[self._blended], axis=1)
        blended = self._blended[np.argsort(-distances, kind="stable")]
        for index in blended:
            self._buffers.sort_blended(self._buffers.draws[index], placement.here_from_mesh[index])
        return np.concatenate((opaque, blended))


def _texture(context: moderngl.Context, size: tuple[int, int]) -> moderngl.Texture:
    try:
        return context.texture(size, 4, dtype="f2")
    except moderngl.Error as reason:
        raise GraphicsError(
            f"an atlas of {size[0]} × {size[1]} px does not fit on this GPU ({reason}): "
            "make the picture or virtual_cameras.size_px smaller"
        ) from None
