"""Catadioptric camera that was calibrated as a lens: the lens's rays with z reflected.

Calibration tools expect visible points at z > 0, but a camera that looks up into a mirror sees
points behind itself. Such a camera is calibrated in a mirrored frame, (x, y, −z), and this model
undoes the reflection. Its GLSL twin is the lens's, with `MIRRORED` in `shaders/capture/lens.frag`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from omnisim.cameras.camera import (
    CameraParameters,
    CentralCamera,
    Pixels,
    Rays,
    Uniforms,
    as_directions,
)
from omnisim.core.arrays import Floats
from omnisim.core.coordinate_frames import (
    BASE_FROM_OPTICAL_LOOKING_AHEAD,
    FLIP_Z,
    RIG_FROM_OPTICAL_LOOKING_UP,
)
from omnisim.core.errors import OpticsError
from omnisim.core.short_repr import short_repr


@dataclass(frozen=True)
class MirroredCamera:
    """Camera below a mirror, described by the parameters of a lens.

    Raises:
        OpticsError: the lens is already a mirror.
    """

    lens: CentralCamera  # lens with the rays (x, y, −z) for this camera's rays (x, y, z)

    def __repr__(self) -> str:
        return short_repr(self, repr(self.lens))

    def __post_init__(self) -> None:
        if not np.array_equal(self.lens.rig_from_optical, BASE_FROM_OPTICAL_LOOKING_AHEAD):
            raise OpticsError(
                f"camera: mirrored: expected a lens, got the mirror {self.lens.model_name!r}"
            )

    @classmethod
    def of(cls, lens: CentralCamera, parameters: Mapping[str, Any]) -> CentralCamera:
        """Build the lens itself or its mirrored camera, depending on the key `mirrored`.

        Raises:
            OpticsError: `mirrored` is neither true nor false.
        """
        mirrored = parameters.get("mirrored", False)
        if type(mirrored) is not bool:
            raise OpticsError(f"camera: mirrored: expected true or false, got {mirrored!r}")
        return cls(lens) if mirrored else lens

    @property
    def rig_from_optical(self) -> Floats:
        """Orientation (3, 3) in a level rig: looking up into the mirror."""
        return RIG_FROM_OPTICAL_LOOKING_UP

    @property
    def width_px(self) -> int:
        """Image width."""
        return self.lens.width_px

    @property
    def height_px(self) -> int:
        """Image height."""
        return self.lens.height_px

    @property
    def model_name(self) -> str:
        """Stem of the lens's files."""
        return self.lens.model_name

    @property
    def principal_point_px(self) -> tuple[float, float]:
        """(u, v) of the axis in the image."""
        return self.lens.principal_point_px

    @property
    def domain_limit_rad(self) -> float | None:
        """Angle from the axis at which a parameter ends the lens's domain, or None."""
        return self.lens.domain_limit_rad

    def scaled(self, scale: float) -> MirroredCamera:
        """The same view in an image `scale` times as large; sizes are rounded."""
        return dataclasses.replace(self, lens=self.lens.scaled(scale))

    def ray_from_pixel(self, pixels_px: ArrayLike) -> Rays:
        """Rays of pixels (..., 2); valid where the lens is valid."""
        rays = self.lens.ray_from_pixel(pixels_px)
        return Rays(rays.directions * FLIP_Z, rays.valid)

    def pixel_from_ray(self, directions: ArrayLike) -> Pixels:
        """Pixels of directions (..., 3) in the optical frame; valid where the lens is valid."""
        return self.lens.pixel_from_ray(as_directions(directions) * FLIP_Z)

    def uniforms(self) -> Uniforms:
        """Uniforms for the lens's GLSL file."""
        return self.lens.uniforms()

    def parameters(self) -> CameraParameters:
        """Parameters of the lens, plus `mirrored`."""
        return {**self.lens.parameters(), "mirrored": True}
