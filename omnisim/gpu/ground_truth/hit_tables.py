"""What lookups in the visible triangles have in common: textures, and what each draw is."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.ground_truth.triangle_table import table_texture, write_table
from omnisim.gpu.ground_truth.visibility_pass import VisibilityPass
from omnisim.gpu.ground_truth.visibility_program import alpha_cutoff
from omnisim.gpu.scene.scene_buffers import DrawItem, InstanceTransforms

_RECORD = np.dtype(  # of a draw, as in shaders/ground_truth/tables.glsl
    [
        ("first", "<u4"),
        ("kind", "<u4"),
        ("unused", "<u4", 2),
        ("viewpoint_from_mesh", "<f4", (3, 4)),
        ("second_matrix", "<f4", (3, 4)),
        ("unused_too", "<u4", 4),
    ]
)
# What a record says of a draw's material, in the bits of one number.
_HOLED, _DOUBLE_SIDED, _MIRRORED = 1, 2, 4
_ATLAS, _CORNERS, _DRAWS, _NUMBERS = 0, 2, 3, 6  # texture units


class DrawItemTable:
    """What a lookup needs to know of each draw, on the GPU.

    Args:
        context: where.
        draws: all of the scene.

    Attributes:
        texture: the table.
    """

    def __init__(self, context: moderngl.Context, draws: Sequence[DrawItem]):
        self._records = np.zeros(len(draws), dtype=_RECORD)
        self._records["first"] = [draw.first for draw in draws]
        self._records["kind"] = [_kind(draw) for draw in draws]
        entries = len(draws) * _RECORD.itemsize // 16
        self.texture = table_texture(context, entries, "the scene's instances")

    def write(self, placement: InstanceTransforms, second_matrices: NDArray[np.float64]) -> None:
        """Say where the draws are, and another matrix of each (n, 3, 3) or (n, 3, 4)."""
        self._records["viewpoint_from_mesh"] = placement.viewpoint_from_mesh[:, :3]
        self._records["second_matrix"][..., : second_matrices.shape[-1]] = second_matrices
        write_table(self.texture, self._records)


def connect_tables(program: moderngl.Program, visibility: VisibilityPass) -> None:
    """Tell a program with `surface_lookup.glsl` where its textures are."""
    program["u_atlas"] = _ATLAS
    program["u_corners"] = _CORNERS
    program["u_draws"] = _DRAWS
    program["u_numbers"] = _NUMBERS
    program["u_depth_limits_m"] = (visibility.near_m, min(visibility.far_m, 3e38))


def connect_places(program: moderngl.Program, visibility: VisibilityPass) -> None:
    """Tell a program with `place.glsl` how large the atlas is."""
    program["u_atlas_px"] = (visibility.plan.width_px, visibility.plan.height_px)


def use_tables(visibility: VisibilityPass, draws: DrawItemTable) -> None:
    """Bind the textures."""
    visibility.id_atlas.use(_ATLAS)
    visibility.buffers.triangles.corners.use(_CORNERS)
    draws.texture.use(_DRAWS)
    visibility.triangle_ids.texture.use(_NUMBERS)


def _kind(draw: DrawItem) -> int:
    return (
        _HOLED * (alpha_cutoff(draw.material) > 0.0)
        + _DOUBLE_SIDED * draw.material.double_sided
        + _MIRRORED * draw.flips_winding
    )
