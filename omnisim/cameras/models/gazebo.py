"""Gazebo's custom wide-angle lens.

    r = c1 f fun(θ/c2 + c3), fun one of sin, tan, id

Domain: θ_min ≤ θ ≤ θ_edge. θ_min = max(0, −c2 c3): below it, r would be negative. θ_edge is θ_max
or a smaller limit of the function: for sin, c2 (90° − c3), where the image would fold over; for
tan, c2 (89.9° − c3), before r becomes infinite.

| parameter | unit | typical |
| --- | --- | --- |
| focal_length_px | px | 100 to 1000 |
| principal_point_px | px | image center |
| c1, c2 | – | > 0; 2, 2 with tan: stereographic; 1, 1 with id: equidistant |
| c3 | – | ≤ 0; a positive value would leave a hole in the image |
| function | – | "sin", "tan" or "id" |
| theta_max_deg | degrees | 90 to 110 |

GLSL twin: `shaders/camera/gazebo.glsl`. Source: SDFormat's specification,
camera/lens/custom_function.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras.camera import Uniforms
from omnisim.cameras.focal_camera import FocalCamera
from omnisim.cameras.model_parameters import check_limits
from omnisim.cameras.plane_camera import RadialCamera
from omnisim.core.errors import OpticsError

_MAX_ARGUMENT = {"sin": 0.5 * math.pi, "tan": math.radians(89.9), "id": math.inf}
FUNCTIONS: Mapping[str, Callable[[NDArray[np.float64]], NDArray[np.float64]]] = {
    "sin": np.sin,
    "tan": np.tan,
    "id": np.positive,
}
_INVERSES = {"sin": np.arcsin, "tan": np.arctan, "id": np.positive}


@dataclass(frozen=True)
class GazeboCamera(FocalCamera, RadialCamera):
    """Fisheye lens given by a function and three constants.

    Attributes:
        width_px, height_px: image size.
        focal_length_px: f.
        principal_point_px: (u, v) of the optical axis in the image.
        c1, c2, c3: constants; c1 and c2 are positive, c3 is not.
        function: "sin", "tan" or "id".
        theta_max_rad: upper limit of the angle from the axis at which the domain ends.

    Raises:
        OpticsError: a size, focal length, c1 or c2 is not positive, c3 is positive, a number is not
            finite, the function is unknown, θ_max is outside 0 to 180°, or the domain is empty.
    """

    c1: float
    c2: float
    c3: float
    function: str
    theta_max_rad: float = math.pi
    model_name = "gazebo"

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("c1", "c2"):
            check_limits(self, name, 1e-9, math.inf, "more than 0")
        check_limits(self, "c3", -math.inf, 0.0, "at most 0, as above the image has a hole")
        if self.function not in FUNCTIONS:
            raise OpticsError(f"camera: function: expected sin, tan or id, got {self.function!r}")
        if not self.theta_min_rad < self.theta_edge_rad:
            raise OpticsError(f"camera: c3: expected a domain that is not empty, got {self.c3:g}")

    @property
    def theta_min_rad(self) -> float:
        """Angle from the axis where the domain begins."""
        return max(0.0, -self.c2 * self.c3)

    @property
    def theta_edge_rad(self) -> float:
        """Angle from the axis where the domain ends."""
        return min(self.theta_max_rad, self.c2 * (_MAX_ARGUMENT[self.function] - self.c3))

    def _radius_from_theta(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        return self.c1 * FUNCTIONS[self.function](theta / self.c2 + self.c3)

    def _theta_from_radius(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
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
