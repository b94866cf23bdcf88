"""Interface of camera models, central and non-central, with their types of rays and pixels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.arrays import Bools, Floats
from omnisim.core.errors import OpticsError

Uniforms = dict[str, float | tuple[float, ...]]
ParameterValue = (
    float | int | str | Sequence["ParameterValue"] | Mapping[str, "ParameterValue"]
)  # representable in JSON and TOML
CameraParameters = dict[str, ParameterValue]


class Rays(NamedTuple):
    """Rays in the optical frame; rays of a central camera start at the effective viewpoint."""

    directions: Floats  # (..., 3), unit length
    valid: Bools  # (...,): the pixel sees something along this ray
    origins_m: Floats | None = None  # (..., 3); None: frame's origin


class Pixels(NamedTuple):
    """Positions in the image."""

    positions_px: Floats  # (..., 2): u right, v down
    valid: Bools  # (...,): the direction is seen, inside or outside the image


@runtime_checkable
class CentralCamera(Protocol):
    """A camera whose rays all meet in one effective viewpoint; immutable and hashable.

    Attributes:
        width_px, height_px: image size.
        principal_point_px: (u, v) of the optical frame's z axis, inside or outside the image.
        model_name: stem of the model's files, `<model>.py` and
            `shaders/camera/<model>.glsl`.
        rig_from_optical: (3, 3) orientation in a level rig: looking ahead, or up into its mirror.
        domain_limit_rad: angle from the axis at which a parameter ends the domain, or None.
    """

    @property
    def width_px(self) -> int: ...  # noqa: D102

    @property
    def height_px(self) -> int: ...  # noqa: D102

    @property
    def principal_point_px(self) -> tuple[float, float]: ...  # noqa: D102

    @property
    def model_name(self) -> str: ...  # noqa: D102

    @property
    def rig_from_optical(self) -> Floats: ...  # noqa: D102

    @property
    def domain_limit_rad(self) -> float | None: ...  # noqa: D102

    def __hash__(self) -> int: ...

    def scaled(self, scale: float) -> Self:
        """The same view in an image `scale` times as large; sizes are rounded."""
        ...

    def ray_from_pixel(self, pixels_px: ArrayLike) -> Rays:
        """Rays of pixels (..., 2); valid inside the domain."""
        ...

    def pixel_from_ray(self, directions: ArrayLike) -> Pixels:
        """Pixels of directions (..., 3) of any length; valid inside the domain."""
        ...

    def uniforms(self) -> Uniforms:
        """Values of the uniforms that the model's GLSL file declares."""
        ...

    def parameters(self) -> CameraParameters:
        """Model name and parameters, representable in JSON, for image metadata."""
        ...


@runtime_checkable
class NonCentralCamera(CentralCamera, Protocol):
    """A camera whose rays have distinct origins: the pixel of a point depends on its distance.

    It has all methods of a central camera; `pixel_from_ray` gives the pixels of infinitely distant
    points.
    """

    def pixel_from_point(self, points_m: ArrayLike) -> Pixels:
        """Pixels of points (..., 3), optical frame; valid where the points are seen."""
        ...

    def by_color(self) -> tuple[CentralCamera, ...]:
        """Cameras for R, G and B if the rays depend on the color; otherwise the camera alone."""
        ...


def pixels_of_points(camera: CentralCamera, points_m: Floats, is_finite: Bools) -> Pixels:
    """Pixels of points (n, 3) in meters, optical frame, for any camera.

    Where `is_finite` (n,) is False, they are directions to points at infinity.
    """
    if not isinstance(camera, NonCentralCamera):
        return camera.pixel_from_ray(points_m)
    positions_px, valid = np.zeros((len(points_m), 2)), np.zeros(len(points_m), dtype=np.bool_)
    for rows, project in (
        (is_finite, camera.pixel_from_point),
        (~is_finite, camera.pixel_from_ray),
    ):
        if rows.any():
            positions_px[rows], valid[rows] = project(points_m[rows])
    return Pixels(positions_px, valid)


def check_central(camera: CentralCamera, use: str) -> None:
    """Reject a camera without an effective viewpoint; `use` names what needs one, for the message.

    Raises:
        OpticsError: the camera is non-central; the message names it and the use.
    """
    if isinstance(camera, NonCentralCamera):
        raise OpticsError(
            f"{use}: expected a central camera, got model {camera.model_name!r}, which is "
            "non-central"
        )


def without_prefix(reason: Exception | str) -> str:
    """Message of an error of a camera's parameters, without the word camera in front of the key."""
    return str(reason).removeprefix("camera: ").removeprefix("camera.")


def summary(camera: CentralCamera) -> str:
    """Model and image size of a camera as short text."""
    return f"{camera.model_name} {camera.width_px} × {camera.height_px} px"


@runtime_checkable
class CameraSensor(Protocol):
    """Sensor that captures images through a camera model, such as an `OmniCamera`."""

    @property
    def model(self) -> CentralCamera: ...  # noqa: D102


def as_pixels(pixels_px: ArrayLike) -> Floats:
    """Convert pixels (..., 2) to an array; an array is not copied.

    Raises:
        OpticsError: the shape is wrong, or the values are not numbers.
    """
    return _as_vectors(pixels_px, 2, "pixels (..., 2)")


def as_directions(directions: ArrayLike) -> Floats:
    """Convert directions (..., 3) to an array; an array is not copied.

    Raises:
        OpticsError: the shape is wrong, or the values are not numbers.
    """
    return _as_vectors(directions, 3, "directions (..., 3)")


def _as_vectors(values: ArrayLike, length: int, expected: str) -> Floats:
    try:
        vectors = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise OpticsError(f"camera: expected {expected}, got no array of numbers") from None
    if vectors.shape[-1:] != (length,):
        raise OpticsError(f"camera: expected {expected}, got an array of shape {vectors.shape}")
    return vectors


def pixel_grid(width_px: int, height_px: int) -> Floats:
    """Centers (height, width, 2) of all pixels of an image."""
    u, v = np.meshgrid(np.arange(width_px, dtype=np.float64), np.arange(height_px))
    return np.stack((u, v.astype(np.float64)), axis=-1)
