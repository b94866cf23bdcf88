"""Contacts of a vehicle's body with the scene along a trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import TrajectoryError
from omnisim.scene import Scene
from omnisim.scene.triangles import TriangleBvh, triangles_within
from omnisim.simulation.body_box import BodyBox
from omnisim.simulation.sweep import Sweep

NO_SIZE = "the robot has neither a [footprint] nor a body: contacts are not looked for"
POSES_AT_ONCE = 2000  # bounds the memory


@dataclass(frozen=True)
class Contact:
    """Contact of the body with an object.

    Attributes:
        object: name of its node.
        step: at or before the first contact.
        time_s: of the first contact.
        position_m: x, y of the base at it.
        steps: how many steps have contact, at their pose or on the way to the next.
    """

    object: str
    step: int
    time_s: float
    position_m: tuple[float, float]
    steps: int

    def __str__(self) -> str:
        x, y = self.position_m
        return (
            f"contact with {self.object} first at step {self.step}, {self.time_s:.2f} s, "
            f"({x:.2f}, {y:.2f}) m; {self.steps} step{'' if self.steps == 1 else 's'} in all"
        )


def find_contacts(scene: Scene, sweep: Sweep, box: BodyBox) -> tuple[Contact, ...]:
    """Contacts of a box with the scene's triangles, in the order in which they begin.

    The box is the body's, from its clearance up: the floor is no contact.
    """
    low, high = box.low_m.copy(), box.high_m
    low[2] = box.clearance_m
    poses, half = sweep.world_from_base, 0.5 * (high - low)
    centres = poses[:, :3, :3] @ (0.5 * (low + high)) + poses[:, :3, 3]
    extents = np.abs(poses[:, :3, :3]) @ half
    bounds = (centres - extents).min(axis=0), (centres + extents).max(axis=0)
    triangles = triangles_within(scene, *bounds)
    bvh = TriangleBvh(triangles.corners_m)
    touched = []  # (pose, instance)
    for begin in range(0, len(poses), POSES_AT_ONCE):
        part = slice(begin, begin + POSES_AT_ONCE)
        at, hit = bvh.overlaps((centres - extents)[part], (centres + extents)[part])
        at += begin
        offsets = triangles.corners_m[hit] - centres[at, None]
        touching = meet_box(offsets @ poses[at, :3, :3], half)
        touched.append(np.stack((at[touching], triangles.instances[hit[touching]]), axis=1))
    return _contacts(scene, sweep, np.unique(np.concatenate(touched), axis=0))


def check_no_contact(contacts: Sequence[Contact] | None, where: str) -> None:
    """Refuse contacts, and robots of unknown size.

    Raises:
        TrajectoryError: naming the first.
    """
    if contacts is None:
        raise TrajectoryError(f"{where}: {NO_SIZE}: expected one of them with --no-contact")
    if contacts:
        others = f", and with {len(contacts) - 1} more" if len(contacts) > 1 else ""
        raise TrajectoryError(f"{where}: {contacts[0]}{others}: expected none with --no-contact")


def _contacts(scene: Scene, sweep: Sweep, touched: NDArray[np.intp]) -> tuple[Contact, ...]:
    """Contacts by object, of pairs (n, 2) of a pose and an instance, in order."""
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


def meet_box(corners_m: NDArray[np.float64], half_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Triangles (n, 3, 3) that meet the box between −half (3,) and half: a mask (n,).

    By separating axes: the box's, the triangle's normal, and the products of their edges.

    Source: Akenine-Möller, "Fast 3D Triangle-Box Overlap Testing", Journal of Graphics Tools 6
    (2001).
    """
    meets: NDArray[np.bool_] = np.all(corners_m.min(axis=1) <= half_m, axis=1)
    meets &= np.all(corners_m.max(axis=1) >= -half_m, axis=1)
    edges = np.roll(corners_m, -1, axis=1) - corners_m
    axes = [np.cross(edges[:, 0], edges[:, 1])]
    axes += [np.cross(unit, edges[:, k]) for unit in np.eye(3) for k in range(3)]
    for axis in axes:
        heights = np.einsum("nkj,nj->nk", corners_m, axis)
        reach = np.abs(axis) @ half_m
        meets &= (heights.min(axis=1) <= reach) & (heights.max(axis=1) >= -reach)
    return meets
