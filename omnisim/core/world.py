"""State of the world: time, and the poses of everything that moves."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

from numpy.typing import ArrayLike

from omnisim.core.arrays import Floats
from omnisim.core.errors import OmnisimError
from omnisim.core.poses import check_pose
from omnisim.core.short_repr import short_repr

Pose = Floats  # (4, 4)
Poses = Sequence[Pose]  # of all dynamic objects, world_from_object
# Index of a dynamic object, None for the static scene; and the name of its instance.
ObjectPart = tuple[int | None, str]


class ObjectPoses(tuple[Pose, ...]):
    """Poses (4, 4) of all objects at one time; deforming meshes take their shape at that time."""

    time_s: float  # world time

    def __new__(cls, poses: Iterable[Pose], time_s: float) -> Self:
        """Build the tuple from poses in the order of the objects."""
        object_poses = super().__new__(cls, poses)
        object_poses.time_s = time_s
        return object_poses


def time_of(poses: Sequence[Pose]) -> float:
    """Time of poses in seconds; 0 if they have none."""
    return poses.time_s if isinstance(poses, ObjectPoses) else 0.0


@dataclass(frozen=True, eq=False)
class WorldState:
    """Time, and the pose of each vehicle and dynamic object at that time.

    Attributes:
        world_from_object: (4, 4) poses by name; a vehicle's pose is that of its base.
        time_s: seconds since the start of the world.

    Raises:
        OmnisimError: a matrix is not a pose, or the time is not finite.
    """

    world_from_object: Mapping[str, Pose]
    time_s: float = 0.0

    def __post_init__(self) -> None:
        if not math.isfinite(self.time_s):
            raise OmnisimError(f"time_s: expected a finite number of seconds, got {self.time_s}")
        checked = {name: check_pose(pose) for name, pose in self.world_from_object.items()}
        object.__setattr__(self, "world_from_object", checked)

    @classmethod
    def of_checked(cls, world_from_object: Mapping[str, Pose], time_s: float) -> Self:
        """State of poses and a time that are known to be valid."""
        state = cls.__new__(cls)
        object.__setattr__(state, "world_from_object", world_from_object)
        object.__setattr__(state, "time_s", time_s)
        return state

    def __repr__(self) -> str:
        return short_repr(self, f"{self.time_s:g} s", *self.world_from_object)

    def moved(self, poses: Mapping[str, ArrayLike]) -> WorldState:
        """State at the same time with other poses (4, 4) of some objects, by name.

        Raises:
            OmnisimError: a matrix is not a pose.
        """
        unchecked: dict[str, Any] = {**self.world_from_object, **poses}
        return WorldState(unchecked, self.time_s)


# State of the world at a time in seconds; or the vehicle's pose (4, 4) if nothing else moves.
Motion = Callable[[float], WorldState | Pose]
