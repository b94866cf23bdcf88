"""Ranges along the beams of a scanner: every triangle is cut by the plane of the scan."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.scene.scene_buffers import DrawItem, SceneBuffers
from omnisim.gpu.shader_files import build_compute_shader
from omnisim.gpu.uniforms import columns_first
from omnisim.scene.model import AlphaMode

# A blended surface is glass or a picture with soft edges. The beam goes through where less than
# half of what is behind it is hidden.
_BLENDED_CUTOFF = 0.5
_GROUP_SIZE = 64  # triangles; local_size_x in range.comp
_MOST_GROUPS = 65535  # in one direction, which every GPU allows
_VERTICES, _INDICES, _BEAMS, _RANGES = range(4)  # bindings in range.comp and vertex_words.glsl
_NOTHING_HIT = np.float32(np.inf)


class RangePass:
    """Casts the beams of a scanner into a scene; everything on the GPU is made once.

    Opaque surfaces reflect on both sides. Through the holes of masked materials, and where blended
    ones hide less than half of what is behind, a beam goes on.

    Args:
        context: where.
        buffers: the scene and its dynamic objects; other passes may draw from them, too.
        angles_rad: (n,) of the beams in the scanner's frame, counter-clockwise from its x axis,
            equally spaced, from −π at the lowest to π at the most.
        reach_m: surfaces farther away need not be found; may be infinite.
        hidden: names of the dynamic objects' instances that beams go through.

    Raises:
        GraphicsError: a scene that is too large for the GPU's shaders to read.
        SceneError: a hidden name that no dynamic object has.
    """

    def __init__(
        self,
        context: moderngl.Context,
        buffers: SceneBuffers,
        angles_rad: NDArray[np.float64],
        reach_m: float = math.inf,
        hidden: Collection[str] = (),
    ):
        self._context, self._buffers, self._reach_m = context, buffers, reach_m
        self._shown = buffers.shown(hidden)
        buffers.check_readable("to scan them")
        self._in_field_of_view = bool(np.abs(angles_rad).max() <= 0.5 * np.pi)
        directions = np.stack((np.cos(angles_rad), np.sin(angles_rad)), axis=-1)
        self._beams = context.buffer(directions.astype("<f4"))
        self._nothing_hit = np.full(len(angles_rad), _NOTHING_HIT, dtype="<f4").tobytes()
        self._ranges = context.buffer(self._nothing_hit)
        self._solid = build_compute_shader(context, "scene/range.comp")
        self._holed = build_compute_shader(context, "scene/range.comp", ("HOLES",))
        self._holed["u_texture"] = 0
        increment_rad = angles_rad[1] - angles_rad[0] if len(angles_rad) > 1 else 1.0
        for program in (self._solid, self._holed):
            program["u_angle_min"] = angles_rad[0]
            program["u_angle_increment"] = increment_rad

    def cast(
        self,
        world_from_scanner: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]] = (),
    ) -> NDArray[np.float64]:
        """Ranges (n,) in metres from a pose (4, 4), objects at theirs; +inf: nothing is hit."""
        buffers = self._buffers
        placement = buffers.instance_transforms(world_from_scanner[:3, 3], world_from_objects)
        scanner_from_viewpoint = np.eye(4)
        scanner_from_viewpoint[:3, :3] = world_from_scanner[:3, :3].T
        matrices = columns_first(scanner_from_viewpoint @ placement.viewpoint_from_mesh)
        centres_m = placement.centres_m @ scanner_from_viewpoint[:3, :3].T
        met = self._shown & self._may_meet(centres_m, buffers.radii_m)
        self._ranges.write(self._nothing_hit)
        self._beams.bind_to_storage_buffer(_BEAMS)
        self._ranges.bind_to_storage_buffer(_RANGES)
        buffers.vertices.bind_to_storage_buffer(_VERTICES)
        buffers.indices.bind_to_storage_buffer(_INDICES)
        for index in np.flatnonzero(met):
            self._cast_draw(buffers.draw_items[index], matrices[index])
        self._context.memory_barrier(self._context.BUFFER_UPDATE_BARRIER_BIT)
        return np.frombuffer(self._ranges.read(), dtype="<f4").astype(np.float64)

    def _may_meet(
        self, centres_m: NDArray[np.float64], radii_m: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Which spheres (n,), centres (n, 3) in the scanner's frame, the beams may touch."""
        touched = np.abs(centres_m[:, 2]) <= radii_m
        touched &= np.linalg.norm(centres_m, axis=1) - radii_m <= self._reach_m
        if self._in_field_of_view:
            touched &= centres_m[:, 0] >= -radii_m
        return touched

    def _cast_draw(self, draw: DrawItem, scanner_from_mesh: NDArray[np.float32]) -> None:
        material = draw.material
        program = self._solid if material.alpha_mode is AlphaMode.OPAQUE else self._holed
        if program is self._holed:
            is_masked = material.alpha_mode is AlphaMode.MASK
            program["u_base_alpha"] = material.base_color[3]
            program["u_alpha_cutoff"] = material.alpha_cutoff if is_masked else _BLENDED_CUTOFF
            draw.texture.use(0)
        triangles = draw.count // 3
        program["u_scanner_from_mesh"].write(scanner_from_mesh)
        program["u_first"] = draw.first
        program["u_triangles"] = triangles
        groups = -(-triangles // _GROUP_SIZE)
        rows = 1 + groups // _MOST_GROUPS
        program.run(-(-groups // rows), rows)
