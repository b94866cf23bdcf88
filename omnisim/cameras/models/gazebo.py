"""Gazebo's custom wide-angle lens.

    r = c1 f fun(θ/c2 + c3), fun one of sin, tan, id

Domain: θ_min ≤ θ ≤ θ_edge. θ_min = max(0, −c2 c3): below it, r would be negative. θ_edge is θ_max
or a smaller limit of the function: for sin, c2 (90° − c3), where the image would fold over; for
tan, c2 (89.9° − c3), before r becomes infinite.

GLSL twin: `shaders/camera/gazebo.glsl`. Source: SDFormat's specification,
camera/lens/custom_function.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from omnisim.cameras.camera import Uniforms
from omnisim.cameras.parametric_camera import FocalCamera, RadialCamera, WideTheta
from omnisim.core.arrays import Floats
from omnisim.core.files.parameters import Number, Positive

_MAX_ARGUMENT = {"sin": 0.5 * math.pi, "tan": math.radians(89.9), "id": math.inf}
FUNCTIONS: Mapping[str, Callable[[Floats], Floats]] = {
    "sin": np.sin, "tan": np.tan, "id": np.positive,
}  # fmt: skip
_INVERSES = {"sin": np.arcsin, "tan": np.arctan, "id": np.positive}


@dataclass(frozen=True)
class GazeboCamera(FocalCamera, RadialCamera):
    """Fisheye lens given by a function and three constants."""

    c1: Positive
    """Scale of the radius; c1 = c2 = 2 with tan: stereographic; 1 with id: equidistant."""
    c2: Positive
    """Scale of the angle."""
    c3: Annotated[Number, Field(le=0.0)]
    """Offset of the function's argument; a positive value would leave a hole in the image."""
    function: str
    """Function of the angle: "sin", "tan" or "id"."""
    theta_max_rad: WideTheta = math.pi
    """Angle from the axis where the domain ends."""
    model_name = "gazebo"

    def _check(self) -> None:
        super()._check()
        if self.function not in FUNCTIONS:
            raise self._error("function", "sin, tan or id")
        if not self.theta_min_rad < self.theta_edge_rad:
            raise self._error("c3", "a domain that is not empty")

    @property
    def theta_min_rad(self) -> float:
        """Angle from the axis where the domain begins."""
        return max(0.0, -self.c2 * self.c3)

    @property
    def theta_edge_rad(self) -> float:
        """Angle from the axis where the domain ends."""
        return min(self.theta_max_rad, self.c2 * (_MAX_ARGUMENT[self.function] - self.c3))

    def _radius_from_theta(self, theta: Floats) -> Floats:
        return self.c1 * FUNCTIONS[self.function](theta / self.c2 + self.c3)

    def _theta_from_radius(self, radius: Floats) -> Floats:
        value = radius / self.c1
        value = np.minimum(value, 1.0) if self.function == "sin" else value
        theta = self.c2 * (_INVERSES[self.function](value) - self.c3)
        return np.clip(theta, self.theta_min_rad, self.theta_edge_rad)

    def uniforms(self) -> Uniforms:
        """Values for `shaders/camera/gazebo.glsl`."""
        return {
            **super().uniforms(),
            "u_constants": (self.c1, self.c2, self.c3),
            "u_function": list(FUNCTIONS).index(self.function),
            "u_theta_limits_rad": (self.theta_min_rad, self.theta_edge_rad),
            "u_radius_limits": self.radius_limits,
        }
