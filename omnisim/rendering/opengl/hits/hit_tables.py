"""Textures for shaders with `ground_truth/intersect.glsl`."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from omnisim.core.arrays import Floats
from omnisim.rendering.opengl.capture.pixel_map import bind_tiles
from omnisim.rendering.opengl.gl.shader_files import uniform
from omnisim.rendering.opengl.hits.visibility_pass import VisibilityPass
from omnisim.rendering.opengl.world.draw_item import DrawItem, InstanceTransforms
from omnisim.rendering.opengl.world.triangle_table import table_texture, write_table

_DRAW_ITEM = np.dtype(  # as in shaders/ground_truth/tables.glsl
    [
        ("first", "<u4"),
        ("flags", "<u4"),
        ("unused", "<u4", 2),
        ("viewpoint_from_mesh", "<f4", (3, 4)),
        ("second_matrix", "<f4", (3, 4)),
        ("unused_too", "<u4", 4),
    ]
)
_MASKED, _DOUBLE_SIDED, _FLIPS_WINDING = 1, 2, 4  # flags
_UNITS = {"u_triangle_ids": 0, "u_corners": 2, "u_draw_items": 3, "u_primitives": 6}


class HitTables:
    """Textures of visible triangles and their draw items."""

    def __init__(self, visibility: VisibilityPass):
        self._visibility = visibility
        self.refresh()

    def refresh(self) -> None:
        """Update after the buffers changed."""
        visibility = self._visibility
        draws = visibility.buffers.draw_items
        self._draw_items = np.zeros(len(draws), dtype=_DRAW_ITEM)
        self._draw_items["first"] = [draw.first for draw in draws]
        self._draw_items["flags"] = [_flags(draw, visibility.both_sides) for draw in draws]
        entries = len(draws) * _DRAW_ITEM.itemsize // 16
        self._texture = table_texture(visibility.buffers.context, entries, "the scene's instances")
        self._batch: moderngl.Texture | None = None

    def bind_program(self, program: moderngl.Program, rig_from_optical: Floats) -> None:
        """Set the constant uniforms of a program, with rig_from_optical (3, 3)."""
        visibility = self._visibility
        bind_tiles(program, visibility.plan, rig_from_optical)
        for name, unit in _UNITS.items():
            uniform(program, name).value = unit
        depth_limits_m = (visibility.near_m, min(visibility.far_m, 3e38))
        uniform(program, "u_depth_limits_m").value = depth_limits_m

    def update(self, transforms: InstanceTransforms, second_matrices: Floats) -> None:
        """Write each draw item's transform and second matrix (n, 3, 3) or (n, 3, 4), and bind."""
        self._draw_items["viewpoint_from_mesh"] = transforms.viewpoint_from_mesh[:, :3]
        self._draw_items["second_matrix"][..., : second_matrices.shape[-1]] = second_matrices
        write_table(self._texture, self._draw_items)
        self._bind(self._visibility.id_atlas, self._texture)

    def update_batch(
        self,
        ids: moderngl.Texture | moderngl.TextureArray,
        transforms: Sequence[InstanceTransforms],
        viewpoints_from_optical: Floats,
    ) -> None:
        """Write draw items, normal matrices and camera rotation of each image, and bind the tables.

        Args:
            ids: texture array of triangle IDs.
            transforms: transforms of the draw items, per image.
            viewpoints_from_optical: (images, 3, 3) camera rotations.
        """
        count = len(self._draw_items)
        tables = np.zeros((len(transforms), count + 1), dtype=_DRAW_ITEM)
        tables[:, :count] = self._draw_items
        tables["viewpoint_from_mesh"][:, count, :, :3] = viewpoints_from_optical
        for table, one in zip(tables, transforms, strict=True):
            table["viewpoint_from_mesh"][:count] = one.viewpoint_from_mesh[:, :3]
            table["second_matrix"][:count, :, :3] = one.normal_from_mesh
        entries = tables.nbytes // 16
        if self._batch is None or self._batch.width * self._batch.height < entries:
            context = self._visibility.buffers.context
            self._batch = table_texture(context, entries, "the instances of a batch")
        write_table(self._batch, tables.ravel())
        self._bind(ids, self._batch)

    @property
    def image_bytes(self) -> int:
        """Size of one batch image's draw items, bytes."""
        return int(_DRAW_ITEM.itemsize * (len(self._draw_items) + 1))

    def _bind(
        self, ids: moderngl.Texture | moderngl.TextureArray, draw_items: moderngl.Texture
    ) -> None:
        visibility = self._visibility
        ids.use(_UNITS["u_triangle_ids"])
        visibility.buffers.triangles.corners.use(_UNITS["u_corners"])
        draw_items.use(_UNITS["u_draw_items"])
        visibility.triangle_ids.texture.use(_UNITS["u_primitives"])


def _flags(draw: DrawItem, both_sides: bool) -> int:
    return (
        _MASKED * (draw.material.hit_cutoff > 0.0)
        + _DOUBLE_SIDED * (draw.material.double_sided or both_sides)
        + _FLIPS_WINDING * draw.flips_winding
    )
