"""What models with a focal length, or one for each axis, and a principal point have in common."""

from __future__ import annotations

from dataclasses import dataclass

from omnisim.cameras.parameters import check_finite, check_picture
from omnisim.cameras.parametric_camera import ParametricCamera
from omnisim.errors import OpticsError


@dataclass(frozen=True)
class FocalCamera(ParametricCamera):
    """Size, focal length and principal point of a picture; the model is up to the subclass.

    Attributes:
        width_px, height_px: size of the picture.
        focal_length_px: focal length.
        principal_point_px: (u, v) of the optical frame's z axis in the picture.

    Raises:
        OpticsError: a size or focal length that is not positive, or a centre that is not finite.
    """

    focal_length_px: float
    principal_point_px: tuple[float, float]

    def __post_init__(self) -> None:
        check_picture(self)

    @property
    def pixels_per_plane(self) -> float:
        """Pixels to a unit of the normalised plane."""
        return self.focal_length_px

    def uniforms(self) -> dict[str, float | tuple[float, ...]]:
        """Values of the uniforms of `shaders/camera/<model>.glsl`."""
        return {
            "u_focal_length_px": self.focal_length_px,
            "u_principal_point_px": self.principal_point_px,
        }


@dataclass(frozen=True)
class TwoFocalCamera(ParametricCamera):
    """The same with a focal length along each axis of the picture, as calibrations give them.

    Attributes:
        width_px, height_px: size of the picture.
        focal_lengths_px: (fx, fy), along u and along v.
        principal_point_px: (u, v) of the optical frame's z axis in the picture.

    Raises:
        OpticsError: a size or focal length that is not positive, or a centre that is not finite.
    """

    focal_lengths_px: tuple[float, float]
    principal_point_px: tuple[float, float]

    def __post_init__(self) -> None:
        super().__post_init__()
        check_finite(self, "focal_lengths_px", "principal_point_px")
        if min(self.focal_lengths_px) <= 0.0:
            raise OpticsError(f"camera: focal_lengths_px = {self.focal_lengths_px}: want > 0")

    @property
    def pixels_per_plane(self) -> tuple[float, float]:
        """Pixels to a unit of the normalised plane, along u and along v."""
        return self.focal_lengths_px

    def uniforms(self) -> dict[str, float | tuple[float, ...]]:
        """Values of the uniforms of `shaders/camera/<model>.glsl`."""
        return {
            "u_focal_lengths_px": self.focal_lengths_px,
            "u_principal_point_px": self.principal_point_px,
        }
