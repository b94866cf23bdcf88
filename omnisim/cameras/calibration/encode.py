"""Text of calibration files: exact where the format has the model, else the best fit.

If the format cannot hold a camera, a `CalibrationError` states the reasons.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any, Generic, NamedTuple

import numpy as np

from omnisim.cameras import (
    CAMERA_MODELS,
    CentralCamera,
    CylindricalCamera,
    EquirectangularCamera,
    MirroredCamera,
)
from omnisim.cameras.calibration.calibrated_camera import CalibratedCamera, NamedPose, Residuals
from omnisim.cameras.calibration.equivalents import equivalent
from omnisim.cameras.calibration.fit import Fit, fit_camera
from omnisim.cameras.calibration.formats.format import Fixed, Format, LensT, ParsedCamera
from omnisim.cameras.calibration.metadata import (
    CameraMetadata,
    camera_from_lens,
    camera_metadata,
    embed_metadata,
    is_catadioptric,
    lens_of,
)
from omnisim.cameras.camera import without_prefix
from omnisim.cameras.models.field_of_view import angles_from_axis, largest_theta_rad, optical_axis
from omnisim.core.errors import CalibrationError, OmnisimError

MIN_COVERED = 0.95  # minimum share of the image's pixels that a fit covers
MAX_RESIDUAL = 0.02  # maximum residual of a fit, as a share of the image's shorter side
GRID = 65
GRID_MARGIN_RAD = math.radians(5.0)  # bound on the angle that a grid misses


class EncodedCamera(NamedTuple, Generic[LensT]):
    """A camera in a model of a format, its metadata, and the residuals if it was fitted."""

    lens: LensT
    metadata: CameraMetadata
    residuals: Residuals | None


def encode_cameras(
    cameras: Sequence[CalibratedCamera], form: Format[LensT], model: str | None, source: str
) -> tuple[str, tuple[CalibratedCamera, ...]]:
    """Text of a file, and the cameras as written; `source` names their file in messages.

    A model's name makes it the one to write, in place of the nearest.
    """
    # names that the format allows, also in the poses
    names = [form.camera_name(index, camera.name) for index, camera in enumerate(cameras)]
    if len(set(names)) < len(names):
        names = [form.camera_name(index, "") for index in range(len(names))]
    new = {camera.name: name for camera, name in zip(cameras, names, strict=True)}
    parsed, metadata, written = [], [], []
    for camera in cameras:
        poses = tuple(
            NamedPose(new.get(pose.target, pose.target), new.get(pose.source, pose.source),
                      pose.target_from_source)
            for pose in camera.poses
        )  # fmt: skip
        named = dataclasses.replace(camera, name=new[camera.name], poses=poses)
        encoded = encode(named, form, f"{source}: {camera.name}", model)
        parsed.append(ParsedCamera(named.name, encoded.lens, named.poses, named.time_shift_s))
        metadata.append(encoded.metadata.with_poses(named.poses))
        kept = camera_from_lens(encoded.lens, encoded.metadata)
        notes, model_name = caveats(encoded.lens, form), encoded.lens.model_name
        named = dataclasses.replace(named, camera=kept, residuals=encoded.residuals)
        written.append(dataclasses.replace(named, notes=notes, file_model=model_name))
    text = embed_metadata(form.encode(parsed), metadata, form.metadata_place)
    return text, tuple(written)


def encode(
    camera: CalibratedCamera, form: Format[LensT], place: str, model: str | None = None
) -> EncodedCamera[LensT]:
    """Encode a camera in a model of a format; `place` names file and camera in messages."""
    source = camera.camera
    reasons: list[str] = []
    exact = _encode_exactly(camera, form, place, model, reasons)
    if exact is not None:
        return exact
    target = model_named(model, form)
    if isinstance(source, CylindricalCamera | EquirectangularCamera):
        raise CalibrationError(
            f"{place}: {form.name} has no panorama model, got {source.model_name}"
        )
    # a mirrored lens is fitted as the lens itself
    lens = source.lens if isinstance(source, MirroredCamera) else source
    mirrored = lens is source and is_catadioptric(source)

    def fit_model(model: type[LensT], fixed: Fixed) -> Fit[LensT]:
        return fit_camera(lens, model, mirrored=mirrored, fixed=fixed)

    fit = nearest_fit(source, form, place, target, fit_model, reasons)
    limit_rad = fit.camera.domain_limit_rad or source.domain_limit_rad
    # keeps the source's own error as a central approximation of non-central optics
    at_distances = () if camera.residuals is None else camera.residuals.at_distances
    fitted = dataclasses.replace(
        fit.residuals, source_model=source.model_name, at_distances=at_distances
    )
    metadata = camera_metadata(camera.name, source, limit_rad, fitted)
    return EncodedCamera(fit.camera, metadata, fitted)


def encode_exactly(
    camera: CalibratedCamera, form: Format[LensT], place: str
) -> EncodedCamera[LensT] | None:
    """Encode a camera in a format's equivalent model; None: no such model, or a smaller field."""
    try:
        return _encode_exactly(camera, form, place, None, [])
    except CalibrationError:  # the format's angle limit is inside the field of view
        return None


def _encode_exactly(
    camera: CalibratedCamera, form: Format[LensT], place: str, model: str | None, reasons: list[str]
) -> EncodedCamera[LensT] | None:
    """Encode the lens exactly, or return None and add the reasons to `reasons`.

    Refuses a camera whose field of view reaches beyond the format's angle limit.
    """
    source = camera.camera
    native = form.native(source)
    if native is not None and model in (None, source.model_name):
        metadata = camera_metadata(camera.name, None, None, camera.residuals)
        return EncodedCamera(native, metadata, camera.residuals)
    target = model_named(model, form)
    _check_cone(source, form, place)
    lens = lens_of(source)
    for kind in form.models:
        same = equivalent(lens, kind) if lens is not None and target in (None, kind) else None
        reason = None if same is None else form.unsupported(same)
        if same is not None and reason is None:
            limit_rad, residuals = source.domain_limit_rad, camera.residuals
            metadata = camera_metadata(camera.name, source, limit_rad, residuals)
            return EncodedCamera(same, metadata, residuals)
        if reason is not None and reason not in reasons:
            reasons.append(reason)
    return None


def model_named(model: str | None, form: Format[Any]) -> type[CentralCamera] | None:
    """Model with the given name in a format; None for None."""
    target = None if model is None else CAMERA_MODELS.get(model)
    if model is not None and target not in form.models:
        names: dict[type[CentralCamera], str] = {kind: name for name, kind in CAMERA_MODELS.items()}
        known = ", ".join(names[kind] for kind in form.models)
        raise CalibrationError(f"--model {model}: {form.name} has none: expected one of {known}")
    return target


def caveats(lens: CentralCamera, form: Format[Any]) -> tuple[str, ...]:
    """Notes about other tools that interpret the file differently."""
    notes = form.lens_caveats(lens)
    if not form.caveat or isinstance(lens, EquirectangularCamera):
        return notes
    widest = _widest_rad(lens)
    if widest <= form.caveat_theta_rad:
        return notes
    return (*notes, f"sees up to {math.degrees(widest):.1f}° from its axis: {form.caveat}")


def _check_cone(camera: CentralCamera, form: Format[Any], place: str) -> None:
    if math.isinf(form.max_theta_rad):
        return
    widest = _widest_rad(camera)
    if form.max_theta_rad > widest > form.max_theta_rad - GRID_MARGIN_RAD:
        widest = largest_theta_rad(camera)  # to the last bit, which is slow
    if widest >= form.max_theta_rad:
        raise CalibrationError(
            f"{place}: sees up to {math.degrees(widest):.1f}° from its axis: {form.name} ends "
            f"before {math.degrees(form.max_theta_rad):g}°"
        )


def _widest_rad(camera: CentralCamera) -> float:
    """Largest angle from the axis on a grid over the image, border included."""
    steps = np.linspace(0.0, 1.0, GRID)
    u, v = np.meshgrid(steps * camera.width_px - 0.5, steps * camera.height_px - 0.5)
    rays = camera.ray_from_pixel(np.stack((u, v), axis=-1))
    axis = optical_axis(camera)
    return float(angles_from_axis(rays.directions[rays.valid], axis).max(initial=0.0))


def nearest_fit(
    camera: CentralCamera,
    form: Format[LensT],
    place: str,
    model: type[CentralCamera] | None,
    fit_model: Callable[[type[LensT], Fixed], Fit[LensT]],
    reasons: list[str],
) -> Fit[LensT]:
    """Fit with the smallest maximum residual among a format's models, or of the only `model`.

    `fit_model` fits a model, given the attributes that the format fixes; `place` is file and
    camera, for messages. The reasons for rejected models are added to `reasons`.
    """
    middle = 0.5 * (camera.width_px - 1), 0.5 * (camera.height_px - 1)
    centered = {"principal_point_px": middle} if form.centered else {}
    fits = []
    for target, fixed in form.fits:
        if model not in (None, target):
            continue
        try:
            with np.errstate(all="ignore"):  # the fit takes back a step that is too long
                fit = fit_model(target, {**fixed, **centered})
        except OmnisimError as error:
            reasons.append(without_prefix(error))
            continue
        reason = form.unsupported(fit.camera)
        if reason is None:
            fits.append(fit)
        elif reason not in reasons:
            reasons.append(reason)
    failure = f"{place}: {form.name} cannot represent model {camera.model_name!r}"
    if not fits:
        reason = "; ".join(dict.fromkeys(reasons)) or "it has no such model"
        raise CalibrationError(f"{failure}: {reason}")
    best = min(fits, key=lambda fit: (fit.covered < MIN_COVERED, fit.residuals.max_px))
    side = min(camera.width_px, camera.height_px)
    if best.covered < MIN_COVERED or best.residuals.max_px > MAX_RESIDUAL * side:
        raise CalibrationError(
            f"{failure}: the nearest, {best.camera.model_name!r}, is up to "
            f"{best.residuals.max_px:.3g} px off and shows {100.0 * best.covered:.1f} % of its "
            "pixels" + "".join(f"; {reason}" for reason in reasons)
        )
    return best
