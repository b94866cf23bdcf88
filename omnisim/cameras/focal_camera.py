"""What models with a focal length and a principal point, and nothing else, have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from omnisim.cameras.parameters import check_picture, number, point, whole_number


@dataclass(frozen=True)
class FocalCamera:
    """Size, focal length and principal point of a picture; the model is up to the subclass.

    Attributes:
        width_px, height_px: size of the picture.
        focal_length_px: focal length.
        principal_point_px: (u, v) of the optical frame's z axis in the picture.

    Raises:
        OpticsError: a size or focal length that is not positive, or a centre that is not finite.
    """

    width_px: int
    height_px: int
    focal_length_px: float
    principal_point_px: tuple[float, float]
    model: ClassVar[str]

    def __post_init__(self) -> None:
        check_picture(self)

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any]) -> Self:
        """Make the camera that `parameters()` describes.

        Raises:
            OpticsError: naming the key and what was wanted.
        """
        return cls(
            whole_number(parameters, "width_px"),
            whole_number(parameters, "height_px"),
            number(parameters, "focal_length_px"),
            point(parameters, "principal_point_px"),
        )

    def uniforms(self) -> dict[str, float | tuple[float, ...]]:
        """Values of the uniforms of `shaders/camera/<model>.glsl`."""
        return {
            "u_focal_length_px": self.focal_length_px,
            "u_principal_point_px": self.principal_point_px,
        }

    def parameters(self) -> dict[str, float | int | str | list[float]]:
        """The camera for the picture's metadata."""
        return {
            "model": self.model,
            "width_px": self.width_px,
            "height_px": self.height_px,
            "focal_length_px": self.focal_length_px,
            "principal_point_px": list(self.principal_point_px),
        }
