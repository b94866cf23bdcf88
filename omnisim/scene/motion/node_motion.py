"""Periodic motion of the nodes of an animated file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property

import numpy as np

from omnisim.core.arrays import Floats, Indices
from omnisim.core.poses import nearest_rotation, pose_from_rotation, rotation_from_quaternion
from omnisim.core.world import Pose

NO_TURN = 1e-7  # largest length of a quaternion that counts as no rotation
SHEAR_TOLERANCE = 1e-4  # far above the rounding errors of float32 values in a file


@dataclass(frozen=True, eq=False)
class AnimatedNode:
    """Animated node, with a moving or a static parent."""

    parent: AnimatedNode | None  # nearest moving ancestor; None: no moving ancestor
    # (4, 4) constant part of the transform to the parent's frame, or to the world's without a
    # parent
    parent_from_node: Floats
    # translation, rotation, scale: keyframes, or constants (3,), (4,) and (3,)
    translation: Keyframes | Floats
    rotation: Keyframes | Floats
    scale: Keyframes | Floats
    period_s: float  # period of the animation; 0: static

    def transform_at(self, time_s: float) -> Floats:
        """Transform (4, 4) from the node to the world at a world time."""
        transform = self._latest.get(time_s)
        if transform is None:
            before = self.parent_from_node
            if self.parent is not None:
                before = self.parent.transform_at(time_s) @ before
            own_s = time_s % self.period_s if self.period_s else 0.0
            parts = (
                value.at(own_s) if isinstance(value, Keyframes) else value
                for value in (self.translation, self.rotation, self.scale)
            )
            transform = before @ local_transform(*parts)
            # shared by all nodes of one parent in the same frame
            self._latest.clear()
            self._latest[time_s] = transform
        return transform

    @cached_property
    def _latest(self) -> dict[float, Floats]:
        return {}


@dataclass(frozen=True, eq=False)
class NodeMotion:
    """Motion of an animated node's frame, without scale and shear."""

    node: AnimatedNode  # animated node
    axes: Floats  # (3, 3) axes of the frame at 0 s, in the world

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
    def _start(self) -> Floats:
        return self.node.transform_at(0.0)[:3, :3]

    def _rotation(self, linear: Floats) -> Floats:
        """Best-fit rotation (3, 3) since 0 s.

        Source: Kabsch, "A solution for the best rotation to relate two sets of vectors", 1976.
        """
        u, _, vt = np.linalg.svd(linear @ self._start.T)
        u[:, 2] *= np.sign(np.linalg.det(u @ vt))
        # a second projection removes the rounding errors of large scale factors
        return nearest_rotation(u @ vt)


def local_transform(translation: Floats, quaternion: Floats, scale: Floats) -> Floats:
    """Transform (4, 4): translation (3,) · rotation · scale (3,); a zero quaternion is identity."""
    result = np.eye(4)
    if np.linalg.norm(quaternion) > NO_TURN:
        result[:3, :3] = rotation_from_quaternion(quaternion)
    result[:3, :3] *= scale
    result[:3, 3] = translation
    return result


# Batched transforms of animated nodes: a few array operations per hierarchy level.


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
            for link in reversed(chain):
                every[link] = len(every)
                depths.append(0 if link.parent is None else 1 + depths[every[link.parent]])
        self._period_s = max((node.period_s for node in every), default=0.0)
        self._before = np.array([node.parent_from_node for node in every]).reshape(-1, 4, 4)
        self._translations = _Tracks([node.translation for node in every], 3)
        self._rotations = _Tracks([node.rotation for node in every], 4)
        self._scales = _Tracks([node.scale for node in every], 3)
        parents = np.array([0 if node.parent is None else every[node.parent] for node in every])
        depth_of = np.array(depths)
        levels = [
            np.flatnonzero(depth_of == number) for number in range(1, 1 + max(depths, default=0))
        ]
        self._levels = [(level, parents[level]) for level in levels]
        # the last transform is the identity of the world
        self._index = np.array([len(every) if node is None else every[node] for node in nodes])

    def at(self, time_s: float) -> Floats:
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
        return local[self._index]


class _Tracks:
    """Values of one property for many nodes; nodes with equal times share one lookup."""

    def __init__(self, values: Sequence[Keyframes | Floats], width: int):
        self._rest = np.zeros((len(values), width))
        groups: dict[tuple[bytes, str], list[int]] = {}
        for index, value in enumerate(values):
            if isinstance(value, Keyframes):
                key = value.times_s.tobytes(), value.interpolation.value
                groups.setdefault(key, []).append(index)
            else:
                self._rest[index] = value
        self._groups: list[tuple[Indices, Keyframes]] = []
        for indices in groups.values():
            tracks = [
                value for value in map(values.__getitem__, indices) if isinstance(value, Keyframes)
            ]
            before = [track.in_tangents for track in tracks if track.in_tangents is not None]
            after = [track.out_tangents for track in tracks if track.out_tangents is not None]
            joined = replace(
                tracks[0],
                values=np.stack([track.values for track in tracks], axis=1),
                in_tangents=np.stack(before, axis=1) if before else None,
                out_tangents=np.stack(after, axis=1) if after else None,
            )
            self._groups.append((np.array(indices), joined))

    def at(self, time_s: float) -> Floats:
        """Values (nodes, width) at a world time."""
        values = self._rest.copy()
        for indices, keyframes in self._groups:
            values[indices] = keyframes.at(time_s)
        return values


# Keyframe interpolation: stepwise, linear, or along cubic splines.

# Exporters write constant values with float32 noise.
_NOISE = 1e-6


class Interpolation(Enum):
    """Interpolation modes of glTF."""

    STEP = "STEP"
    LINEAR = "LINEAR"
    CUBIC_SPLINE = "CUBICSPLINE"


@dataclass(frozen=True, eq=False)
class Keyframes:
    """Values over time; the first and the last value hold outside the time range.

    Source: glTF 2.0, appendix C.
    """

    times_s: Floats  # (n,) non-decreasing times
    values: Floats  # (n, k), or (n, m, k) for m tracks; rotations are quaternions (x, y, z, w)
    interpolation: Interpolation = Interpolation.LINEAR  # interpolation mode between two times
    # in_tangents, out_tangents: tangents of cubic splines, shaped like `values`, per second
    in_tangents: Floats | None = None
    out_tangents: Floats | None = None
    # True for quaternions, which are interpolated along the shorter arc
    are_rotations: bool = False

    @property
    def is_constant(self) -> bool:
        """True if the values are constant up to float32 noise."""
        noise = _NOISE * float(np.abs(self.values).max())
        tangents = [
            tangent for tangent in (self.in_tangents, self.out_tangents) if tangent is not None
        ]
        duration_s = float(self.times_s[-1] - self.times_s[0])
        return bool(np.ptp(self.values, axis=0).max() <= noise) and all(
            float(np.abs(tangent).max()) * duration_s <= noise for tangent in tangents
        )

    def at(self, time_s: float) -> Floats:
        """Value (k,) or values (m, k) at a time; quaternions may be unnormalized."""
        times_s = self.times_s
        last = int(np.searchsorted(times_s, time_s, side="right")) - 1
        if last < 0 or last + 1 == len(times_s) or self.interpolation is Interpolation.STEP:
            return self.values[max(last, 0)]
        step_s = float(times_s[last + 1] - times_s[last])
        share = (time_s - float(times_s[last])) / step_s
        if self.interpolation is Interpolation.CUBIC_SPLINE:
            assert self.in_tangents is not None
            assert self.out_tangents is not None
            share2, share3 = share * share, share * share * share
            return (
                (2.0 * share3 - 3.0 * share2 + 1.0) * self.values[last]
                + step_s * (share3 - 2.0 * share2 + share) * self.out_tangents[last]
                + (3.0 * share2 - 2.0 * share3) * self.values[last + 1]
                + step_s * (share3 - share2) * self.in_tangents[last + 1]
            )
        first, second = self.values[last], self.values[last + 1]
        if self.are_rotations:
            between = _slerp if first.ndim == 1 else _slerps
            return between(first, second, share)
        return first + share * (second - first)


def _slerp(first: Floats, second: Floats, share: float) -> Floats:
    """Unit quaternion (4,) interpolated by a share of the shorter arc between two."""
    first, second = first / np.linalg.norm(first), second / np.linalg.norm(second)
    cosine = float(first @ second)
    if cosine < 0.0:  # a quaternion and its negative are the same rotation
        second, cosine = -second, -cosine
    lengths = float(np.linalg.norm(second - first)), float(np.linalg.norm(second + first))
    angle = 2.0 * math.atan2(*lengths)
    if angle == 0.0:
        return first
    turned: Floats = math.sin((1.0 - share) * angle) * first + math.sin(share * angle) * second
    return turned / math.sin(angle)


def _slerps(first: Floats, second: Floats, share: float) -> Floats:
    """Unit quaternions (m, 4) interpolated by a share of the shorter arc between each pair."""
    first, second = (
        quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
        for quaternions in (first, second)
    )
    second = np.where(np.einsum("mk,mk->m", first, second)[:, None] < 0.0, -second, second)
    lengths = np.linalg.norm(second - first, axis=1), np.linalg.norm(second + first, axis=1)
    angles = 2.0 * np.arctan2(*lengths)[:, None]
    sines = np.where(angles == 0.0, 1.0, np.sin(angles))
    turned: Floats = (
        np.sin((1.0 - share) * angles) * first + np.sin(share * angles) * second
    ) / sines
    return np.where(angles == 0.0, first, turned)
