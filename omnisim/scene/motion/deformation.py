"""Deformation of meshes by time: morph targets, then linear blend skinning."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.motion.keyframes import Keyframes
from omnisim.scene.motion.node_motion import AnimatedNode
from omnisim.scene.motion.node_poses import NodePoses

Matrix = NDArray[np.float64]
Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Joints of a skin; the meshes of one skin share it.

    Attributes:
        nodes: of the joints; None: it rests.
        node_from_bind: (joints, 4, 4) from the mesh as it was bound; of a joint that rests, to the
            world.
    """

    nodes: Sequence[AnimatedNode | None]
    node_from_bind: Matrix

    @property
    def moves(self) -> bool:
        """True where some joint does."""
        return any(node is not None for node in self.nodes)

    def matrices_at(self, time_s: float) -> Matrix:
        """Transforms (joints, 4, 4) from the bound mesh to the world."""
        found = self._latest.get(time_s)
        if found is None:
            found = self._poses.at(time_s) @ self.node_from_bind
            # meshes of one skin share them at the instant of an image
            self._latest.clear()
            self._latest[time_s] = found
        return found

    def scales_at(self, time_s: float) -> Matrix:
        """Largest scales (joints,) of the transforms."""
        found = self._latest_scales.get(time_s)
        if found is None:
            found = np.linalg.norm(self.matrices_at(time_s)[:, :3, :3], 2, axis=(1, 2))
            self._latest_scales.clear()
            self._latest_scales[time_s] = found
        return found

    @cached_property
    def _latest_scales(self) -> dict[float, Matrix]:
        return {}

    @cached_property
    def _poses(self) -> NodePoses:
        return NodePoses(self.nodes)

    @cached_property
    def _latest(self) -> dict[float, Matrix]:
        return {}


@dataclass(frozen=True, eq=False)
class MorphTargets:
    """Morph targets of a mesh.

    Attributes:
        positions: (targets, n, 3) offsets.
        normals: (targets, n, 3) offsets, or None.
        weights: (targets,) by time.
        period_s: after which all begins again.
    """

    positions: Floats
    normals: Floats | None
    weights: Keyframes
    period_s: float

    def weights_at(self, time_s: float) -> Matrix:
        """Weights (targets,) at a time of the world."""
        return self.weights.at(time_s % self.period_s if self.period_s else 0.0)

    @cached_property
    def longest(self) -> Matrix:
        """Length (targets,) of the longest offset of each."""
        lengths: Matrix = np.linalg.norm(self.positions.astype(np.float64), axis=2)
        longest: Matrix = lengths.max(axis=1, initial=0.0)
        return longest


class Sphere(NamedTuple):
    """Sphere around a mesh, in its frame."""

    center: Matrix
    radius: float


@dataclass(frozen=True, eq=False)
class Deformation:
    """Positions and normals of a mesh by the world's time, in the frame of the mesh.

    A vertex is where its morphed position, as it was bound, is taken by the mean of its joints'
    transforms, by weights. Without a skin there is one joint, which rests.

    Attributes:
        positions: (n, 3) as bound.
        normals: (n, 3) likewise, or None: flat triangles.
        joints: (n, k).
        shares: (n, k) weights, of the sum 1.
        mesh_from_world: (4, 4) of what the skeleton's transforms lead to.
        skeleton: of the joints.
        targets: of morphing, or None.

    Source: glTF 2.0, section 3.7.2.2 and 3.7.3.3; of normals, the matrix of cofactors.
    """

    positions: Floats
    normals: Floats | None
    joints: NDArray[np.uint32]
    shares: Floats
    mesh_from_world: Matrix
    skeleton: Skeleton
    targets: MorphTargets | None = None

    @property
    def arrays(self) -> list[NDArray[np.generic]]:
        """Arrays of all vertices."""
        found: list[NDArray[np.generic] | None] = [
            self.positions, self.normals, self.joints, self.shares
        ]  # fmt: skip
        if self.targets is not None:
            found += [self.targets.positions, self.targets.normals]
        return [one for one in found if one is not None]

    def matrices_at(self, time_s: float) -> Matrix:
        """Transforms (joints, 4, 4) from the bound mesh to the mesh's frame."""
        matrices: Matrix = self.mesh_from_world @ self.skeleton.matrices_at(time_s)
        return matrices

    def weights_at(self, time_s: float) -> Matrix:
        """Weights (targets,) of the morph targets."""
        return np.zeros(0) if self.targets is None else self.targets.weights_at(time_s)

    def positions_at(self, time_s: float, vertices: NDArray[np.intp] | None = None) -> Matrix:
        """Positions (n, 3) of all vertices, or of some."""
        some = slice(None) if vertices is None else vertices
        positions = self.positions[some].astype(np.float64)
        if self.targets is not None:
            offsets = self.targets.positions[:, some]
            positions += np.einsum("t,tnc->nc", self.weights_at(time_s), offsets)
        blended = self._blended(time_s, some)
        moved: Matrix = np.einsum("nab,nb->na", blended[:, :, :3], positions) + blended[:, :, 3]
        return moved

    def normals_at(self, time_s: float) -> Matrix | None:
        """Unit normals (n, 3) of all vertices; None: flat triangles."""
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
        unit: Matrix = turned / np.where(lengths == 0.0, 1.0, lengths)[:, None]
        return unit

    def sphere_at(self, time_s: float) -> Sphere:
        """Sphere around all vertices at a time: around those of the joints' own vertices."""
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

    def joint_boxes(self) -> tuple[NDArray[np.intp], Matrix]:
        """Joints (k,) that vertices follow, and corners (k, 8, 3) of those vertices as bound."""
        low, high = self._joint_bounds
        used = np.flatnonzero((low <= high).all(axis=1))
        bounds = np.stack((low[used], high[used]), axis=1)
        corners = bounds[:, np.indices((2, 2, 2)).reshape(3, 8).T, [0, 1, 2]]
        return used, corners

    @cached_property
    def _scale(self) -> float:
        """Largest scale from what the skeleton leads to."""
        return float(np.linalg.norm(self.mesh_from_world[:3, :3], 2))

    @cached_property
    def _joint_bounds(self) -> tuple[Matrix, Matrix]:
        """Smallest and largest coordinates (joints, 3) of the vertices of each joint."""
        count = len(self.skeleton.node_from_bind)
        low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
        rows, columns = np.nonzero(self.shares)
        joints, positions = self.joints[rows, columns], self.positions[rows].astype(np.float64)
        np.minimum.at(low, joints, positions)
        np.maximum.at(high, joints, positions)
        return low, high

    @cached_property
    def _joint_spheres(self) -> tuple[Matrix, Matrix]:
        """Centers (joints, 3) and radii (joints,) of each joint's vertices; −1: it has none."""
        low, high = self._joint_bounds
        centers = np.zeros(low.shape)
        used = np.flatnonzero((low <= high).all(axis=1))
        centers[used] = 0.5 * (low[used] + high[used])
        radii = np.full(len(low), -1.0)
        rows, columns = np.nonzero(self.shares)
        joints = self.joints[rows, columns]
        np.maximum.at(radii, joints, np.linalg.norm(self.positions[rows] - centers[joints], axis=1))
        return centers, radii

    def _blended(self, time_s: float, some: slice | NDArray[np.intp]) -> Matrix:
        """Mean transforms (n, 3, 4) of vertices' joints."""
        matrices = self.matrices_at(time_s)[:, :3]
        blended: Matrix = np.einsum(
            "nj,njab->nab", self.shares[some].astype(np.float64), matrices[self.joints[some]]
        )
        return blended
