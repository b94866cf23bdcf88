"""Batched transforms of animated nodes: a few array operations per hierarchy level."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from omnisim.core.poses import rotation_from_quaternion
from omnisim.scene.motion.keyframes import Keyframes
from omnisim.scene.motion.node_motion import NO_TURN, AnimatedNode

Matrix = NDArray[np.float64]


class NodePoses:
    """Poses of nodes of one animation, computed together with all their ancestors.

    Args:
        nodes: nodes to evaluate; None: a static node at the world's origin.
    """

    def __init__(self, nodes: Sequence[AnimatedNode | None]):
        every: dict[AnimatedNode, int] = {}  # parents come first
        depths: list[int] = []
        for node in nodes:
            chain = []
            while node is not None and node not in every:
                chain.append(node)
                node = node.parent
            for one in reversed(chain):
                every[one] = len(every)
                depths.append(0 if one.parent is None else 1 + depths[every[one.parent]])
        self._period_s = max((one.period_s for one in every), default=0.0)
        self._before = np.array([one.parent_from_node for one in every]).reshape(-1, 4, 4)
        self._translations = _Tracks([one.translation for one in every], 3)
        self._rotations = _Tracks([one.rotation for one in every], 4)
        self._scales = _Tracks([one.scale for one in every], 3)
        parents = np.array([0 if one.parent is None else every[one.parent] for one in every])
        depth_of = np.array(depths)
        levels = [np.flatnonzero(depth_of == one) for one in range(1, 1 + max(depths, default=0))]
        self._levels = [(level, parents[level]) for level in levels]
        # the last transform is the identity of the world
        self._index = np.array([len(every) if one is None else every[one] for one in nodes])

    def at(self, time_s: float) -> Matrix:
        """Transforms (n, 4, 4) from the nodes to the world at a world time."""
        time_s = time_s % self._period_s if self._period_s else 0.0
        quaternions = self._rotations.at(time_s)
        turns = np.linalg.norm(quaternions, axis=1) > NO_TURN
        local = np.tile(np.eye(4), (1 + len(self._before), 1, 1))
        if turns.any():
            local[:-1][turns, :3, :3] = rotation_from_quaternion(quaternions[turns])
        local[:-1, :3, :3] *= self._scales.at(time_s)[:, None]
        local[:-1, :3, 3] = self._translations.at(time_s)
        local[:-1] = self._before @ local[:-1]
        for level, parents in self._levels:
            local[level] = local[parents] @ local[level]
        transforms: Matrix = local[self._index]
        return transforms


class _Tracks:
    """Values of one property for many nodes; nodes with equal times share one lookup."""

    def __init__(self, values: Sequence[Keyframes | Matrix], width: int):
        self._rest = np.zeros((len(values), width))
        groups: dict[tuple[bytes, str], list[int]] = {}
        for index, value in enumerate(values):
            if isinstance(value, Keyframes):
                key = value.times_s.tobytes(), value.interpolation.value
                groups.setdefault(key, []).append(index)
            else:
                self._rest[index] = value
        self._groups = [
            (np.array(indices), _stacked([values[index] for index in indices]))
            for indices in groups.values()
        ]

    def at(self, time_s: float) -> Matrix:
        """Values (nodes, width) at a world time."""
        values = self._rest.copy()
        for indices, keyframes in self._groups:
            values[indices] = keyframes.at(time_s)
        return values


def _stacked(tracks: Sequence[Keyframes | Matrix]) -> Keyframes:
    """Keyframes of several tracks merged into one, with values (times, tracks, width)."""
    every = [one for one in tracks if isinstance(one, Keyframes)]
    before = [one.in_tangents for one in every if one.in_tangents is not None]
    after = [one.out_tangents for one in every if one.out_tangents is not None]
    return replace(
        every[0],
        values=np.stack([one.values for one in every], axis=1),
        in_tangents=np.stack(before, axis=1) if before else None,
        out_tangents=np.stack(after, axis=1) if after else None,
    )
