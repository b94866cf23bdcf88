"""Bases of camera models, from the general to the particular.

`ParametricCamera` derives all but the projection from its fields. `PlaneCamera` projects rays onto
a normalized plane, scaled and shifted to the image; `RadialCamera` is its subclass for radially
symmetric lenses, of which a model provides only r(θ) and θ(r). `FocalCamera` and `TwoFocalCamera`
have a principal point and one focal length, or one per axis.
"""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from omnisim.cameras.camera import (
    CameraParameters,
    Pixels,
    Rays,
    Uniforms,
    as_directions,
    as_pixels,
)
from omnisim.core.arrays import Bools, Floats
from omnisim.core.coordinate_frames import BASE_FROM_OPTICAL_LOOKING_AHEAD
from omnisim.core.errors import OpticsError
from omnisim.core.files.parameters import (
    Number,
    Parameters,
    Typical,
    described,
    mapped,
    parse_table,
)
from omnisim.core.short_repr import short_repr

# The ray of a pixel on the edge of the domain is rounded; its projection must still be valid.
EDGE_RAD = 1e-12
# Far beyond any camera; squares of derived values still fit into a float.
MAX_PX, MAX_COEFFICIENT = 1e15, 1e60
PixelCount = Annotated[int, Field(strict=True, ge=1)]
Pixel = Annotated[Number, Field(ge=-MAX_PX, le=MAX_PX)]
PrincipalPoint = tuple[Pixel, Pixel]
Coefficient = Annotated[Number, Field(ge=-MAX_COEFFICIENT, le=MAX_COEFFICIENT)]
Coefficients = tuple[Coefficient, ...]
FocalLength = Annotated[Number, Field(ge=1e-30, le=1e30), Typical(100.0, 1000.0)]
ThetaMax = Annotated[Number, Field(gt=0.0)]  # a model has its own upper limit
WideTheta = Annotated[ThetaMax, Typical(math.radians(90.0), math.radians(110.0))]


@dataclass(frozen=True)
class ParametricCamera(Parameters, ABC, name="camera"):
    """Base of camera models: derives all but the projection from the subclass's fields.

    A field whose name ends in `_px` is a length in the image.

    Attributes:
        model_name: stem of the model's files.
        largest_theta_rad: upper limit of the parameter θ_max, for models that have it.
        added_later: parameters that the metadata of older images lack; their defaults apply.

    Raises:
        OpticsError: a parameter has another type or is outside its limits.
    """

    width_px: PixelCount
    """Width of the image in pixels."""
    height_px: PixelCount
    """Height of the image in pixels."""
    model_name: ClassVar[str]
    _rig_from_optical: ClassVar[Floats] = BASE_FROM_OPTICAL_LOOKING_AHEAD
    largest_theta_rad: ClassVar[float] = math.pi
    added_later: ClassVar[frozenset[str]] = frozenset()

    if TYPE_CHECKING:  # a field of nearly all models; at run time it would be the field's default

        @property
        def principal_point_px(self) -> tuple[float, float]: ...  # noqa: D102

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        setattr(cls, "__repr__", ParametricCamera.__repr__)  # noqa: B010  not the dataclass's own

    def __repr__(self) -> str:
        size, *others = f"{self.width_px} × {self.height_px} px", *dataclasses.fields(self)[2:]
        values = [f"{field.name}={_short(getattr(self, field.name))}" for field in others]
        return short_repr(self, size, *values)

    def _check(self) -> None:
        super()._check()
        largest = self.largest_theta_rad
        if not 1e-6 <= getattr(self, "theta_max_rad", largest) <= largest:
            limits = f"more than 0 and at most {largest:g} ({math.degrees(largest):g}°)"
            raise self._error("theta_max_rad", limits)

    @property
    def rig_from_optical(self) -> Floats:
        """Orientation (3, 3) in a level rig: looking ahead, or up into a mirror."""
        return self._rig_from_optical

    @abstractmethod
    def ray_from_pixel(self, pixels_px: ArrayLike) -> Rays:
        """Rays of pixels (..., 2): unit directions in the optical frame; valid in the domain."""

    @abstractmethod
    def pixel_from_ray(self, directions: ArrayLike) -> Pixels:
        """Pixels of directions (..., 3) in the optical frame; valid in the domain."""

    def sees(self, pixels_px: ArrayLike) -> Bools:
        """Mask (...,) of the pixels (..., 2) whose rays are valid; rays may cost far more."""
        return self.ray_from_pixel(pixels_px).valid

    @abstractmethod
    def uniforms(self) -> Uniforms:
        """Uniforms for `shaders/camera/<model>.glsl`."""

    def scaled(self, scale: float) -> Self:
        """The same view in an image `scale` times as large; sizes are rounded."""
        changes: dict[str, Any] = {}
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if field.name in ("width_px", "height_px"):
                changes[field.name] = round(value * scale)
            elif field.name == "principal_point_px":  # measured from the center of the first pixel
                changes[field.name] = mapped(lambda px: (px + 0.5) * scale - 0.5, value)
            elif field.name.endswith("_px"):
                changes[field.name] = mapped(lambda px: px * scale, value)
        return dataclasses.replace(self, **changes)

    def ending_at(self, theta_max_rad: float) -> Self | None:
        """The same camera with another θ_max, or None if the model has no such parameter.

        Raises:
            OpticsError: θ_max is outside its limits.
        """
        if "theta_max_rad" not in {field.name for field in dataclasses.fields(self)}:
            return None
        changes: dict[str, Any] = {"theta_max_rad": theta_max_rad}
        return dataclasses.replace(self, **changes)

    @property
    def domain_limit_rad(self) -> float | None:
        """Angle from the axis at which a parameter ends the domain, or None."""
        limit = float(getattr(self, "theta_max_rad", math.pi))
        return None if limit == math.pi else limit

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any]) -> Self:
        """Build the camera from its `parameters()`.

        Raises:
            OpticsError: a parameter is invalid; names the key, the actual and the expected value.
        """
        keys = {cls.file_key(field.name): field.name for field in dataclasses.fields(cls)}
        given = {key: parameters[key] for key in keys if key in parameters}
        for key, value in given.items():
            if isinstance(value, np.generic | np.ndarray):
                given[key] = value.tolist()
        camera = parse_table(given, cls, OpticsError, at="camera")
        for key, name in keys.items():  # metadata has the defaults, too
            if key not in given and name not in cls.added_later:
                raise OpticsError(f"camera.{key}: missing")
        return camera

    def parameters(self) -> CameraParameters:
        """Model name and parameters, for image metadata."""
        named: CameraParameters = {"model": self.model_name}
        for field in dataclasses.fields(self):
            value, key = getattr(self, field.name), self.file_key(field.name)
            value = mapped(math.degrees, value) if key != field.name else value
            named[key] = list(value) if isinstance(value, tuple) else value
        return named


def _short(value: Any) -> str:
    """Text of a parameter in 6 digits; a long list becomes its count."""
    if isinstance(value, tuple):
        return f"{len(value)} values" if len(value) > 4 else f"({', '.join(map(_short, value))})"
    return f"{value:z.6g}" if isinstance(value, float) else str(value)


class PlanePoints(NamedTuple):
    """Points of the normalized plane."""

    positions: Floats  # (..., 2): x right, y down, in focal lengths
    valid: Bools  # (...,)


class PlaneCamera(ParametricCamera):
    """Mixin that maps pixels to rays and back through the normalized plane."""

    @property
    @abstractmethod
    def pixels_per_plane(self) -> float | tuple[float, float]:
        """Pixels per unit of the normalized plane."""

    @abstractmethod
    def _rays_from_plane(self, plane: Floats) -> Rays:
        """Rays of points (..., 2) in the plane; outside the domain, those of its nearest edge."""

    @abstractmethod
    def _plane_from_rays(self, directions: Floats) -> PlanePoints:
        """Points (..., 2) of the plane for directions (..., 3) of any length."""

    def ray_from_pixel(self, pixels_px: ArrayLike) -> Rays:
        """Rays of pixels (..., 2): unit directions in the optical frame; valid in the domain."""
        return self._rays_from_plane(self._plane_from_pixels(as_pixels(pixels_px)))

    def pixel_from_ray(self, directions: ArrayLike) -> Pixels:
        """Pixels of directions (..., 3) in the optical frame; valid in the domain."""
        points = self._plane_from_rays(as_directions(directions))
        return Pixels(self._pixels_from_plane(points.positions), points.valid)

    def _plane_from_pixels(self, pixels: Floats) -> Floats:
        return (pixels - self.principal_point_px) / self.pixels_per_plane

    def _pixels_from_plane(self, plane: Floats) -> Floats:
        return plane * self.pixels_per_plane + self.principal_point_px


class AffineCamera(PlaneCamera):
    """Mixin for lenses whose sensor is not square to its axis: a linear map of the plane."""

    @property
    @abstractmethod
    def pixels_from_axes(self) -> Floats:
        """Matrix (2, 2) from the plane to offsets (u, v) from the principal point."""

    @property
    def _axes_from_pixels(self) -> Floats:
        return np.asarray(np.linalg.inv(self.pixels_from_axes), dtype=np.float64)

    def _plane_from_pixels(self, pixels: Floats) -> Floats:
        return (pixels - self.principal_point_px) @ self._axes_from_pixels.T

    def _pixels_from_plane(self, plane: Floats) -> Floats:
        return plane @ self.pixels_from_axes.T + self.principal_point_px

    def uniforms(self) -> Uniforms:
        """Uniforms for `shaders/camera/<model>.glsl`."""
        return {
            "u_principal_point_px": self.principal_point_px,
            "u_axes_from_pixels": tuple(self._axes_from_pixels.T.ravel().tolist()),
        }


Affine = Annotated[Coefficients, Field(min_length=3, max_length=3), described("c, d, e")]


class RadialCamera(PlaneCamera):
    """Radially symmetric lens with radius r on the plane and angle θ from +z.

    Domain: θ_min ≤ θ ≤ θ_edge, where r(θ) increases; on the plane r(θ_min) ≤ r ≤ r(θ_edge).
    """

    @property
    def theta_min_rad(self) -> float:
        """Angle from +z where the domain begins."""
        return 0.0

    @property
    def theta_edge_rad(self) -> float:
        """Angle from +z where the domain ends: θ_max."""
        limit = self.domain_limit_rad
        return math.pi if limit is None else limit

    @abstractmethod
    def _radius_from_theta(self, theta: Floats) -> Floats:
        """Radius r (...,) on the plane at θ (...,), in the domain."""

    @abstractmethod
    def _theta_from_radius(self, radius: Floats) -> Floats:
        """θ (...,) at radius r (...,) on the plane, in the domain."""

    @cached_property
    def radius_limits(self) -> tuple[float, float]:
        """Smallest and largest radius on the plane."""
        ends = np.array([self.theta_min_rad, self.theta_edge_rad])
        first, last = self._radius_from_theta(ends).tolist()
        return first, last

    def sees(self, pixels_px: ArrayLike) -> Bools:
        """Mask (...,) of the pixels (..., 2) whose rays are valid, without these rays."""
        plane = self._plane_from_pixels(as_pixels(pixels_px))
        radius = np.hypot(plane[..., 0], plane[..., 1])
        first, last = self.radius_limits
        return np.asarray((radius >= first) & (radius <= last))

    def _rays_from_plane(self, plane: Floats) -> Rays:
        radius = np.hypot(plane[..., 0], plane[..., 1])
        first, last = self.radius_limits
        theta = self._theta_from_radius(np.clip(radius, first, last))
        across = unit_vectors(plane, radius) * np.sin(theta)[..., None]
        directions = np.concatenate((across, np.cos(theta)[..., None]), axis=-1)
        return Rays(directions, (radius >= first) & (radius <= last))

    def _plane_from_rays(self, directions: Floats) -> PlanePoints:
        across = np.hypot(directions[..., 0], directions[..., 1])
        theta = np.arctan2(across, directions[..., 2])
        first, last = self.theta_min_rad, self.theta_edge_rad
        radius = self._radius_from_theta(np.clip(theta, first, last))
        positions = unit_vectors(directions[..., :2], across) * radius[..., None]
        return PlanePoints(positions, (theta >= first - EDGE_RAD) & (theta <= last + EDGE_RAD))


def unit_vectors(vectors: Floats, lengths: Floats) -> Floats:
    """Normalize vectors (..., 2) by their lengths (...,); (1, 0) for zero vectors."""
    start = np.zeros_like(vectors)
    start[..., 0] = 1.0
    lengths = np.broadcast_to(lengths[..., None], vectors.shape)
    return np.divide(vectors, lengths, out=start, where=lengths > 0.0)


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


class SkewedCamera(TwoFocalCamera, PlaneCamera):
    """A `TwoFocalCamera` whose u also depends on y of the plane, by a skew s.

    (u, v) = (fx x + s y + cx, fy y + cy): s is K[0][1] of a camera matrix, and fx α in OpenCV.
    """

    if TYPE_CHECKING:
        skew_px: float  # at run time a field of each model, in its own order

    def _plane_from_pixels(self, pixels: Floats) -> Floats:
        plane = super()._plane_from_pixels(pixels)
        plane[..., 0] -= self.skew_px / self.focal_lengths_px[0] * plane[..., 1]
        return plane

    def _pixels_from_plane(self, plane: Floats) -> Floats:
        pixels = super()._pixels_from_plane(plane)
        pixels[..., 0] += self.skew_px * plane[..., 1]
        return pixels

    def uniforms(self) -> Uniforms:
        """Uniforms for `shaders/camera/<model>.glsl`."""
        return {**super().uniforms(), "u_skew_px": self.skew_px}


@dataclass(frozen=True)
class FisheyeCamera(FocalCamera, RadialCamera):
    """Ideal fisheye lens, whose r/f is a function of θ alone, up to θ_max.

    Source: Miyamoto, "Fish eye lens", 1964; Kannala & Brandt 2006, Eq. 1 to 5.
    """

    theta_max_rad: ThetaMax
    """Angle from the axis where the domain ends."""

    def uniforms(self) -> Uniforms:
        """Uniforms for `shaders/camera/<model>.glsl`."""
        return {**super().uniforms(), "u_radius_max": self.radius_limits[1]}


MAX_RADIUS = 1e6  # on the normalized plane, if nothing else bounds it: nearly at the limit angle


class AlphaCamera(TwoFocalCamera, PlaneCamera):
    """Base of EUCM and the double sphere: the unified model's sphere in its α form.

    A point p on the unit sphere is projected to (x, y)/(α + (1 − α) z). With ξ = α/(1 − α), this is
    Geyer and Mei's projection from a point ξ above the sphere's center, in an image 1 + ξ times as
    large.
    """

    if TYPE_CHECKING:
        alpha: float  # at run time a field of each model, in its own order

    @property
    def cosine_limit(self) -> float:
        """Lower limit of z on the unit sphere: −α/(1 − α) for α ≤ 0.5, else −(1 − α)/α."""
        alpha = self.alpha
        return -alpha / (1.0 - alpha) if alpha <= 0.5 else -(1.0 - alpha) / alpha

    @property
    def radius_max(self) -> float:
        """Largest radius on the plane: 1/√(2α − 1), where the image folds, for α > 0.5."""
        fold = 1.0 / math.sqrt(2.0 * self.alpha - 1.0) if self.alpha > 0.5 else MAX_RADIUS
        return min(MAX_RADIUS, fold)

    def uniforms(self) -> Uniforms:
        """Uniforms for `shaders/camera/<model>.glsl`."""
        return {**super().uniforms(), "u_alpha": self.alpha, "u_radius_max": self.radius_max}

    def _lift(self, plane: Floats) -> Rays:
        """Unit vectors (..., 3) of points (..., 2); those beyond `radius_max` are moved onto it."""
        alpha, limit = self.alpha, self.radius_max
        radius = np.hypot(plane[..., 0], plane[..., 1])
        shrink = limit / np.maximum(radius, limit)
        plane = plane * shrink[..., None]
        squared = np.sum(plane * plane, axis=-1)
        root = np.sqrt(np.maximum(1.0 - (2.0 * alpha - 1.0) * squared, 0.0))
        z = (1.0 - alpha * alpha * squared) / (alpha * root + 1.0 - alpha)
        directions = np.concatenate((plane, z[..., None]), axis=-1)
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        return Rays(directions, radius <= limit)

    def _project(
        self, directions: Floats, z: Floats, distance: Floats, length: Floats
    ) -> PlanePoints:
        """Project directions (..., 3) to the normalized plane: (x, y)/(α d + (1 − α) z).

        `z` and `distance` d (...,) are those of the model's last sphere. `length` (...,) is the
        length of the directions, used as the scale of rounding errors.
        """
        valid = z > (self.cosine_limit - EDGE_RAD) * distance
        scale = self.alpha * distance + (1.0 - self.alpha) * z
        valid &= scale > 1e-12 * length
        scale = np.where(valid, scale, 1.0)
        return PlanePoints(directions[..., :2] / scale[..., None], valid)
