"""Bases of camera models with a principal point and one focal length, or one per axis."""

from __future__ import annotations

from dataclasses import dataclass

from omnisim.cameras.camera import Uniforms
from omnisim.cameras.model_parameters import check_limits
from omnisim.cameras.parametric_camera import ParametricCamera
from omnisim.core.errors import OpticsError

# Far beyond any camera; squares of derived values still fit into a float.
FOCAL_LENGTHS_PX = (1e-30, 1e30)
MAX_PX = 1e15


@dataclass(frozen=True)
class FocalCamera(ParametricCamera):
    """Image size, focal length and principal point; subclasses add the projection.

    Attributes:
        width_px, height_px: image size.
        focal_length_px: focal length.
        principal_point_px: (u, v) of the optical frame's z axis in the image.

    Raises:
        OpticsError: a size or focal length is not positive, or the center is not finite.
    """

    focal_length_px: float
    principal_point_px: tuple[float, float]

    def __post_init__(self) -> None:
        super().__post_init__()
        check_limits(self, "focal_length_px", *FOCAL_LENGTHS_PX)
        _check_principal_point(self.principal_point_px)

    @property
    def pixels_per_plane(self) -> float:
        """Pixels per unit of the normalized plane."""
        return self.focal_length_px

    def uniforms(self) -> Uniforms:
        """Uniforms for `shaders/camera/<model>.glsl`."""
        return {
            "u_focal_length_px": self.focal_length_px,
            "u_principal_point_px": self.principal_point_px,
        }


@dataclass(frozen=True)
class TwoFocalCamera(ParametricCamera):
    """A `FocalCamera` with one focal length per image axis, as calibrations have.

    Attributes:
        width_px, height_px: image size.
        focal_lengths_px: (fx, fy), along u and along v.
        principal_point_px: (u, v) of the optical frame's z axis in the image.

    Raises:
        OpticsError: a size or focal length is not positive, or the center is not finite.
    """

    focal_lengths_px: tuple[float, float]
    principal_point_px: tuple[float, float]

    def __post_init__(self) -> None:
        super().__post_init__()
        if min(self.focal_lengths_px) <= 0.0:
            raise OpticsError(
                f"camera: focal_lengths_px: expected more than 0, got {self.focal_lengths_px}"
            )
        lowest, highest = FOCAL_LENGTHS_PX
        if not lowest <= min(self.focal_lengths_px) <= max(self.focal_lengths_px) <= highest:
            raise OpticsError(
                f"camera: focal_lengths_px: expected {lowest:g} to {highest:g}, "
                f"got {self.focal_lengths_px}"
            )
        _check_principal_point(self.principal_point_px)

    @property
    def pixels_per_plane(self) -> tuple[float, float]:
        """Pixels per unit of the normalized plane, along u and along v."""
        return self.focal_lengths_px

    def uniforms(self) -> Uniforms:
        """Uniforms for `shaders/camera/<model>.glsl`."""
        return {
            "u_focal_lengths_px": self.focal_lengths_px,
            "u_principal_point_px": self.principal_point_px,
        }


def _check_principal_point(principal_point_px: tuple[float, float]) -> None:
    if not all(abs(value) <= MAX_PX for value in principal_point_px):
        raise OpticsError(
            f"camera: principal_point_px: expected numbers within ±{MAX_PX:g}, "
            f"got {principal_point_px}"
        )
