"""Deviation of a system's rays from a single viewpoint, and central approximations."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from omnisim.cameras import CentralCamera, MirroredCamera, NonCentralCamera, Pixels, Rays
from omnisim.cameras.calibration import CalibratedCamera, Calibration, NamedPose
from omnisim.cameras.calibration.calibrated_camera import OPTICS, CentralError
from omnisim.cameras.calibration.calibration_formats import format_named
from omnisim.cameras.calibration.encode import model_named, nearest_fit
from omnisim.cameras.calibration.fit import Fit, fit_camera
from omnisim.cameras.calibration.formats.format import Fixed, Format
from omnisim.cameras.camera import CameraParameters, Uniforms, as_directions, as_pixels
from omnisim.cameras.optics.system import OpticalSystem, across_bases
from omnisim.core.arrays import Bools, Floats
from omnisim.core.coordinate_frames import FLIP_Z
from omnisim.core.errors import OpticsError
from omnisim.core.short_repr import short_repr

_SAMPLES = 10_000  # approximate number of rays per image


class SeenRays(NamedTuple):
    """Rays of an image's valid pixels, in the sensor's optical frame."""

    pixels_px: Floats  # (n, 2)
    origins_m: Floats  # (n, 3)
    directions: Floats  # (n, 3)


@dataclass(frozen=True)
class Centrality:
    """Deviation of a system's rays from a single viewpoint."""

    viewpoint_m: Floats  # (3,) point nearest to all rays, in the sensor's optical frame
    misses_m: Floats  # (n,) distances between this point and rays spread evenly over the image
    # errors of the central model with the rays' directions and this viewpoint
    errors: tuple[CentralError, ...]


def common_point(origins_m: Floats, directions: Floats) -> Floats:
    """Point (3,) with the smallest sum of squared distances from rays (n, 3).

    If all rays are parallel, it is the point nearest to the mean of their origins.
    """
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    middle = origins_m.mean(axis=0)
    pull = np.einsum("nij,nj->i", across, origins_m - middle)
    return middle + np.linalg.lstsq(across.sum(axis=0), pull, rcond=1e-12)[0]


def measure_centrality(system: NonCentralCamera, distances_m: Sequence[float]) -> Centrality:
    """Measure a system's deviation from a single viewpoint, and errors at distances from it.

    Raises:
        OpticsError: no pixel sees anything, or a distance is not positive.
    """
    check_distances(distances_m)
    rays = seen_rays(system)
    viewpoint_m = common_point(rays.origins_m, rays.directions)
    toward = viewpoint_m - rays.origins_m
    along = np.einsum("nj,nj->n", toward, rays.directions)
    misses_m = np.linalg.norm(toward - along[:, None] * rays.directions, axis=1)
    errors = central_errors(rays, viewpoint_m, distances_m, system.pixel_from_ray)
    return Centrality(viewpoint_m, misses_m, errors)


def check_distances(distances_m: Sequence[float]) -> None:
    """Reject distances that are not positive and finite.

    Raises:
        OpticsError: a distance is invalid; names the first.
    """
    for distance_m in distances_m:
        if not 0.0 < distance_m <= 1e9:
            raise OpticsError(f"at_distance: expected more than 0 and finite, got {distance_m:g}")


def seen_rays(system: NonCentralCamera) -> SeenRays:
    """Rays of valid pixels, spread evenly over the image.

    Raises:
        OpticsError: no pixel sees anything.
    """
    pixels = _pixels(system)
    rays = system.ray_from_pixel(pixels)
    origins_m = np.zeros_like(rays.directions) if rays.origins_m is None else rays.origins_m
    seen = SeenRays(*(part[rays.valid] for part in (pixels, origins_m, rays.directions)))
    if len(seen.pixels_px) == 0:
        raise OpticsError("optics: expected a pixel that sees something, got none")
    return seen


def central_errors(
    rays: SeenRays,
    viewpoint_m: Floats,
    distances_m: Sequence[float],
    pixel_from_ray: Callable[[Floats], Pixels],
) -> tuple[CentralError, ...]:
    """Errors of a central model: its projection of points on rays, against the rays' pixels.

    The model's viewpoint (3,), and the directions (n, 3) that it projects, are in the sensor's
    optical frame. Distances are from the viewpoint, and may be infinite.
    """
    errors = []
    for distance_m in distances_m:
        directions, meets = directions_at(rays.origins_m, rays.directions, viewpoint_m, distance_m)
        seen = pixel_from_ray(directions)
        off_px = np.linalg.norm(seen.positions_px - rays.pixels_px, axis=1)
        errors.append(CentralError.of(distance_m, off_px, seen.valid & meets))
    return tuple(errors)


def directions_at(
    origins_m: Floats, directions: Floats, viewpoint_m: Floats, distance_m: float
) -> tuple[Floats, Bools]:
    """Directions (..., 3) from a viewpoint to the points on rays at a given distance from it.

    Also returns a mask (...) of the rays that have such a point.
    """
    if math.isinf(distance_m):
        return directions, np.ones(directions.shape[:-1], dtype=np.bool_)
    toward = viewpoint_m - origins_m
    along = np.einsum("...j,...j->...", toward, directions)
    squared = np.einsum("...j,...j->...", toward, toward)
    reach = along * along - squared + distance_m**2  # discriminant for the sphere of the viewpoint
    lengths = along + np.sqrt(np.maximum(reach, 0.0))
    return lengths[..., None] * directions - toward, (reach >= 0.0) & (lengths > 0.0)


def _pixels(system: NonCentralCamera) -> Floats:
    """Positions (n, 2) spread evenly over the image, up to the centers of its outermost pixels."""
    step = max(1.0, np.sqrt(system.width_px * system.height_px / _SAMPLES))
    sides = [
        np.linspace(0.0, size - 1.0, int(np.ceil(size / step)))
        for size in (system.width_px, system.height_px)
    ]
    return np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)


# Derivatives of a system's rays by pixel, and its caustic, where neighboring rays meet.
#
# Source: Swaminathan, Grossberg & Nayar, Caustics of catadioptric cameras (ICCV 2001): the points
# o + t d at which the Jacobian by pixel and t is singular; this is a quadratic equation in t.


_STEP_PX = 1e-3


class RayJacobians(NamedTuple):
    """Derivatives of rays by pixel; NaN next to pixels that see nothing."""

    origins_m: Floats  # (..., 3, 2) by (u, v), along the last surface
    directions: Floats  # (..., 3, 2)


def ray_jacobians(system: OpticalSystem, pixels_px: ArrayLike) -> RayJacobians:
    """Derivatives of the rays of pixels (..., 2), by fourth-order central differences."""
    pixels = as_pixels(pixels_px)
    origins = np.zeros((*pixels.shape[:-1], 3, 2))
    directions = np.zeros_like(origins)
    for axis in range(2):
        step = np.eye(2)[axis] * _STEP_PX
        for factor, weight in ((1.0, 8.0), (-1.0, -8.0), (2.0, -1.0), (-2.0, 1.0)):
            rays = system.rays(pixels + factor * step)
            share = np.where(rays.valid, weight / (12.0 * _STEP_PX), np.nan)[..., None]
            origins[..., axis] += share * rays.origins_m
            directions[..., axis] += share * rays.directions
    return RayJacobians(origins, directions)


def pixel_jacobians(system: OpticalSystem, pixels_px: ArrayLike, points_m: ArrayLike) -> Floats:
    """Derivatives (..., 2, 3) of the pixels of points (..., 3) with respect to the points.

    Points are in the sensor's optical frame, their pixels (..., 2) from `pixel_from_point`.
    """
    rays, by_pixel = system.rays(pixels_px), ray_jacobians(system, pixels_px)
    away = as_directions(points_m) - rays.origins_m
    lengths_m = np.einsum("...j,...j->...", away, rays.directions)[..., None, None]
    across = across_bases(rays.directions)
    moved = np.einsum("...ji,...jk->...ik", across, by_pixel.origins_m)
    moved += lengths_m * np.einsum("...ji,...jk->...ik", across, by_pixel.directions)
    # perpendicular to the ray, the point moves with the pixel: a 2 × 2 system, by Cramer's rule
    swapped = np.stack(
        (
            np.stack((moved[..., 1, 1], -moved[..., 0, 1]), axis=-1),
            np.stack((-moved[..., 1, 0], moved[..., 0, 0]), axis=-1),
        ),
        axis=-2,
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = swapped / _determinants(moved)[..., None, None]
    return np.einsum("...ij,...kj->...ik", inverse, across)


def caustic_points(system: OpticalSystem, pixels_px: ArrayLike) -> Floats:
    """Points (..., 2, 3) where each pixel's ray touches the two sheets of the caustic.

    NaN where it touches no sheet, or only at infinity.
    """
    rays = system.rays(pixels_px)
    by_pixel = ray_jacobians(system, pixels_px)
    frame = across_bases(rays.directions)
    o, d = (np.einsum("...ji,...jk->...ik", frame, part) for part in by_pixel)
    square, constant = _determinants(d), _determinants(o)
    linear = (
        o[..., 0, 0] * d[..., 1, 1]
        + d[..., 0, 0] * o[..., 1, 1]
        - o[..., 0, 1] * d[..., 1, 0]
        - d[..., 0, 1] * o[..., 1, 0]
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        # rounding may leave a double root with none
        root = np.sqrt(np.maximum(linear**2 - 4.0 * square * constant, 0.0))
        lengths = np.stack(((-linear - root) / (2.0 * square), (-linear + root) / (2.0 * square)))
    lengths = np.moveaxis(np.where(np.isfinite(lengths), lengths, np.nan), 0, -1)
    origins_m = np.where(rays.valid[..., None], rays.origins_m, np.nan)
    return origins_m[..., None, :] + lengths[..., None] * rays.directions[..., None, :]


def _determinants(matrices: Floats) -> Floats:
    """Determinants (...,) of matrices (..., 2, 2)."""
    return matrices[..., 0, 0] * matrices[..., 1, 1] - matrices[..., 0, 1] * matrices[..., 1, 0]


# Lateral chromatic aberration: red-blue offset of distant points, in pixels.


def lateral_color_px(system: OpticalSystem) -> Floats:
    """Distances (n,) in pixels between the R and B images of points at infinity.

    The points are spread evenly over the image. The result is empty for systems of mirrors alone,
    which do not refract; points that are not seen in both colors are omitted.

    Raises:
        OpticsError: no pixel sees anything.
    """
    if all(surface.is_mirror for surface in system.surfaces):
        return np.empty(0)
    directions = seen_rays(system).directions
    red = system.of_color("R").pixel_from_ray(directions)
    blue = system.of_color("B").pixel_from_ray(directions)
    apart: Floats = np.linalg.norm(red.positions_px - blue.positions_px, axis=1)
    return apart[red.valid & blue.valid]


# Central views of optical systems: approximations with one viewpoint, and their error.


DISTANCES_M = (0.3, 1.0, 5.0)  # distances of points for which errors are reported


@dataclass(frozen=True, eq=False)
class CentralView:
    """Central approximation of an optical system, as if its rays met in one point.

    It is exact for points at one distance from the viewpoint. Its optical frame has the sensor's
    axes, but its origin is the viewpoint.

    Raises:
        OpticsError: the distance is not positive, or the system sees nothing.
    """

    system: NonCentralCamera  # optical system
    # distance at which the view is exact; infinite: only directions count
    distance_m: float = math.inf
    # (3, 3) orthogonal view_from_optical; a reflection if files store a mirrored image
    axes: Floats = field(default_factory=lambda: np.eye(3))

    model_name = "central view of optics"
    domain_limit_rad = None

    def __post_init__(self) -> None:
        if not self.distance_m > 0.0:
            raise OpticsError(f"distance_m: expected more than 0, got {self.distance_m:g}")
        assert len(self.seen_rays.pixels_px)  # raises if the system sees nothing

    def __repr__(self) -> str:
        return short_repr(self, repr(self.system), f"right at {self.distance_m:g} m")

    @property
    def width_px(self) -> int:
        """Image width."""
        return self.system.width_px

    @property
    def height_px(self) -> int:
        """Image height."""
        return self.system.height_px

    @property
    def principal_point_px(self) -> tuple[float, float]:
        """Principal point (u, v) of the system's camera."""
        return self.system.principal_point_px

    @property
    def rig_from_optical(self) -> Floats:
        """Orientation (3, 3) in a level rig."""
        return self.system.rig_from_optical @ self.axes.T

    @cached_property
    def seen_rays(self) -> SeenRays:
        """Rays spread evenly over the image, in the sensor's optical frame."""
        return seen_rays(self.system)

    @cached_property
    def viewpoint_m(self) -> Floats:
        """Point (3,) nearest to all rays, in the sensor's optical frame."""
        return common_point(self.seen_rays.origins_m, self.seen_rays.directions)

    def frame_from_view(self, frame_from_optical: Floats) -> Floats:
        """Pose (4, 4) of the view, from the pose of the sensor's optical frame."""
        pose = frame_from_optical.copy()
        pose[:3, 3] += frame_from_optical[:3, :3] @ self.viewpoint_m
        pose[:3, :3] = frame_from_optical[:3, :3] @ self.axes.T
        return pose

    def scaled(self, scale: float) -> CentralView:
        """The same view in an image `scale` times as large; sizes are rounded."""
        return dataclasses.replace(self, system=self.system.scaled(scale))

    def ray_from_pixel(self, pixels_px: ArrayLike) -> Rays:
        """Rays of pixels (..., 2) from the viewpoint."""
        rays = self.system.ray_from_pixel(pixels_px)
        origins_m = np.zeros(3) if rays.origins_m is None else rays.origins_m
        directions, meets = directions_at(
            origins_m, rays.directions, self.viewpoint_m, self.distance_m
        )
        unit = directions / np.maximum(np.linalg.norm(directions, axis=-1, keepdims=True), 1e-300)
        return Rays(unit @ self.axes.T, rays.valid & meets)

    def pixel_from_ray(self, directions: ArrayLike) -> Pixels:
        """Pixels of directions (..., 3) from the viewpoint."""
        optical = as_directions(directions) @ self.axes
        if math.isinf(self.distance_m):
            return self.system.pixel_from_ray(optical)
        lengths = np.maximum(np.linalg.norm(optical, axis=-1, keepdims=True), 1e-300)
        return self.system.pixel_from_point(self.viewpoint_m + self.distance_m / lengths * optical)

    def errors(self, distances_m: Sequence[float] = DISTANCES_M) -> tuple[CentralError, ...]:
        """Errors of the view for points at given distances."""
        return central_errors(
            self.seen_rays,
            self.viewpoint_m,
            distances_m,
            lambda directions: self.pixel_from_ray(directions @ self.axes.T),
        )

    def caveat(self, distances_m: Sequence[float] = DISTANCES_M) -> str:
        """Approximation and its errors, as one line of text."""
        others = [distance_m for distance_m in distances_m if distance_m != self.distance_m]
        errors = ", ".join(map(str, self.errors(others)))
        exact = "infinity" if math.isinf(self.distance_m) else f"{self.distance_m:g} m"
        return (
            f"rays meet in no point: one is assumed, right for points at {exact}; off by up to "
            f"{errors} (99 % of the image)"
        )

    def uniforms(self) -> Uniforms:
        """Raise, because no shader traces these rays.

        Raises:
            OpticsError: always.
        """
        raise OpticsError("camera: a central view of optics has no shader")

    def parameters(self) -> CameraParameters:
        """Size and distance, for messages; they cannot be saved in a file."""
        return {"model": self.model_name, "width_px": self.width_px, "height_px": self.height_px}


# Best central calibration of an optical system, in the models of a calibration format.


_ORIENTATION_PIXELS = 500


def fit_central(
    system: OpticalSystem,
    format: str = "omnisim",
    model: str | None = None,
    *,
    right_at_m: float = math.inf,
    distances_m: Sequence[float] = DISTANCES_M,
    name: str = "camera",
    source: str = "optics",
) -> Calibration:
    """Fit a central camera to an optical system: the best model of a format.

    The viewpoint is the point nearest to all rays; the axes are fitted, too. Together they are the
    camera's pose in the frame "optics", which is the sensor's optical frame.

    Args:
        system: optical system, which may be non-central.
        format: name of the calibration format whose models are fitted.
        model: name of the only model to fit; None: the model with the smallest maximum residual.
        right_at_m: distance from the viewpoint at which the fit is made.
        distances_m: further distances for which residuals are reported, besides infinity.
        name: camera name.
        source: name of the system, for messages.

    Raises:
        CalibrationError: a format or model is unknown, or no model is close enough; states the
            reasons.
        OpticsError: a distance is not positive, or the system sees nothing.
    """
    check_distances(distances_m)
    form: Format[Any] = format_named(format)
    is_mirrored = _is_mirrored(system)
    view = CentralView(system, right_at_m, np.diag(FLIP_Z) if is_mirrored else np.eye(3))

    def fit_model(target: type[CentralCamera], fixed: Fixed) -> Fit[CentralCamera]:
        return fit_camera(view, target, fixed=fixed, rotated=True)

    target = model_named(model, form)
    fit: Fit[CentralCamera] = nearest_fit(view, form, f"{source}: {name}", target, fit_model, [])
    camera = MirroredCamera(fit.camera) if is_mirrored else fit.camera
    camera_from_optics = fit.rotation @ view.axes
    if is_mirrored:
        camera_from_optics = np.diag(FLIP_Z) @ camera_from_optics
    errors = central_errors(
        view.seen_rays,
        view.viewpoint_m,
        (math.inf, *distances_m),
        lambda directions: camera.pixel_from_ray(directions @ camera_from_optics.T),
    )
    residuals = dataclasses.replace(
        fit.residuals, source_model=system.model_name, at_distances=errors
    )
    optics_from_camera = np.eye(4)
    optics_from_camera[:3, :3] = camera_from_optics.T
    optics_from_camera[:3, 3] = view.viewpoint_m
    pose = NamedPose(OPTICS, name, optics_from_camera)
    off = ", ".join(map(str, residuals.at_distances))
    note = f"fitted to non-central optics: off by up to {off} (99 % of the image)"
    fitted = CalibratedCamera(name, camera, (pose,), residuals, (note,))
    return Calibration((fitted,), form.name, source)


def _is_mirrored(system: OpticalSystem) -> bool:
    """True if the image is mirrored: the turn from u to v is not that from right to down."""
    view = CentralView(system)
    pixels = view.seen_rays.pixels_px
    pixels = pixels[:: max(1, len(pixels) // _ORIENTATION_PIXELS)]
    columns = ray_jacobians(system, pixels).directions
    across = np.cross(columns[..., 0], columns[..., 1])
    senses = np.einsum("nj,nj->n", across, system.rays(pixels).directions)
    return bool(np.nanmedian(senses) < 0.0)
