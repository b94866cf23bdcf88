"""What degradations need of an image: a metered luminance, its geometry, and steps for the GPU.

Of the meter's statistics, a percentile is robust. The median ignores a bright window or lamp that
fills less than half of the image, so the room around it does not turn black. The mean follows the
brightest parts. Steps are only described here, for back ends to run: this opens no OpenGL.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from omnisim.cameras import CentralCamera
from omnisim.core.arrays import AnyFloats, Floats32

LUMINANCE = (0.2126, 0.7152, 0.0722)  # weights of linear red, green and blue, Rec. 709
LinearImage = Floats32  # (height, width, 4): linear RGB, and 1 if valid, else 0
UniformValue = float | tuple[float, ...]


@dataclass(frozen=True)
class Metering:
    """Statistic of the valid pixels' luminances."""

    percentile: float | None = None  # percentile, linearly interpolated; None: mean

    def of_image(self, image: Floats32) -> float:
        """Metered luminance (Rec. 709) of an image (height, width, 4); 0 without valid pixels.

        NumPy reference of shaders/degradation/meter.frag and luminance.frag.
        """
        pixels = image[image[..., 3] > 0.5, :3].astype(np.float64)
        return self.of_luminances(pixels @ np.array(LUMINANCE))

    def of_luminances(self, luminances: AnyFloats) -> float:
        """Metered luminance of pixels (n,); 0 if there are none."""
        if luminances.size == 0:
            return 0.0
        if self.percentile is None:
            return float(np.mean(luminances))
        return float(np.percentile(luminances, self.percentile))


@dataclass(frozen=True)
class ImageGeometry:
    """Size and center of an image."""

    width_px: int
    height_px: int
    center_px: tuple[float, float]  # (u, v) principal point

    @classmethod
    def of_camera(cls, camera: CentralCamera) -> ImageGeometry:
        """Geometry of a camera's image."""
        u, v = camera.principal_point_px
        return cls(camera.width_px, camera.height_px, (float(u), float(v)))

    @property
    def radius_unit_px(self) -> float:
        """Half of the shorter side: an image radius of 1, the rim of a mirror that fills it."""
        return 0.5 * min(self.width_px, self.height_px)

    def offsets_px(self) -> Floats32:
        """Vectors (height, width, 2) from the center to each pixel."""
        u = np.arange(self.width_px, dtype=np.float32) - np.float32(self.center_px[0])
        v = np.arange(self.height_px, dtype=np.float32) - np.float32(self.center_px[1])
        return np.stack(np.meshgrid(u, v), axis=-1)

    def squared_radii(self) -> Floats32:
        """Squares (height, width) of the image radius, in units of `radius_unit_px`."""
        scaled = self.offsets_px() * np.float32(1.0 / self.radius_unit_px)
        return scaled[..., 0] * scaled[..., 0] + scaled[..., 1] * scaled[..., 1]

    def uniforms(self) -> dict[str, Any]:
        """Values of the uniforms of `shaders/degradation/squared_radius.glsl`."""
        return {"u_center_px": self.center_px, "u_inverse_radius_unit": 1.0 / self.radius_unit_px}


@dataclass(frozen=True, eq=False)
class EffectStep:
    """Degradation on the GPU: shader and parameters."""

    shader: str  # stem of the file in `shaders/degradation`
    uniforms: Mapping[str, UniformValue] = field(default_factory=dict)  # constant values by name
    # constant (height, width, channels) float32 by sampler name
    textures: Mapping[str, Floats32] = field(default_factory=dict)
