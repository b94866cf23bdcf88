"""Interface of shadow maps for the passes that draw lit surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import moderngl

from omnisim.core.array_types import Float64s


class ShadowSource(Protocol):
    """Shadow maps of a scene's lamps, for shaders/scene/shadow.glsl."""

    @property
    def defines(self) -> tuple[str, ...]:
        """Defines of programs that look up shadows."""

    @property
    def anchor_m(self) -> Float64s:
        """Origin (3,) of the maps, world."""

    def are_shared(self, poses: Sequence[tuple[Float64s, Sequence[Float64s]]]) -> bool:
        """Tell whether poses of rigs and of the dynamic objects all share their maps."""

    def connect(self, program: moderngl.Program) -> None:
        """Set the samplers and blocks of a program that looks up shadows."""

    def prepare(self, viewpoint_m: Float64s, world_from_objects: Sequence[Float64s]) -> None:
        """Draw the maps that a frame needs, and bind them.

        Args:
            viewpoint_m: (3,) position of the viewpoint, world.
        """
