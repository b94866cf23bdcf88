"""FOV lens of Kalibr and COLMAP, which readers replace by the nearest omnisim model.

    r = atan(2 tan θ tan(w/2))/w

Source: Devernay & Faugeras, "Straight lines have to be straight", 2001.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from omnisim.cameras.focal_camera import TwoFocalCamera
from omnisim.cameras.plane_camera import RadialCamera
from omnisim.core.arrays import Floats
from omnisim.core.errors import OpticsError

MAX_THETA_RAD = math.radians(88.9)


@dataclass(frozen=True)
class FovLens(TwoFocalCamera, RadialCamera):
    """Lens of the FOV model.

    Raises:
        OpticsError: w is not between 0 and π.
    """

    w: float  # field of view of the ideal fisheye, in radians
    model_name = "fov"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1e-6 < self.w < math.pi:
            raise OpticsError(f"camera: w: expected more than 0 and less than π, got {self.w:g}")

    @property
    def theta_edge_rad(self) -> float:
        """Angle from +z where the domain ends."""
        return MAX_THETA_RAD

    def _radius_from_theta(self, theta: Floats) -> Floats:
        return np.asarray(np.arctan(2.0 * math.tan(0.5 * self.w) * np.tan(theta)) / self.w)

    def _theta_from_radius(self, radius: Floats) -> Floats:
        return np.asarray(np.arctan(np.tan(radius * self.w) / (2.0 * math.tan(0.5 * self.w))))
