"""Range pass: laser scanner ranges, from the intersections of all triangles with the scan plane."""

from __future__ import annotations

import math
from collections.abc import Collection
from itertools import pairwise

import moderngl
import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.world import ObjectPart, Poses
from omnisim.rendering.opengl.gl.buffers import gpu_buffer, written_buffer
from omnisim.rendering.opengl.gl.pixel_readback import PixelReadback
from omnisim.rendering.opengl.gl.shader_files import build_compute_shader, columns_first
from omnisim.rendering.opengl.world.draw_item import DrawItem
from omnisim.rendering.opengl.world.geometry_store import bind_triangles, window_defines
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.world.scene_textures import TextureArray
from omnisim.scene.surface_kind import SurfaceKind

_GROUP_SIZE = 256  # triangles, as in range.comp
_MAX_GROUPS = 65535  # per dimension; every GPU allows as many
_BEAMS, _RANGES, _ITEMS = 2, 3, 4  # bindings in range.comp
_ITEM = np.dtype(  # as in range.comp
    [
        ("scanner_from_mesh", "<f4", (4, 4)),
        ("first", "<u4"),
        ("triangles", "<u4"),
        ("first_group", "<u4"),
        ("layer", "<u4"),
        ("base_alpha", "<f4"),
        ("alpha_cutoff", "<f4"),
        ("unused", "<u4", 2),
    ]
)
_NO_HIT = np.float32(np.inf)

# Defines of a program that casts beams at items, and the texture array of the items.
_Kind = tuple[tuple[str, ...], TextureArray | None]


class RangePass:
    """Casts a scanner's beams into a scene; GPU resources are created once.

    Opaque surfaces reflect on both sides. Beams pass through the holes of masked materials, and
    through blended ones with alpha below one half.

    Args:
        angles_rad: (n,) beam angles in the scanner's frame, counter-clockwise from its x axis,
            equally spaced, within [−π, π].
        max_range_m: range beyond which surfaces may be missed; may be infinite.
        hidden: parts of dynamic objects that beams pass through.

    Raises:
        GraphicsError: a scene too large for the GPU's shaders to read.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        angles_rad: Floats,
        max_range_m: float = math.inf,
        hidden: Collection[ObjectPart] = (),
    ):
        context = buffers.context
        self._context, self._buffers, self._max_range_m = context, buffers, max_range_m
        self._hidden = hidden
        increment_rad = angles_rad[1] - angles_rad[0] if len(angles_rad) > 1 else 1.0
        self._angles_rad = angles_rad[0], increment_rad
        self._compiled_windows: tuple[str, ...] | None = None
        self._programs: dict[tuple[str, ...], moderngl.ComputeShader] = {}
        self.refresh()
        self._is_front_only = bool(np.abs(angles_rad).max() <= 0.5 * np.pi)
        directions = np.stack((np.cos(angles_rad), np.sin(angles_rad)), axis=-1)
        self._beams = gpu_buffer(context, directions.astype("<f4"))
        no_hits = np.full(len(angles_rad), _NO_HIT, dtype="<f4")
        self._no_hits = gpu_buffer(context, no_hits)
        self._ranges = gpu_buffer(context, no_hits.nbytes)
        self._readback = PixelReadback(context)

    def refresh(self) -> None:
        """Update after the buffers changed."""
        buffers, context = self._buffers, self._context
        buffers.check_readable("to scan them")
        windows = window_defines(context, buffers.vertices, buffers.indices)
        kinds: dict[_Kind, list[int]] = {}
        for index in np.flatnonzero(buffers.shown(self._hidden)).tolist():
            kinds.setdefault(_kind(buffers.draw_items[index]), []).append(index)
        if windows != self._compiled_windows:
            self._compiled_windows, self._programs = windows, {}
        for defines in {defines for defines, _ in kinds} - self._programs.keys():
            program = build_compute_shader(context, "scene/range.comp", (*defines, *windows))
            program["u_angle_min"], program["u_angle_increment"] = self._angles_rad
            self._programs[defines] = program
        self._kinds = tuple(kinds)
        self._starts = np.cumsum([0, *map(len, kinds.values())])
        self._order = np.array([index for some in kinds.values() for index in some], dtype=np.intp)
        items = [buffers.draw_items[index] for index in self._order.tolist()]
        self._table = np.zeros(len(items), dtype=_ITEM)
        for name, values in (
            ("first", [item.first for item in items]),
            ("triangles", [item.triangles for item in items]),
            ("layer", [item.texture_layer.layer for item in items]),
            ("base_alpha", [item.material.base_color[3] for item in items]),
            ("alpha_cutoff", [item.material.hit_cutoff for item in items]),
        ):
            self._table[name] = values
        self._items = written_buffer(context, self._table.nbytes)

    def cast(self, world_from_scanner: Floats, world_from_objects: Poses = ()) -> Floats:
        """Ranges (n,) in m from a pose (4, 4), with the objects at their poses; +inf: no hit."""
        buffers = self._buffers
        buffers.deform(world_from_objects)
        transforms = buffers.instance_transforms(world_from_scanner[:3, 3], world_from_objects)
        scanner_from_viewpoint = np.eye(4)
        scanner_from_viewpoint[:3, :3] = world_from_scanner[:3, :3].T
        centers_m = transforms.centers_m @ scanner_from_viewpoint[:3, :3].T
        radii_m = transforms.radii_m  # of spheres that beams may hit
        may_hit = np.abs(centers_m[:, 2]) <= radii_m
        may_hit &= np.linalg.norm(centers_m, axis=1) - radii_m <= self._max_range_m
        if self._is_front_only:
            may_hit &= centers_m[:, 0] >= -radii_m
        kept = may_hit[self._order]
        table = self._table[kept]
        viewpoint_from_mesh = transforms.viewpoint_from_mesh[self._order[kept]]
        table["scanner_from_mesh"] = columns_first(scanner_from_viewpoint @ viewpoint_from_mesh)
        groups = np.append(0, np.cumsum(-(-table["triangles"].astype(np.intp) // _GROUP_SIZE)))
        table["first_group"] = groups[:-1]
        self._items.write(table)
        self._context.copy_buffer(self._ranges, self._no_hits)
        self._beams.bind_to_storage_buffer(_BEAMS)
        self._ranges.bind_to_storage_buffer(_RANGES)
        self._items.bind_to_storage_buffer(_ITEMS)
        bind_triangles(self._context, buffers.vertices, buffers.indices)
        starts = np.searchsorted(np.flatnonzero(kept), self._starts)
        ranges = pairwise(starts.tolist()), pairwise(groups[starts].tolist())
        for (defines, array), items, (first, end) in zip(self._kinds, *ranges, strict=True):
            if end > first:
                program, groups_of_kind = self._programs[defines], end - first
                if array is not None:
                    array.array.use()
                program["u_first_item"], program["u_end_item"] = items
                program["u_first_group"] = first
                rows = 1 + groups_of_kind // _MAX_GROUPS
                program.run(-(-groups_of_kind // rows), rows)
        self._context.memory_barrier(self._context.BUFFER_UPDATE_BARRIER_BIT)
        ranges_m = np.empty(self._ranges.size // 4, dtype=np.float32)
        self._readback.read((self._ranges, ranges_m))
        return ranges_m.astype(np.float64)


def _kind(item: DrawItem) -> _Kind:
    if not item.kind & SurfaceKind.HOLES:
        return (), None
    array = item.texture_layer.array
    return ("HOLES",) if array is None else ("HOLES", "TEXTURED"), array
