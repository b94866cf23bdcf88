"""Mesh deformation over time: morph targets, then linear blend skinning."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats, Floats32, Indices
from omnisim.scene.motion.node_motion import AnimatedNode, Keyframes, NodePoses


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Joints of a skin, shared by all meshes of the skin."""

    nodes: Sequence[AnimatedNode | None]  # animated nodes of the joints; None: a static joint
    # (joints, 4, 4) transforms from the bind pose of the mesh to each joint's node; for a static
    # joint, to the world
    node_from_bind: Floats

    @property
    def moves(self) -> bool:
        """True if any joint moves."""
        return any(node is not None for node in self.nodes)

    def matrices_at(self, time_s: float) -> Floats:
        """Transforms (joints, 4, 4) from the mesh's bind pose to the world."""
        matrices = self._latest.get(time_s)
        if matrices is None:
            matrices = self._poses.at(time_s) @ self.node_from_bind
            self._latest.clear()
            self._latest[time_s] = matrices
        return matrices

    def scales_at(self, time_s: float) -> Floats:
        """Largest scale factors (joints,) of the transforms."""
        scales = self._latest_scales.get(time_s)
        if scales is None:
            scales = np.linalg.norm(self.matrices_at(time_s)[:, :3, :3], 2, axis=(1, 2))
            self._latest_scales.clear()
            self._latest_scales[time_s] = scales
        return scales

    @cached_property
    def _poses(self) -> NodePoses:
        return NodePoses(self.nodes)

    # of the last time, shared by all meshes of the skin in the same frame
    @cached_property
    def _latest(self) -> dict[float, Floats]:
        return {}

    @cached_property
    def _latest_scales(self) -> dict[float, Floats]:
        return {}


@dataclass(frozen=True, eq=False)
class MorphTargets:
    """Morph targets of a mesh."""

    positions: Floats32  # (targets, n, 3) position offsets
    normals: Floats32 | None  # (targets, n, 3) normal offsets; None: no offsets
    weights: Keyframes  # (targets,) weights over time
    period_s: float  # period after which the weights repeat

    def weights_at(self, time_s: float) -> Floats:
        """Weights (targets,) at a world time."""
        return self.weights.at(time_s % self.period_s if self.period_s else 0.0)

    @cached_property
    def longest(self) -> Floats:
        """Lengths (targets,) of the longest offset per target."""
        lengths: Floats = np.linalg.norm(self.positions.astype(np.float64), axis=2)
        return lengths.max(axis=1, initial=0.0)


class Sphere(NamedTuple):
    """Bounding sphere of a mesh, in the mesh's frame."""

    center: Floats
    radius: float


@dataclass(frozen=True, eq=False)
class Deformation:
    """Positions and normals of a deforming mesh over world time, in the mesh's frame.

    Each vertex is morphed in the bind pose, then transformed by the weighted mean of its joints'
    transforms. A mesh without a skin has one static joint.

    Source: glTF 2.0, sections 3.7.2.2 and 3.7.3.3; normals use the cofactor matrix.
    """

    positions: Floats32  # (n, 3) in the bind pose
    normals: Floats32 | None  # (n, 3) in the bind pose; None: flat shading
    joints: NDArray[np.uint32]  # (n, k) joint indices
    shares: Floats32  # (n, k) weights, which sum to 1 per vertex
    mesh_from_world: Floats  # (4, 4) transform applied after those of the skeleton
    skeleton: Skeleton  # skeleton with the joints
    targets: MorphTargets | None = None  # morph targets; None: no morphing

    @property
    def arrays(self) -> list[NDArray[np.generic]]:
        """All per-vertex arrays."""
        arrays: list[NDArray[np.generic] | None] = [
            self.positions, self.normals, self.joints, self.shares
        ]  # fmt: skip
        if self.targets is not None:
            arrays += [self.targets.positions, self.targets.normals]
        return [array for array in arrays if array is not None]

    def matrices_at(self, time_s: float) -> Floats:
        """Transforms (joints, 4, 4) from the bind pose to the mesh's frame."""
        return self.mesh_from_world @ self.skeleton.matrices_at(time_s)

    def weights_at(self, time_s: float) -> Floats:
        """Weights (targets,) of the morph targets at a world time."""
        return np.zeros(0) if self.targets is None else self.targets.weights_at(time_s)

    def positions_at(self, time_s: float, vertices: Indices | None = None) -> Floats:
        """Positions (n, 3) of all vertices, or of a subset, at a world time."""
        subset = slice(None) if vertices is None else vertices
        positions = self.positions[subset].astype(np.float64)
        if self.targets is not None:
            offsets = self.targets.positions[:, subset]
            positions += np.einsum("t,tnc->nc", self.weights_at(time_s), offsets)
        blended = self._blended(time_s, subset)
        return np.einsum("nab,nb->na", blended[:, :, :3], positions) + blended[:, :, 3]

    def normals_at(self, time_s: float) -> Floats | None:
        """Unit normals (n, 3) of all vertices at a world time; None: flat shading."""
        if self.normals is None:
            return None
        normals = self.normals.astype(np.float64)
        if self.targets is not None and self.targets.normals is not None:
            normals += np.einsum("t,tnc->nc", self.weights_at(time_s), self.targets.normals)
        x, y, z = np.moveaxis(self._blended(time_s, slice(None))[:, :, :3], 1, 0)
        cofactors = np.stack((np.cross(y, z), np.cross(z, x), np.cross(x, y)), axis=1)
        sign = np.where(np.einsum("nc,nc->n", x, cofactors[:, 0]) < 0.0, -1.0, 1.0)
        turned = np.einsum("nab,nb->na", cofactors, normals)
        lengths = sign * np.linalg.norm(turned, axis=1)
        return turned / np.where(lengths == 0.0, 1.0, lengths)[:, None]

    def sphere_at(self, time_s: float) -> Sphere:
        """Bounding sphere of all vertices at a world time, from one sphere per joint."""
        centers, radii = self._joint_spheres
        matrices = self.matrices_at(time_s)
        at = np.einsum("jab,jb->ja", matrices[:, :3, :3], centers) + matrices[:, :3, 3]
        longest = 0.0
        if self.targets is not None:
            longest = float(np.abs(self.weights_at(time_s)) @ self.targets.longest)
        reach = self._scale * self.skeleton.scales_at(time_s) * (np.maximum(radii, 0.0) + longest)
        used = np.flatnonzero(radii >= 0.0)
        at, reach = at[used], reach[used]
        low, high = (at - reach[:, None]).min(axis=0), (at + reach[:, None]).max(axis=0)
        center = 0.5 * (low + high)
        return Sphere(center, float((np.linalg.norm(at - center, axis=1) + reach).max()))

    def joint_boxes(self) -> tuple[Indices, Floats]:
        """Joints (k,) with vertices, and the box corners (k, 8, 3) of these in the bind pose."""
        low, high = self._joint_bounds
        used = np.flatnonzero((low <= high).all(axis=1))
        bounds = np.stack((low[used], high[used]), axis=1)
        corners = bounds[:, np.indices((2, 2, 2)).reshape(3, 8).T, [0, 1, 2]]
        return used, corners

    @cached_property
    def _scale(self) -> float:
        return float(np.linalg.norm(self.mesh_from_world[:3, :3], 2))

    @cached_property
    def _joint_bounds(self) -> tuple[Floats, Floats]:
        """Smallest and largest coordinates (joints, 3) of each joint's vertices."""
        count = len(self.skeleton.node_from_bind)
        low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
        rows, columns = np.nonzero(self.shares)
        joints, positions = self.joints[rows, columns], self.positions[rows].astype(np.float64)
        np.minimum.at(low, joints, positions)
        np.maximum.at(high, joints, positions)
        return low, high

    @cached_property
    def _joint_spheres(self) -> tuple[Floats, Floats]:
        """Centers (joints, 3) and radii (joints,) of each joint's vertices; −1: no vertices."""
        low, high = self._joint_bounds
        centers = np.zeros(low.shape)
        used = np.flatnonzero((low <= high).all(axis=1))
        centers[used] = 0.5 * (low[used] + high[used])
        radii = np.full(len(low), -1.0)
        rows, columns = np.nonzero(self.shares)
        joints = self.joints[rows, columns]
        np.maximum.at(radii, joints, np.linalg.norm(self.positions[rows] - centers[joints], axis=1))
        return centers, radii

    def _blended(self, time_s: float, subset: slice | Indices) -> Floats:
        """Weighted mean of the joints' transforms (n, 3, 4) per vertex."""
        matrices = self.matrices_at(time_s)[:, :3]
        return np.einsum(
            "nj,njab->nab", self.shares[subset].astype(np.float64), matrices[self.joints[subset]]
        )
