"""Beams on the back end of virtual cameras: cast as rays in scenes with glass or mirrors.

Virtual cameras see the first surfaces only. Beams are therefore cast by Embree in such scenes, and
drawn in all others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Generic, TypeVar

from omnisim.core.arrays import Floats
from omnisim.core.world import ObjectPart, Poses
from omnisim.rendering.contract import BeamCaster, RangeFinder

if TYPE_CHECKING:
    from omnisim.ground_truth.lidar_beams import BeamHits, Revolution

CasterT = TypeVar("CasterT", bound=RangeFinder | BeamCaster)


class _Followed(Generic[CasterT]):
    """Caster by virtual cameras (`draw`) or rays (`cast`), as the scene needs after each edit."""

    def __init__(
        self, follows: Callable[[], bool], draw: Callable[[], CasterT], cast: Callable[[], CasterT]
    ):
        self._follows, self._draw, self._cast = follows, draw, cast
        self._is_cast = follows()
        self._caster = cast() if self._is_cast else draw()

    def refresh(self) -> None:
        """Adapt to the scene after its objects or buffers have changed."""
        is_cast = self._follows()
        if is_cast == self._is_cast:
            self._caster.refresh()
            return
        self._is_cast = is_cast
        self._caster = self._cast() if is_cast else self._draw()


class FollowedRanges(_Followed[RangeFinder]):
    """Beams of a scanner."""

    def cast(self, world_from_scanner: Floats, world_from_objects: Poses = ()) -> Floats:
        """Ranges (n,) in m from a pose (4, 4), with the objects at their poses; +inf: no hit."""
        return self._caster.cast(world_from_scanner, world_from_objects)


class FollowedBeams(_Followed[BeamCaster]):
    """Beams of a spinning lidar."""

    @property
    def draws(self) -> Sequence[ObjectPart]:
        """Dynamic object and name of each instance, indexed by `BeamHits.draw_ids` − 1."""
        return self._caster.draws

    def cast(self, revolution: Revolution) -> BeamHits:
        """Hits of all beams of a revolution."""
        return self._caster.cast(revolution)
