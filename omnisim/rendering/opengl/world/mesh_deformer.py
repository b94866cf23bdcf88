"""Deforms meshes on the GPU: skins and morph targets, written to the scene's buffers."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats32, Uints32
from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl.buffers import gpu_allocation, gpu_buffer, written_buffer
from omnisim.rendering.opengl.gl.shader_files import build_compute_shader
from omnisim.rendering.opengl.world.geometry_store import IndexRange, TriangleTable
from omnisim.scene.motion.deformation import Deformation

_GROUP_SIZE = 64  # local_size_x of the shaders
_MAX_GROUPS = 65535  # every GPU allows as many
_MAX_JOINTS = 8  # per vertex
_BOUND = np.dtype(  # as in shaders/scene/deform.comp
    [
        ("position", "<f4", 3),
        ("vertex", "<u4"),
        ("normal", "<f4", 3),
        ("first_offset", "<u4"),
        ("joints", "<u4", _MAX_JOINTS),
        ("shares", "<f4", _MAX_JOINTS),
        ("first_weight", "<u4"),
        ("targets", "<u4"),
        ("step", "<u4"),
        ("unused", "<u4"),
    ]
)
_OFFSET = np.dtype([("position", "<f4", 4), ("normal", "<f4", 4)])


class MeshDeformer:
    """Deforms a scene's meshes by world time; a frame uploads only joints and weights.

    Raises:
        GraphicsError: the data does not fit on the GPU.
    """

    def __init__(self, context: moderngl.Context, ranges: Sequence[IndexRange]):
        self._context = context
        placed = {index_range.base: index_range.mesh.deformation for index_range in ranges}
        self._deformations = [
            deformation for deformation in placed.values() if deformation is not None
        ]
        bases = [base for base, deformation in placed.items() if deformation is not None]
        bounds, offsets = _tables(self._deformations, bases)
        corners = np.concatenate(
            [_corners(index_range) for index_range in ranges if index_range.mesh.deformation]
        )
        self._count, self._corner_count = len(bounds), len(corners)
        if max(self._count, self._corner_count) > _GROUP_SIZE * _MAX_GROUPS:
            raise GraphicsError(
                f"meshes that deform have {max(self._count, self._corner_count) // 3} triangles: "
                f"expected at most {_GROUP_SIZE * _MAX_GROUPS // 3}"
            )
        largest = max(bounds.nbytes, offsets.nbytes)
        limit = int(context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
        if largest > limit:
            raise GraphicsError(f"meshes that deform take {largest} bytes: this GPU allows {limit}")
        matrices, weights = self._state(0.0)
        with gpu_allocation("meshes that deform", "make the scene smaller"):
            self._bound = [
                gpu_buffer(context, bounds),
                gpu_buffer(context, offsets),
                written_buffer(context, matrices),
                written_buffer(context, weights),
            ]
            self._corners = gpu_buffer(context, corners)
        self._deform = build_compute_shader(context, "scene/deform.comp")
        self._copy = build_compute_shader(context, "scene/deform_corners.comp")
        self._deform["u_count"], self._copy["u_count"] = self._count, self._corner_count
        self._time_s: float | None = None
        self._copied: tuple[TriangleTable, float] | None = None

    def run(self, time_s: float, vertices: moderngl.Buffer, table: TriangleTable | None) -> None:
        """Write the vertices for another time and, if a table is given, their triangles."""
        context = self._context
        vertices.bind_to_storage_buffer(0)
        if time_s != self._time_s:
            matrices, weights = self._state(time_s)
            self._bound[2].write(matrices)
            self._bound[3].write(weights)
            for binding, buffer in enumerate(self._bound, start=1):
                buffer.bind_to_storage_buffer(binding)
            # previous draws may still read the vertices
            context.memory_barrier(context.SHADER_STORAGE_BARRIER_BIT)
            self._deform.run(-(-self._count // _GROUP_SIZE))
            context.memory_barrier(
                context.VERTEX_ATTRIB_ARRAY_BARRIER_BIT
                | context.SHADER_STORAGE_BARRIER_BIT
                | context.BUFFER_UPDATE_BARRIER_BIT  # growing a buffer copies it
            )
            self._time_s = time_s
        if table is None or self._copied == (table, time_s):
            return
        self._corners.bind_to_storage_buffer(1)
        table.corners.bind_to_image(0, read=True, write=True)
        context.memory_barrier(context.SHADER_IMAGE_ACCESS_BARRIER_BIT)  # and the table
        self._copy.run(-(-self._corner_count // _GROUP_SIZE))
        context.memory_barrier(
            context.TEXTURE_FETCH_BARRIER_BIT
            | context.SHADER_IMAGE_ACCESS_BARRIER_BIT
            | context.TEXTURE_UPDATE_BARRIER_BIT  # edits append corners
        )
        self._copied = table, time_s

    def _state(self, time_s: float) -> tuple[Floats32, Floats32]:
        """Rows (joints, 3, 4) of all joint transforms, and weights (n,) of all morph targets."""
        matrices = [deformation.matrices_at(time_s)[:, :3] for deformation in self._deformations]
        weights = [
            np.zeros(1),
            *(deformation.weights_at(time_s) for deformation in self._deformations),
        ]
        return (
            np.concatenate(matrices).astype(np.float32), np.concatenate(weights).astype(np.float32)
        )  # fmt: skip


def _tables(
    deformations: Sequence[Deformation], bases: Sequence[int]
) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """Vertices and the offsets of their morph targets."""
    bounds, offsets = [], [np.zeros(0, dtype=_OFFSET)]
    first_joint, first_weight, first_offset = 0, 1, 0
    for deformation, base in zip(deformations, bases, strict=True):
        count, width = deformation.joints.shape
        part = np.zeros(count, dtype=_BOUND)
        part["position"], part["vertex"] = deformation.positions, base + np.arange(count)
        if deformation.normals is not None:
            part["normal"] = deformation.normals
        part["joints"][:, :width] = deformation.joints + np.uint32(first_joint)
        part["shares"][:, :width] = deformation.shares
        first_joint += len(deformation.skeleton.nodes)
        if deformation.targets is not None:
            targets = np.zeros(deformation.targets.positions.shape[:2], dtype=_OFFSET)
            targets["position"][..., :3] = deformation.targets.positions
            if deformation.targets.normals is not None:
                targets["normal"][..., :3] = deformation.targets.normals
            part["first_offset"] = first_offset + np.arange(count)
            part["first_weight"], part["targets"] = first_weight, len(targets)
            part["step"] = count
            first_weight += len(targets)
            first_offset += targets.size
            offsets.append(targets.ravel())
        bounds.append(part)
    return np.concatenate(bounds), np.concatenate(offsets)


def _corners(index_range: IndexRange) -> Uints32:
    """Entries (n, 2) of a range in the table of triangles, and their vertices."""
    vertices = index_range.mesh.triangles.ravel() + np.uint32(index_range.base)
    entries = index_range.first + np.arange(len(vertices))
    return np.stack((entries, vertices), axis=1).astype("<u4")
