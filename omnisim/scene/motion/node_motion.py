"""Periodic motion of the nodes of an animated file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from omnisim.core.poses import nearest_rotation, pose_from_rotation, rotation_from_quaternion
from omnisim.core.world import Pose
from omnisim.scene.motion.keyframes import Keyframes

Matrix = NDArray[np.float64]
NO_TURN = 1e-7  # largest length of a quaternion that counts as no rotation
SHEAR_TOLERANCE = 1e-4  # far above the rounding errors of float32 values in a file


@dataclass(frozen=True, eq=False)
class AnimatedNode:
    """Animated node, with a moving or a static parent.

    Attributes:
        parent: nearest moving ancestor; None: no moving ancestor.
        parent_from_node: (4, 4) constant part of the transform to the parent's frame, or to the
            world's without a parent.
        translation, rotation, scale: keyframes, or constants (3,), (4,) and (3,).
        period_s: period of the animation; 0: static.
    """

    parent: AnimatedNode | None
    parent_from_node: Matrix
    translation: Keyframes | Matrix
    rotation: Keyframes | Matrix
    scale: Keyframes | Matrix
    period_s: float

    def transform_at(self, time_s: float) -> Matrix:
        """Transform (4, 4) from the node to the world at a world time."""
        transform = self._latest.get(time_s)
        if transform is None:
            before = self.parent_from_node
            if self.parent is not None:
                before = self.parent.transform_at(time_s) @ before
            transform = before @ self._local_at(time_s % self.period_s if self.period_s else 0.0)
            # shared by all nodes of one parent in the same frame
            self._latest.clear()
            self._latest[time_s] = transform
        return transform

    @cached_property
    def _latest(self) -> dict[float, Matrix]:
        return {}

    def _local_at(self, time_s: float) -> Matrix:
        translation, rotation, scale = (
            value.at(time_s) if isinstance(value, Keyframes) else value
            for value in (self.translation, self.rotation, self.scale)
        )
        return local_transform(translation, rotation, scale)


@dataclass(frozen=True, eq=False)
class NodeMotion:
    """Motion of an animated node's frame, without scale and shear.

    Attributes:
        node: animated node.
        axes: (3, 3) axes of the frame at 0 s, in the world.
    """

    node: AnimatedNode
    axes: Matrix

    def pose_at(self, time_s: float) -> Pose:
        """Pose (4, 4), with the rotation since 0 s that fits the node's axes best."""
        transform = self.node.transform_at(time_s)
        turned = self._rotation(transform[:3, :3])
        return pose_from_rotation(turned @ self.axes, transform[:3, 3])

    def is_rigid_at(self, time_s: float) -> bool:
        """True if the node has only translated and rotated since 0 s."""
        linear = self.node.transform_at(time_s)[:3, :3]
        error = np.abs(self._rotation(linear) @ self._start - linear).max()
        return bool(error <= SHEAR_TOLERANCE * np.abs(self._start).max())

    @cached_property
    def _start(self) -> Matrix:
        return self.node.transform_at(0.0)[:3, :3]

    def _rotation(self, linear: Matrix) -> Matrix:
        """Best-fit rotation (3, 3) since 0 s.

        Source: Kabsch, "A solution for the best rotation to relate two sets of vectors", 1976.
        """
        u, _, vt = np.linalg.svd(linear @ self._start.T)
        u[:, 2] *= np.sign(np.linalg.det(u @ vt))
        # a second projection removes the rounding errors of large scale factors
        return nearest_rotation(u @ vt)


def local_transform(translation: Matrix, quaternion: Matrix, scale: Matrix) -> Matrix:
    """Transform (4, 4): translation (3,) · rotation · scale (3,); a zero quaternion is identity."""
    result = np.eye(4)
    if np.linalg.norm(quaternion) > NO_TURN:
        result[:3, :3] = rotation_from_quaternion(quaternion)
    result[:3, :3] *= scale
    result[:3, 3] = translation
    return result
