"""Contacts of a vehicle's body with the scene along closely spaced poses of a trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # its submodules load when first used

from omnisim.core.arrays import Bools, Floats, Indices, triangle_bounds
from omnisim.core.errors import TrajectoryError
from omnisim.core.poses import pose_from_rotation
from omnisim.core.short_repr import counted, short_repr
from omnisim.core.trajectories import Trajectory
from omnisim.robots.kinematics import steps_between
from omnisim.robots.vehicle import BodyBoxes
from omnisim.scene import Scene
from omnisim.scene.space.floor import TriangleBvh, triangles_within

SPACING_M = 0.05  # spacing of the outermost corner between poses
MAX_PER_STEP = 200  # poses: a longer step is a jump, not a drive
NO_SIZE = "the robot has neither a [footprint] nor a body: collisions are not checked"
POSES_AT_ONCE = 64  # batch size, which bounds the memory


@dataclass(frozen=True, eq=False)
class Sweep:
    """Poses along a trajectory."""

    world_from_base: Floats  # (m, 4, 4) poses of the base
    steps: Indices  # (m,) index of the trajectory's pose at or before each pose
    is_step: Bools  # (m,) true for the trajectory's own poses, which stay unchanged
    times_s: Floats  # (m,) times of the poses

    def __repr__(self) -> str:
        return short_repr(self, counted(len(self.steps), "pose"))

    @property
    def trajectory(self) -> Trajectory:
        """Trajectory whose poses are the steps."""
        return Trajectory(self.times_s[self.is_step], self.world_from_base[self.is_step])

    @classmethod
    def along(cls, trajectory: Trajectory, reach_m: float) -> Sweep:
        """Interpolate poses, for a body that reaches `reach_m` from its base: turns by slerp."""
        poses, times = trajectory.world_from_base, trajectory.times_s
        if len(trajectory) == 1:
            return cls(poses, np.zeros(1, dtype=np.intp), np.ones(1, dtype=bool), times)
        moved = steps_between(poses)
        arcs_m = np.abs(moved.distances_m) + reach_m * np.abs(moved.turns_rad)
        counts = np.clip(np.ceil(arcs_m / SPACING_M), 1.0, MAX_PER_STEP).astype(np.intp)
        counts = np.append(counts, 1)  # the last pose
        steps = np.repeat(np.arange(len(poses)), counts)
        within = np.arange(len(steps)) - np.repeat(np.cumsum(counts) - counts, counts)
        shares = within / counts[steps]
        at = steps + shares
        positions = poses[:, :3, 3]
        between = np.column_stack([np.interp(at, range(len(poses)), axis) for axis in positions.T])
        rotations = scipy.spatial.transform.Rotation.from_matrix(poses[:, :3, :3])
        turned = scipy.spatial.transform.Slerp(np.arange(len(poses)), rotations)(at).as_matrix()
        filled = pose_from_rotation(turned, between)
        filled[within == 0] = poses
        stamps = np.interp(at, range(len(poses)), times)
        stamps[within == 0] = times
        return cls(filled, steps, within == 0, stamps)


@dataclass(frozen=True)
class Contact:
    """Contact of the body with an object."""

    object: str  # name of the object's node
    step: int  # step at or before the first contact
    time_s: float  # time of the first contact
    position_m: tuple[float, float]  # x, y of the base at the first contact
    steps: int  # number of steps with contact, at their pose or on the way to the next

    def __str__(self) -> str:
        x, y = self.position_m
        return (
            f"contact with {self.object} first at step {self.step}, {self.time_s:.2f} s, "
            f"({x:z.2f}, {y:z.2f}) m; {self.steps} step{'' if self.steps == 1 else 's'} in all"
        )


def find_contacts(scene: Scene, sweep: Sweep, boxes: BodyBoxes) -> tuple[Contact, ...]:
    """Contacts of a body's parts with the scene's triangles, in the order in which they begin.

    Each part is its bounding box, cut off at the clearance: the floor is no contact.
    """
    poses, parts = sweep.world_from_base, boxes.parts_m
    if not len(parts):  # the whole body is below the clearance
        return ()
    whole = np.array((parts[:, 0].min(axis=0), parts[:, 1].max(axis=0)))
    centers = poses[:, :3, :3] @ whole.mean(axis=0) + poses[:, :3, 3]
    extents = np.abs(poses[:, :3, :3]) @ (0.5 * (whole[1] - whole[0]))
    lows, highs = centers - extents, centers + extents
    triangles = triangles_within(scene, lows.min(axis=0), highs.max(axis=0))
    bvh = TriangleBvh(triangles.corners_m)
    touched = []  # (pose, instance)
    for begin in range(0, len(poses), POSES_AT_ONCE):
        end = begin + POSES_AT_ONCE
        at, hit = bvh.overlaps(lows[begin:end], highs[begin:end])
        at += begin
        # in the base frame
        corners = (triangles.corners_m[hit] - poses[at, None, :3, 3]) @ poses[at, :3, :3]
        touching = np.zeros(len(corners), dtype=bool)
        for low, high in parts:
            rest = np.flatnonzero(~touching)
            touching[rest] = meet_box(corners[rest] - 0.5 * (low + high), 0.5 * (high - low))
        touched.append(np.stack((at[touching], triangles.instances[hit[touching]]), axis=1))
    return _contacts(scene, sweep, np.unique(np.concatenate(touched), axis=0))


def check_no_contact(contacts: Sequence[Contact] | None, where: str) -> None:
    """Reject contacts, and robots of unknown size.

    Raises:
        TrajectoryError: there is a contact, or the robot's size is unknown; names the first
            contact.
    """
    if contacts is None:
        raise TrajectoryError(f"{where}: {NO_SIZE}: expected one of the two with --no-contact")
    if contacts:
        others = f", and with {len(contacts) - 1} more" if len(contacts) > 1 else ""
        raise TrajectoryError(f"{where}: {contacts[0]}{others}: expected none with --no-contact")


def _contacts(scene: Scene, sweep: Sweep, touched: Indices) -> tuple[Contact, ...]:
    """Contacts by object, from ordered pairs (n, 2) of a pose and an instance."""
    first: dict[str, int] = {}
    steps: dict[str, set[int]] = {}
    for pose, instance in touched.tolist():
        name = scene.instances[instance].name
        first.setdefault(name, pose)
        steps.setdefault(name, set()).add(int(sweep.steps[pose]))
    return tuple(
        Contact(
            name,
            int(sweep.steps[pose]),
            float(sweep.times_s[pose]),
            (float(sweep.world_from_base[pose, 0, 3]), float(sweep.world_from_base[pose, 1, 3])),
            len(steps[name]),
        )
        for name, pose in first.items()
    )


def meet_box(corners_m: Floats, half_m: Floats) -> Bools:
    """Mask (n,) of the triangles (n, 3, 3) that meet the box from −half (3,) to half.

    Tests separating axes: the box's axes, the triangle's normal, and the cross products of edges.

    Source: Akenine-Möller, "Fast 3D Triangle-Box Overlap Testing", Journal of Graphics Tools 6
    (2001).
    """
    low, high = triangle_bounds(corners_m)
    touching: Bools = np.all((low <= half_m) & (high >= -half_m), axis=1)
    near = np.flatnonzero(touching)
    if not len(near):
        return touching
    corners = corners_m[near]
    edges = np.roll(corners, -1, axis=1) - corners
    axes = [np.cross(edges[:, 0], edges[:, 1])]
    axes += [np.cross(unit, edges[:, k]) for unit in np.eye(3) for k in range(3)]
    for axis in axes:
        heights = np.einsum("nkj,nj->nk", corners, axis)
        reach = np.abs(axis) @ half_m
        touching[near] &= (heights.min(axis=1) <= reach) & (heights.max(axis=1) >= -reach)
    return touching
