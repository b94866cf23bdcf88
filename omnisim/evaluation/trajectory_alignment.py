"""Alignment of an estimated trajectory with the true one.

Source: Umeyama, "Least-squares estimation of transformation parameters between two point patterns",
PAMI 1991.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
AlignmentKind = Literal["none", "se3", "sim3"]
ALIGNMENTS: tuple[AlignmentKind, ...] = ("none", "se3", "sim3")
_RANK_TOLERANCE = 1e-12  # as a share of the largest singular value


@dataclass(frozen=True, eq=False)
class Alignment:
    """Similarity transform from an estimate's world to the true world.

    Attributes:
        rotation: (3, 3) rotation matrix.
        translation_m: (3,) translation in the true world.
        scale: factor of the estimate's lengths, applied first.
    """

    rotation: Floats
    translation_m: Floats
    scale: float = 1.0

    def apply(self, poses: Floats) -> Floats:
        """Aligned poses (n, 4, 4); rotations stay rotations."""
        aligned = np.array(poses, dtype=np.float64)
        aligned[:, :3, :3] = self.rotation @ poses[:, :3, :3]
        aligned[:, :3, 3] = self.scale * poses[:, :3, 3] @ self.rotation.T + self.translation_m
        return aligned


def align(estimate: Floats, truth: Floats, kind: AlignmentKind) -> Alignment:
    """Least-squares alignment of positions.

    If the positions lie on a line or in a point, many rotations are equally good; the rotation then
    aligns the first poses.

    Args:
        estimate, truth: (n, 4, 4) poses at the same times.
        kind: "none", "se3" (rotation and translation) or "sim3" (scale, too).
    """
    if kind == "none":
        return Alignment(np.eye(3), np.zeros(3))
    estimated, true = estimate[:, :3, 3], truth[:, :3, 3]
    centers = estimated.mean(axis=0), true.mean(axis=0)
    spread = float(np.square(estimated - centers[0]).sum() / len(estimated))
    covariance = (true - centers[1]).T @ (estimated - centers[0]) / len(estimated)
    left, sizes, right = np.linalg.svd(covariance)
    if sizes[1] <= _RANK_TOLERANCE * max(float(sizes[0]), 1.0):
        rotation = truth[0, :3, :3] @ estimate[0, :3, :3].T
        return Alignment(rotation, true[0] - rotation @ estimated[0])
    signs = np.ones(3)
    signs[2] = np.sign(np.linalg.det(left) * np.linalg.det(right))
    rotation = left @ np.diag(signs) @ right
    scale = float(sizes @ signs / spread) if kind == "sim3" else 1.0
    return Alignment(rotation, centers[1] - scale * rotation @ centers[0], scale)
