"""Occlusion of an image's points from the next viewpoint."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from omnisim.core.arrays import Bytes, Floats
from omnisim.core.pending import Pending
from omnisim.rendering.opengl.capture.pixel_map import valid_pixels_array
from omnisim.rendering.opengl.gl.framebuffers import clear_target, framebuffer, use_target
from omnisim.rendering.opengl.gl.gpu_textures import renderbuffer
from omnisim.rendering.opengl.gl.pixel_readback import Pixels
from omnisim.rendering.opengl.gl.shader_files import build_program, columns_first, uniform
from omnisim.rendering.opengl.hits.ray_hit_pass import RayHitPass

_POINTS_UNIT, _PRIMITIVES_UNIT = 4, 5


class OcclusionPass:
    """Casts a ray from the next viewpoint to each hit point; GPU resources are created once.

    Args:
        hits: pass of the current viewpoint; its triangle IDs are redrawn from the next one.

    Raises:
        GraphicsError: out of GPU memory.
    """

    def __init__(self, hits: RayHitPass):
        self._hits, pixels, context = hits, hits.pixels, hits.pixels.context
        defines = ("PARTS",) if len(hits.parts) > 1 else ()
        program = build_program(context, "capture/image.vert", hits.occlusion_shader, defines)
        hits.prepare(program, np.eye(3))
        uniform(program, "u_points").value = _POINTS_UNIT
        uniform(program, "u_hit_primitives").value = _PRIMITIVES_UNIT
        self._rig_from_viewpoint = uniform(program, "u_rig_from_viewpoint")
        self._vertex_array = valid_pixels_array(context, program, pixels.valid)
        occluded = renderbuffer(context, pixels.size_px, 1, dtype="u1")
        self._target = framebuffer(context, [occluded])
        # once: pixels without a ray are never drawn
        clear_target(self._target, None)

    def begin(
        self,
        world_from_rig: Floats,
        world_from_objects: Sequence[Floats],
        next_from_current: Floats,
    ) -> Pending[Bytes]:
        """Draw, and start to read; the result is the occlusion, encoded as in occlusion.frag.

        Args:
            world_from_rig: (4, 4) next pose.
            world_from_objects: (4, 4) each, next poses of the dynamic objects.
            next_from_current: (n, 3, 4) per draw item, from the current to the next viewpoint
                frame.
        """
        visibility = self._hits.visibility
        transforms = visibility.buffers.instance_transforms(
            world_from_rig[:3, 3], world_from_objects
        )
        self._rig_from_viewpoint.write(columns_first(world_from_rig[:3, :3].T))
        if len(self._hits.parts) > 1:
            clear_target(self._target, None)
        # each part may show the points of all pixels
        for _ in self._hits.using_parts(self._vertex_array.program, np.eye(3)):
            visibility.render([(world_from_rig, world_from_objects)])
            use_target(self._target)
            self._hits.tables.update(transforms, next_from_current)
            self._hits.bind()
            self._hits.points.use(_POINTS_UNIT)
            self._hits.primitives.use(_PRIMITIVES_UNIT)
            self._vertex_array.render()
        width, height = self._hits.pixels.size_px
        occluded = np.empty((height, width), dtype=np.uint8)
        reading = self._hits.readback.start((Pixels(self._target), occluded))
        return Pending(reading.finish).then(lambda _: occluded)
