"""Motion of a lidar and of dynamic objects during a revolution."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import scipy  # its submodules load when first used
from numpy.typing import NDArray

from omnisim.core.errors import OmnisimError
from omnisim.ground_truth.lidar_beams import LidarPoses, Revolution, Slice
from omnisim.rendering.truth.moving_boxes import MovingBoxes

SLICES = (8, 16, 32, 64)  # candidate numbers of slices of a revolution with motion
# Maximum motion of the lidar and of objects within a slice. A firing's hit then lies within one
# texel of the view from the slice's middle, except on grazed surfaces.
MAX_PATH_M, MAX_TURN_RAD = 0.01, 0.06
# Points move straight within a slice. This bounds their distance from the true path in its middle.
MAX_SKEW_M = 1e-4

PosesAt = Callable[[float], LidarPoses]


def plan_revolution(
    firings: int,
    period_s: float,
    poses_at: PosesAt,
    start_s: float,
    boxes: MovingBoxes,
) -> Revolution:
    """Cut a revolution into slices that are short enough; a static one is a single slice.

    Args:
        firings: number of firings in the revolution.
        period_s: duration of the revolution.
        poses_at: function that returns the poses at a time in seconds.
        start_s: time of the first firing.
        boxes: bounding boxes of all moving objects.

    Raises:
        OmnisimError: the lidar turns too fast.
    """
    ends = [poses_at(start_s + share * period_s) for share in (0.0, 0.3, 0.7, 1.0)]
    if all(_is_same(ends[0], part, boxes) for part in ends[1:]):
        whole = Slice(0, firings, ends[0], ends[0], ends[0])
        return _revolution(firings, (whole,))
    for count in SLICES:
        slices = _cut(firings, period_s, poses_at, start_s, count)
        if all(_is_short(part, boxes) for part in slices):
            break
    turn_rad = max(_turn_rad(part) for part in slices)
    if turn_rad > MAX_TURN_RAD:
        raise OmnisimError(
            f"lidar: expected to be turned by at most {MAX_TURN_RAD:g} rad in 1/{count} of a "
            f"revolution, got {turn_rad:g}"
        )
    return _revolution(firings, slices)


def _cut(
    firings: int, period_s: float, poses_at: PosesAt, start_s: float, count: int
) -> tuple[Slice, ...]:
    """Cut a revolution into about `count` slices."""
    width = -(-firings // count)
    bounds = [*range(0, firings, width), firings]
    step_s = 0.5 * period_s / firings  # half a firing period
    halves = [a + b for a, b in itertools.pairwise(bounds)]
    times = sorted([2 * bound for bound in bounds] + halves)
    poses = [poses_at(start_s + step_s * time) for time in times]
    return tuple(
        Slice(bounds[i], bounds[i + 1], *poses[2 * i : 2 * i + 3]) for i in range(len(bounds) - 1)
    )


def _revolution(count: int, slices: tuple[Slice, ...]) -> Revolution:
    firings = np.arange(count)
    width = slices[0].last
    index = firings // width
    first = np.array([part.first for part in slices])[index]
    shares = (firings - first) / np.array([part.last - part.first for part in slices])[index]
    if len(slices) == 1 and slices[0].start is slices[0].end:
        rotation = slices[0].start.world_from_lidar[:3, :3]
        return Revolution(slices, shares, np.broadcast_to(rotation, (count, 3, 3)))
    poses = [pose for part in slices for pose in (part.start, part.middle)] + [slices[-1].end]
    knots = np.stack([pose.world_from_lidar[:3, :3] for pose in poses])
    half = 2 * index + (shares >= 0.5)
    return Revolution(slices, shares, _rotations(knots, half, 2.0 * shares % 1.0))


def _rotations(
    knots: NDArray[np.float64], index: NDArray[np.intp], share: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Slerp between knots (k, 3, 3): rotations (n, 3, 3) at fractions `share` (n,) past `index`."""
    rotation = scipy.spatial.transform.Rotation
    changes = np.swapaxes(knots[:-1], 1, 2) @ knots[1:]
    vectors = rotation.from_matrix(changes).as_rotvec()
    turned = rotation.from_rotvec(share[:, None] * vectors[index]).as_matrix()
    return knots[index] @ turned


def _is_same(part: LidarPoses, other: LidarPoses, boxes: MovingBoxes) -> bool:
    pairs = zip(
        (part.world_from_lidar, *boxes.poses(part.world_from_objects)),
        (other.world_from_lidar, *boxes.poses(other.world_from_objects)),
        strict=True,
    )
    return all(np.array_equal(a, b) for a, b in pairs)


def _is_short(part: Slice, boxes: MovingBoxes) -> bool:
    """True if the motion within a slice is within the limits."""
    moving = [(np.zeros((1, 3)), *(pose.world_from_lidar for pose in _poses(part)))]
    moved = (boxes.poses(pose.world_from_objects) for pose in _poses(part))
    moving += zip(boxes.corners_m, *moved, strict=True)
    if _turn_rad(part) > MAX_TURN_RAD:
        return False
    for corners_m, *poses in moving:
        start, middle, end = (corners_m @ pose[:3, :3].T + pose[:3, 3] for pose in poses)
        if np.linalg.norm(end - start, axis=1).max(initial=0.0) > MAX_PATH_M:
            return False
        error_m = middle - 0.5 * (start + end)
        if np.linalg.norm(error_m, axis=1).max(initial=0.0) > MAX_SKEW_M:
            return False
    return True


def _poses(part: Slice) -> tuple[LidarPoses, LidarPoses, LidarPoses]:
    return part.start, part.middle, part.end


def _turn_rad(part: Slice) -> float:
    """Angle by which the lidar turns during a slice."""
    start, end = part.start.world_from_lidar[:3, :3], part.end.world_from_lidar[:3, :3]
    # the chord between two rotations is accurate for small angles as well
    chord = float(np.linalg.norm(end - start)) / np.sqrt(8.0)
    return float(2.0 * np.arcsin(min(chord, 1.0)))
