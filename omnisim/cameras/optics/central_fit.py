"""Best central calibration of an optical system, in the models of a calibration format."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from omnisim.cameras import CentralCamera, MirroredCamera
from omnisim.cameras.calibration import CalibratedCamera, Calibration, NamedPose
from omnisim.cameras.calibration.calibrated_camera import OPTICS, Residuals
from omnisim.cameras.calibration.calibration_formats import format_named
from omnisim.cameras.calibration.encode import model_named, nearest_fit
from omnisim.cameras.calibration.fit import Fit, fit_camera
from omnisim.cameras.calibration.formats.format import Fixed, Format
from omnisim.cameras.optics.caustic import ray_jacobians
from omnisim.cameras.optics.central_view import DISTANCES_M, CentralView
from omnisim.cameras.optics.centrality import central_errors, check_distances
from omnisim.cameras.optics.system import OpticalSystem
from omnisim.core.coordinate_frames import FLIP_Z

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
