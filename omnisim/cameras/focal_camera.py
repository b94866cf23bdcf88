"""Bases of camera models with a principal point and one focal length, or one per axis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from omnisim.cameras.camera import Uniforms
from omnisim.cameras.parametric_camera import ParametricCamera, PrincipalPoint
from omnisim.core.files.parameters import Number, Typical

# Far beyond any camera; squares of derived values still fit into a float.
FocalLength = Annotated[Number, Field(ge=1e-30, le=1e30), Typical(100.0, 1000.0)]


@dataclass(frozen=True)
class FocalCamera(ParametricCamera):
    """Image size, focal length and principal point; subclasses add the projection."""

    focal_length_px: FocalLength
    """Focal length in pixels; at the axis of a fisheye, pixels per radian."""
    principal_point_px: PrincipalPoint
    """(u, v) of the optical frame's z axis in the image; typically its center."""

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
    """A `FocalCamera` with one focal length per image axis, as calibrations have."""

    focal_lengths_px: tuple[FocalLength, FocalLength]
    """(fx, fy), along u and along v, in pixels."""
    principal_point_px: PrincipalPoint
    """(u, v) of the optical frame's z axis in the image; typically its center."""

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
