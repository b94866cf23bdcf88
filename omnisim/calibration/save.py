"""Writing a calibration file: exactly where the format has the model, by the best fit elsewhere."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from omnisim.atomic_file import atomic_write, check_target
from omnisim.calibration.calibration import CalibratedCamera, Calibration, Residual
from omnisim.calibration.equivalents import equivalent
from omnisim.calibration.file_frame import (
    is_turned,
    lens_of,
    looks_back,
    optical_camera,
    theta_max_rad,
)
from omnisim.calibration.fit import Fit, fit_camera
from omnisim.calibration.formats import Format, Said
from omnisim.calibration.load import format_named, renamed
from omnisim.calibration.remarks import remark_of, with_remarks
from omnisim.cameras import CentralCamera, CylindricalCamera, EquirectangularCamera, MirroredCamera
from omnisim.cameras.domain import angles_from_axis, largest_theta_rad, optical_axis
from omnisim.errors import CalibrationError, OmnisimError, OutputError

PANORAMAS = (CylindricalCamera, EquirectangularCamera)
LEAST_COVERED = 0.95  # of the picture's pixels; a fit that shows fewer is another camera
FURTHEST_OFF = 0.02  # of the picture's shorter side; a fit further off is no calibration

GRID = 65
NEARLY_RAD = math.radians(5.0)  # a grid misses less


class Words(NamedTuple):
    """A camera in the words of a format."""

    said: Said
    mirrored: bool
    turned: bool
    limit_rad: float | None
    residual: Residual | None


def save_calibration(
    calibration: Calibration, path: str | Path, format: str, model: str | None = None
) -> Calibration:
    """Write a calibration file, and return what it says.

    Args:
        calibration: the cameras; a format for one camera takes no more.
        path: the file.
        format: name of the format, one of `FORMATS`.
        model: the model to write by, as omnisim calls it; by default one that is the same lens,
            or else the one whose largest residual is smallest.

    Raises:
        CalibrationError: the format cannot say one of the cameras, with the reason.
        OutputError: the file cannot be written.
    """
    path = Path(path)
    check_target(path)
    text, written = calibration_text(calibration, format, model)
    with atomic_write(path) as partial:
        try:
            partial.write_text(text, encoding="utf-8")
        except OSError as reason:
            raise OutputError(f"{path}: cannot be written: {reason.strerror}") from None
    return written


def calibration_text(
    calibration: Calibration, format: str, model: str | None = None
) -> tuple[str, Calibration]:
    """The text of a calibration file, and what it says.

    Raises:
        CalibrationError: the format cannot say one of the cameras, with the reason.
    """
    form = format_named(format)
    if len(calibration.cameras) > 1 and not form.several:
        raise CalibrationError(
            f"{calibration.source}: {len(calibration.cameras)} cameras, and a {form.name} file "
            "holds one: pass --camera-name with one of " + ", ".join(calibration.names)
        )
    names = [form.rename(at, name) for at, name in enumerate(calibration.names)]
    if len(set(names)) < len(names):
        names = [form.rename(at, "") for at in range(len(names))]
    cameras = renamed(calibration.cameras, names)
    words = [
        _with_doubts(in_words(camera, form, f"{calibration.source}: {name}", model), form)
        for camera, name in zip(cameras, calibration.names, strict=True)
    ]
    text = form.write([one.said for one in words])
    remarks = [
        remark_of(one.said.name, one.mirrored, one.turned, one.limit_rad, one.residual)
        for one in words
    ]
    written = tuple(
        CalibratedCamera(
            one.said.name,
            optical_camera(one.said.lens, one.mirrored, one.limit_rad, one.turned),
            one.said.poses,
            one.residual,
            one.said.notes,
            one.said.lens.model_name,
        )
        for one in words
    )
    return with_remarks(text, remarks, form), Calibration(written, form.name, calibration.source)


def in_words(camera: CalibratedCamera, form: Format, place: str, model: str | None = None) -> Words:
    """A camera as a format says it; `place` names file and camera in messages.

    Raises:
        CalibrationError: it cannot, with the reason.
    """
    if form.is_own and model in (None, camera.camera.model_name):
        said = Said(camera.name, camera.camera, camera.poses)
        return Words(said, False, False, None, camera.residual)
    kinds = _kinds(form, model)
    _check_cone(camera, form, place)
    mirrored, turned = looks_back(camera.camera), is_turned(camera.camera)
    lens = lens_of(camera.camera)
    reasons: list[str] = []
    for kind in kinds if lens is not None else ():
        same = equivalent(lens, kind)
        reason = form.refuse(same) if same is not None else None
        if same is not None and reason is None:
            said = Said(camera.name, same, camera.poses)
            limit = theta_max_rad(camera.camera)
            return Words(said, mirrored, turned, limit, camera.residual)
        if reason is not None and reason not in reasons:
            reasons.append(reason)
    if isinstance(camera.camera, PANORAMAS):
        raise CalibrationError(
            f"{place}: {form.name} has no panorama, and this one is {camera.camera.model_name}"
        )
    fit = _best_fit(camera, form, place, model, mirrored, reasons)
    residual = Residual(fit.rms_px, fit.max_px, fit.theta_max_rad, camera.camera.model_name)
    said = Said(camera.name, fit.camera, camera.poses)
    limit = theta_max_rad(fit.camera) or theta_max_rad(camera.camera)
    return Words(said, mirrored, turned, limit, residual)


def _with_doubts(words: Words, form: Format) -> Words:
    """The words, and a note where others would read them differently."""
    if not form.doubt or isinstance(words.said.lens, EquirectangularCamera):
        return words
    widest = _widest_rad(words.said.lens)
    if widest <= form.doubtful_past_rad:
        return words
    note = f"sees {math.degrees(widest):.1f}° from its axis: {form.doubt}"
    said = dataclasses.replace(words.said, notes=(*words.said.notes, note))
    return words._replace(said=said)


def _kinds(form: Format, model: str | None) -> list[type[Any]]:
    kinds = [kind for kind in form.models if model in (None, kind.model_name)]
    if not kinds:
        raise CalibrationError(
            f"--model {model}: {form.name} has "
            + ", ".join(kind.model_name for kind in form.models)
        )
    return kinds


def _check_cone(camera: CalibratedCamera, form: Format, place: str) -> None:
    if form.widest_rad is None:
        return
    widest = _widest_rad(camera.camera)
    if form.widest_rad > widest > form.widest_rad - NEARLY_RAD:
        widest = largest_theta_rad(camera.camera)  # to the last bit, which takes its time
    if widest >= form.widest_rad:
        raise CalibrationError(
            f"{place}: sees {math.degrees(widest):.1f}° from its axis: {form.name} says "
            f"nothing at {math.degrees(form.widest_rad):g}° and past it"
        )


def _widest_rad(camera: CentralCamera) -> float:
    """Largest angle from the axis that a grid over the picture, border included, shows."""
    steps = np.linspace(0.0, 1.0, GRID)
    u, v = np.meshgrid(steps * camera.width_px - 0.5, steps * camera.height_px - 0.5)
    rays = camera.ray_from_pixel(np.stack((u, v), axis=-1))
    axis = optical_axis(camera)
    return float(angles_from_axis(rays.directions[rays.valid], axis).max(initial=0.0))


def _best_fit(
    camera: CalibratedCamera,
    form: Format,
    place: str,
    model: str | None,
    mirrored: bool,
    reasons: list[str],
) -> Fit:
    """The fit whose largest residual is smallest, of those that show the whole picture."""
    # a mirrored lens is fitted as the lens that it is
    source = camera.camera
    if isinstance(source, MirroredCamera):
        source, mirrored = source.lens, False
    fits, side = [], min(camera.camera.width_px, camera.camera.height_px)
    middle = 0.5 * (camera.camera.width_px - 1), 0.5 * (camera.camera.height_px - 1)
    centred = {"principal_point_px": middle} if form.centred else {}
    for kind, fixed in form.fits:
        if model not in (None, kind.model_name):
            continue
        try:
            with np.errstate(all="ignore"):  # a step too far of a fit is taken back
                fit = fit_camera(source, kind, mirrored=mirrored, fixed={**fixed, **centred})
        except OmnisimError as reason:
            reasons.append(str(reason).removeprefix("camera: "))
            continue
        reason = form.refuse(fit.camera)
        if reason is None:
            fits.append(fit)
        elif reason not in reasons:
            reasons.append(reason)
    if not fits:
        raise CalibrationError(
            f"{place}: {form.name} cannot say model {camera.camera.model_name!r}: "
            + ("; ".join(dict.fromkeys(reasons)) or "none of its models is one")
        )
    best = min(fits, key=lambda fit: (fit.covered < LEAST_COVERED, fit.max_px))
    if best.covered < LEAST_COVERED or best.max_px > FURTHEST_OFF * side:
        raise CalibrationError(
            f"{place}: {form.name} cannot say model {camera.camera.model_name!r}: the nearest, "
            f"{best.camera.model_name!r}, is up to {best.max_px:.3g} px off and shows "
            f"{100.0 * best.covered:.1f} % of its pixels" + "".join(f"; {one}" for one in reasons)
        )
    return best
