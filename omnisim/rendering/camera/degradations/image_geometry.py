"""Image geometry: positions of pixels relative to the optical axis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera

LinearImage = NDArray[np.float32]  # (height, width, 4): linear RGB, and 1 if valid, else 0


@dataclass(frozen=True)
class ImageGeometry:
    """Size and center of an image.

    Attributes:
        width_px, height_px: size.
        center_px: (u, v) principal point.
    """

    width_px: int
    height_px: int
    center_px: tuple[float, float]

    @classmethod
    def of_camera(cls, camera: CentralCamera) -> ImageGeometry:
        """Geometry of a camera's image."""
        u, v = camera.principal_point_px
        return cls(camera.width_px, camera.height_px, (float(u), float(v)))

    @property
    def radius_unit_px(self) -> float:
        """Half of the shorter side: an image radius of 1, the rim of a mirror that fills it."""
        return 0.5 * min(self.width_px, self.height_px)

    def offsets_px(self) -> NDArray[np.float32]:
        """Vectors (height, width, 2) from the center to each pixel."""
        u = np.arange(self.width_px, dtype=np.float32) - np.float32(self.center_px[0])
        v = np.arange(self.height_px, dtype=np.float32) - np.float32(self.center_px[1])
        return np.stack(np.meshgrid(u, v), axis=-1)

    def squared_radii(self) -> NDArray[np.float32]:
        """Squares (height, width) of the image radius, in units of `radius_unit_px`."""
        scaled = self.offsets_px() * np.float32(1.0 / self.radius_unit_px)
        return scaled[..., 0] * scaled[..., 0] + scaled[..., 1] * scaled[..., 1]

    def uniforms(self) -> dict[str, Any]:
        """Values of the uniforms of `shaders/degradation/squared_radius.glsl`."""
        return {"u_center_px": self.center_px, "u_inverse_radius_unit": 1.0 / self.radius_unit_px}
