"""Range pass: laser scanner ranges, from the intersections of all triangles with the scan plane."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from omnisim.core.world import ObjectPart
from omnisim.rendering.opengl.geometry.draw_item import DrawItem
from omnisim.rendering.opengl.geometry.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.geometry.triangle_windows import bind_triangles, window_defines
from omnisim.rendering.opengl.gl.buffers import gpu_buffer
from omnisim.rendering.opengl.gl.shader_files import build_compute_shader
from omnisim.rendering.opengl.gl.uniforms import columns_first, uniform
from omnisim.scene.model import AlphaMode

_GROUP_SIZE = 64  # triangles; local_size_x in range.comp
_MAX_GROUPS = 65535  # per dimension; every GPU allows as many
_BEAMS, _RANGES = 2, 3  # bindings in range.comp
_NO_HIT = np.float32(np.inf)


class RangePass:
    """Casts a scanner's beams into a scene; GPU resources are created once.

    Opaque surfaces reflect on both sides. Beams pass through the holes of masked materials, and
    through blended ones with alpha below one half.

    Args:
        buffers: scene and dynamic objects; other passes may share them.
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
        angles_rad: NDArray[np.float64],
        max_range_m: float = math.inf,
        hidden: Collection[ObjectPart] = (),
    ):
        context = buffers.context
        self._context, self._buffers, self._max_range_m = context, buffers, max_range_m
        self._hidden = hidden
        increment_rad = angles_rad[1] - angles_rad[0] if len(angles_rad) > 1 else 1.0
        self._angles_rad = angles_rad[0], increment_rad
        self._compiled_windows: tuple[str, ...] | None = None
        self.refresh()
        self._is_front_only = bool(np.abs(angles_rad).max() <= 0.5 * np.pi)
        directions = np.stack((np.cos(angles_rad), np.sin(angles_rad)), axis=-1)
        self._beams = gpu_buffer(context, directions.astype("<f4"))
        no_hits = np.full(len(angles_rad), _NO_HIT, dtype="<f4")
        self._no_hits = gpu_buffer(context, no_hits)
        self._ranges = gpu_buffer(context, no_hits.nbytes)
        # Drivers move buffers that are read into host memory. Only a copy is read, so that the
        # buffer of the shaders stays on the GPU.
        self._read_copy = context.buffer(reserve=no_hits.nbytes, dynamic=True)

    def refresh(self) -> None:
        """Update after the buffers changed."""
        self._shown = self._buffers.shown(self._hidden)
        buffers = self._buffers
        buffers.check_readable("to scan them")
        windows = window_defines(self._context, buffers.vertices, buffers.indices)
        if windows != self._compiled_windows:
            self._compiled_windows = windows
            self._compile(windows)

    def _compile(self, windows: tuple[str, ...]) -> None:
        context = self._context
        self._opaque = build_compute_shader(context, "scene/range.comp", windows)
        self._masked = build_compute_shader(context, "scene/range.comp", ("HOLES", *windows))
        self._masked["u_texture"] = 0
        for program in (self._opaque, self._masked):
            program["u_angle_min"], program["u_angle_increment"] = self._angles_rad

    def cast(
        self,
        world_from_scanner: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]] = (),
    ) -> NDArray[np.float64]:
        """Ranges (n,) in m from a pose (4, 4), with the objects at their poses; +inf: no hit."""
        buffers = self._buffers
        buffers.deform(world_from_objects)
        transforms = buffers.instance_transforms(world_from_scanner[:3, 3], world_from_objects)
        scanner_from_viewpoint = np.eye(4)
        scanner_from_viewpoint[:3, :3] = world_from_scanner[:3, :3].T
        matrices = columns_first(scanner_from_viewpoint @ transforms.viewpoint_from_mesh)
        centers_m = transforms.centers_m @ scanner_from_viewpoint[:3, :3].T
        hit = self._shown & self._may_hit(centers_m, transforms.radii_m)
        self._context.copy_buffer(self._ranges, self._no_hits)
        self._beams.bind_to_storage_buffer(_BEAMS)
        self._ranges.bind_to_storage_buffer(_RANGES)
        bind_triangles(self._context, buffers.vertices, buffers.indices)
        for index in np.flatnonzero(hit):
            self._cast_item(buffers.draw_items[index], matrices[index])
        self._context.memory_barrier(self._context.BUFFER_UPDATE_BARRIER_BIT)
        self._context.copy_buffer(self._read_copy, self._ranges)
        return np.frombuffer(self._read_copy.read(), dtype="<f4").astype(np.float64)

    def _may_hit(
        self, centers_m: NDArray[np.float64], radii_m: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Mask of spheres (n,) that beams may hit; centers (n, 3) in the scanner's frame."""
        kept = np.abs(centers_m[:, 2]) <= radii_m
        kept &= np.linalg.norm(centers_m, axis=1) - radii_m <= self._max_range_m
        if self._is_front_only:
            kept &= centers_m[:, 0] >= -radii_m
        return kept

    def _cast_item(self, item: DrawItem, scanner_from_mesh: NDArray[np.float32]) -> None:
        material = item.material
        program = self._opaque if material.alpha_mode is AlphaMode.OPAQUE else self._masked
        if program is self._masked:
            program["u_base_alpha"] = material.base_color[3]
            program["u_alpha_cutoff"] = material.hit_cutoff
            item.texture.use(0)
        triangles = item.triangles
        uniform(program, "u_scanner_from_mesh").write(scanner_from_mesh)
        program["u_first"] = item.first
        program["u_triangles"] = triangles
        groups = -(-triangles // _GROUP_SIZE)
        rows = 1 + groups // _MAX_GROUPS
        program.run(-(-groups // rows), rows)
