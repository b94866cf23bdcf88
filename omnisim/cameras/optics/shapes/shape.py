"""Interface of a surface's shape.

In a shape's frame, the origin is the vertex, and z points along the axis of revolution, away from a
camera that looks at the shape. A mirror that bulges toward the camera has z > 0 off its axis.
"""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple

from omnisim.cameras.camera import CameraParameters
from omnisim.core.arrays import Floats


class Level(NamedTuple):
    """Implicit function of a shape: 0 on its surface."""

    values: Floats  # (n,)
    gradients: Floats  # (n, 3)


class Shape(ABC):
    """Surface of revolution, bounded only by its own domain; immutable.

    Attributes:
        shape_name: name in files.
        tip_radius_m: radius about the axis within which it has no normal.
        needs_rim: True if it continues beyond the extent of a real mirror.
    """

    shape_name: ClassVar[str]
    tip_radius_m: ClassVar[float] = 0.0
    needs_rim: ClassVar[bool] = False

    @property
    def domain_m(self) -> float:
        """Largest distance from the axis; may be infinite."""
        return math.inf

    def parameters(self) -> CameraParameters:
        """Name and parameters, as written in optics files."""
        assert dataclasses.is_dataclass(self)
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        plain = {k: list(v) if isinstance(v, tuple) else v for k, v in values.items()}
        return {"shape": self.shape_name, **plain}

    @abstractmethod
    def is_convex(self, radius_m: float) -> bool:
        """True if it bulges toward the camera everywhere within a radius."""

    def is_rising(self, radius_m: float) -> bool:
        """True if it recedes from the camera outwards, everywhere within a radius."""
        return self.is_convex(radius_m)

    @abstractmethod
    def intersections(self, origins_m: Floats, directions: Floats, radius_m: float) -> Floats:
        """Lengths (n, m) along rays (n, 3) to the surface, ascending; NaN: no further crossing.

        Args:
            origins_m, directions: (n, 3) rays, in the shape's frame.
            radius_m: distance from the axis beyond which hits are irrelevant.
        """

    @abstractmethod
    def level(self, points_m: Floats) -> Level:
        """Implicit function at points (n, 3)."""

    @abstractmethod
    def hessians(self, points_m: Floats) -> Floats:
        """Second derivatives (n, 3, 3) of the implicit function at points (n, 3)."""

    @abstractmethod
    def sag_m(self, radii_m: Floats) -> Floats:
        """Heights z (...) of the surface at radii (...); NaN outside its domain."""
