"""Placement of objects in rooms: models are made once, objects are numbered by their kind."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np

from scenes.mapping.plan import HALF, room_named
from scenes.modeling.geometry import pose
from scenes.modeling.picture_atlas import Atlas
from scenes.modeling.stage import Model, Stage

# Turn of what faces -y so that its back is at a wall.
_YAWS = {"north": 0.0, "west": 90.0, "south": 180.0, "east": -90.0}


class Interior:
    """The rooms' content under construction."""

    def __init__(self, stage: Stage, atlas: Atlas, rng: np.random.Generator):
        self.stage, self.atlas, self.rng = stage, atlas, rng
        self._made: dict[tuple, Model] = {}
        self._count: Counter[str] = Counter()

    def made(self, maker: Callable[..., Model], *arguments) -> Model:
        """The model that `maker` makes of the atlas and the arguments, always the same one."""
        key = (maker, arguments)
        if key not in self._made:
            self._made[key] = maker(self.atlas, *arguments)
        return self._made[key]

    def put(self, kind: str, model: Model, at: np.ndarray) -> None:
        """Add one object; its name is its kind and a number."""
        self._count[kind] += 1
        self.stage.place(f"{kind}_{self._count[kind]:02}", model, at)

    def stand(
        self, kind: str, model: Model, x: float, y: float, yaw_deg: float = 0.0, z: float = 0.0
    ) -> None:
        """Add one object at a place of the world."""
        self.put(kind, model, pose(x, y, z, yaw_deg))

    def lean(
        self,
        kind: str,
        model: Model,
        room: str,
        side: str,
        along: float,
        z: float = 0.0,
        gap: float = 0.015,
    ) -> None:
        """Add one object with its back at a wall of a room, `along` in world coordinates."""
        self.put(kind, model, wall_pose(room, side, along, z, gap))


def wall_pose(room: str, side: str, along: float, z: float = 0.0, gap: float = 0.0) -> np.ndarray:
    """Pose of what has its back at a wall and faces the room."""
    r, inset = room_named(room), HALF + gap
    x, y = {
        "north": (along, r.y1 - inset),
        "south": (along, r.y0 + inset),
        "west": (r.x0 + inset, along),
        "east": (r.x1 - inset, along),
    }[side]
    return pose(x, y, z, _YAWS[side])
