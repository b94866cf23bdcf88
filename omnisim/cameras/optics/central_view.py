"""Central views of optical systems: approximations with one viewpoint, and their error."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from omnisim.cameras import CentralCamera, MirroredCamera, NonCentralCamera, Pixels, Rays
from omnisim.cameras.calibration import CalibratedCamera, Calibration, NamedPose
from omnisim.cameras.calibration.calibrated_camera import OPTICS, Residuals
from omnisim.cameras.calibration.calibration_formats import format_named
from omnisim.cameras.calibration.encode import model_named, nearest_fit
from omnisim.cameras.calibration.fit import Fit, fit_camera
from omnisim.cameras.calibration.formats.format import Fixed, Format
from omnisim.cameras.camera import CameraParameters, Uniforms, as_directions
from omnisim.cameras.central_error import CentralError
from omnisim.cameras.optics.centrality import (
    SeenRays,
    central_errors,
    check_distances,
    common_point,
    directions_at,
    ray_jacobians,
    seen_rays,
)
from omnisim.cameras.optics.system import OpticalSystem
from omnisim.core.arrays import Floats
from omnisim.core.coordinate_frames import FLIP_Z
from omnisim.core.errors import OpticsError
from omnisim.core.short_repr import short_repr

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
    fitted = CalibratedCamera(name, camera, (pose,), residuals, (_note(residuals),))
    return Calibration((fitted,), form.name, source)


def _note(residuals: Residuals) -> str:
    """Residuals of a fit in one line."""
    errors = ", ".join(map(str, residuals.at_distances))
    return f"fitted to non-central optics: off by up to {errors} (99 % of the image)"


def _is_mirrored(system: OpticalSystem) -> bool:
    """True if the image is mirrored: the turn from u to v is not that from right to down."""
    view = CentralView(system)
    pixels = view.seen_rays.pixels_px
    pixels = pixels[:: max(1, len(pixels) // _ORIENTATION_PIXELS)]
    columns = ray_jacobians(system, pixels).directions
    across = np.cross(columns[..., 0], columns[..., 1])
    senses = np.einsum("nj,nj->n", across, system.rays(pixels).directions)
    return bool(np.nanmedian(senses) < 0.0)
