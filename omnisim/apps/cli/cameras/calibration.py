"""`omnisim calibration`, and calibrations as inputs of other commands."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

from omnisim.apps.cli.cameras.requests import ConvertRequest, SearchRequest, ShowRequest
from omnisim.apps.cli.console import out, pluralize, print_note, table
from omnisim.apps.cli.options import refuse_given
from omnisim.cameras import CAMERA_MODELS, CentralCamera, NonCentralCamera
from omnisim.cameras import calibration as calibrations
from omnisim.cameras.calibration.calibrated_camera import OPTICS, CentralError
from omnisim.cameras.calibration.calibration_formats import format_named
from omnisim.cameras.calibration.documents import read_text
from omnisim.cameras.calibration.metadata import is_catadioptric
from omnisim.cameras.models.field_of_view import field_of_view, is_fold
from omnisim.core.errors import CalibrationError, OmnisimError
from omnisim.core.files.atomic_file import check_distinct, check_target
from omnisim.core.files.image_files import EIGHT_BIT_SUFFIXES, FLOAT_SUFFIXES, read_image
from omnisim.core.short_repr import number_text, point_text
from omnisim.rendering.camera.captured_image import camera_of_parameters
from omnisim.rendering.camera.omnicamera import OmniCamera

SHOWN_POSES = 8
_SCENES = (".glb", ".gltf", ".usd", ".usda", ".usdc", ".usdz", ".mjcf")


def list_formats() -> None:
    """Print a table of the calibration formats."""
    shown = table("format", "what", "file", "cameras", "models stored exactly")
    for form in calibrations.FORMATS.values():
        is_general = len(form.models) == len(CAMERA_MODELS)
        models = "all" if is_general else ", ".join(model.model_name for model in form.models)
        several = "several" if form.several else "one"
        shown.add_row(form.name, form.title, f"*{form.suffix}", several, models)
    out.print(shown)
    out.print("All are read and written. Other models are fitted, and the file states the error.")


def search(request: SearchRequest) -> None:
    """Print the entries of the catalog that have all words."""
    from omnisim.cameras.catalog import lens_catalog  # reads the catalog

    words = " ".join(request.words)
    if request.limit < 0:
        raise CalibrationError(f"--limit: expected 0 or more, got {request.limit}")
    found = lens_catalog.search(words)
    if not found:
        raise CalibrationError(f"WORD: no camera of the catalog has all of: {words}")
    shown = table("camera", "field of view", ">readout", ">error")
    shown.columns[0].overflow = "fold"  # a name that is cut off is of no use
    count = request.limit or len(found)
    for entry in found[:count]:
        seen = field_of_view(entry.lens)
        sides = (math.degrees(side) for side in (seen.horizontal_rad, seen.vertical_rad))
        readout = "–" if entry.readout_s is None else f"{1e3 * entry.readout_s:.3g} ms"
        view = " × ".join(f"{side:.0f}°" for side in sides)
        folds = f", {100.0 * seen.covered:.0f} % valid" if seen.covered < 1.0 else ""
        error = f"{number_text(entry.error_px, 2)} px"
        shown.add_row(f"catalog:{entry.name}", view + folds, readout, error)
    out.print(shown)
    if len(found) > count:
        out.print(f"{len(found) - count} more; --limit 0 lists all")


def convert(request: ConvertRequest) -> None:
    """Write a calibration in another format and print its residuals."""
    form = format_named(request.to)
    calibrations.check_calibration_suffix(request.output, form.name)
    check_target(request.output)
    source, more_distances_m = _source(request)
    check_distinct({"the output": request.output}, {"the file to convert": source})
    if request.optics is not None:
        from omnisim.cameras.optics.system_file import read_optics_file  # seldom needed

        _convert_optics(request, read_optics_file(request.optics), source, more_distances_m)
        return
    model = None if request.format is not None else _own_camera(source)
    if isinstance(model, NonCentralCamera):
        _convert_optics(request, model, source, more_distances_m)
        return
    reason = f"expected optics, got {source}"
    refuse_given(request, reason, "at_distance", "right_at", error=CalibrationError)
    read = read_calibration(source, request.camera_name, request.format, request.mirrored)
    if not form.several:
        read = select_camera(read, request.camera_name)
    written = calibrations.save_calibration(read, request.output, request.to, request.model)
    out.print(f"{request.output}: {calibrations.FORMATS[request.to].title}")
    for before, after in zip(read.cameras, written.cameras, strict=True):
        out.print(f"  {_conversion(before, after)}")
        for note in after.notes:
            print_note(f"{after.name}: {note}")


def _source(request: ConvertRequest) -> tuple[Path, list[float]]:
    """Input file and further distances; with --optics, FILE may be the first distance."""
    more_m = list(request.more_distances or ())
    if request.optics is None:
        if request.source is None:
            raise CalibrationError("FILE: missing: expected a calibration file, or --optics FILE")
        if more_m and request.at_distance is None:
            raise CalibrationError(f"METERS: expected --at-distance before them, got {more_m[0]:g}")
        return Path(request.source), more_m
    if request.source is not None:
        try:
            more_m.insert(0, float(request.source))
        except ValueError:
            raise CalibrationError("FILE, --optics: expected one of them, got both") from None
    return request.optics, more_m


def _convert_optics(
    request: ConvertRequest, system: NonCentralCamera, source: Path, more_distances_m: list[float]
) -> None:
    from omnisim.cameras.optics import OpticalSystem
    from omnisim.cameras.optics.centrality import DISTANCES_M, fit_central

    assert isinstance(system, OpticalSystem)
    reason, names = "expected a calibration file, got optics", ("camera_name", "format", "mirrored")
    refuse_given(request, reason, *names, error=CalibrationError)
    fitted = fit_central(
        system,
        request.to,
        request.model,
        right_at_m=math.inf if request.right_at is None else request.right_at,
        distances_m=(*(request.at_distance or ()), *more_distances_m) or DISTANCES_M,
        source=str(source),
    )
    (written,) = calibrations.save_calibration(fitted, request.output, request.to).cameras
    out.print(f"{request.output}: {calibrations.FORMATS[request.to].title}")
    pose, residuals = calibrations.find_pose(written.poses, OPTICS, written.name), written.residuals
    assert pose is not None
    assert residuals is not None
    out.print(f"  {_conversion(dataclasses.replace(written, residuals=None), written)}")
    x, y, z = pose[:3, 3]
    tilt_deg = math.degrees(math.acos(min(abs(float(pose[2, 2])), 1.0)))
    out.print(
        f"  viewpoint ({x:z.5f}, {y:z.5f}, {z:z.5f}) m in the optics' frame, axis tilted by "
        f"{tilt_deg:.2f}°; error, by the distance of points"
    )
    out.print(error_table(residuals.at_distances))
    for note in written.notes:
        print_note(f"{written.name}: {note}")


def error_table(errors: Sequence[CentralError]) -> Table:
    """Table of the errors of a central model, with a row per distance."""
    shown = table("at", ">mean", ">median", ">99 %", ">maximum", ">not visible")
    for error in errors:
        values = error.mean_px, error.median_px, error.percentile_99_px, error.max_px
        pixels = ["–" if math.isnan(value) else f"{number_text(value, 3)} px" for value in values]
        shown.add_row(error.at, *pixels, f"{100.0 * error.left_out:.1f} %")
    return shown


def show(request: ShowRequest) -> None:
    """Print the cameras of a calibration file."""
    read = read_calibration(request.source, request.camera_name, request.format, request.mirrored)
    out.print(headline(read))
    for camera in read.cameras:
        shown = Table(box=None, pad_edge=False, show_header=False)
        shown.add_column(style="bold", no_wrap=True)
        for row in _rows(camera):
            shown.add_row(*row)
        out.print()
        out.print(camera.name, style="bold")
        out.print(shown)


def headline(read: calibrations.Calibration) -> str:
    """File, format, number of cameras, and the tool that the file is from."""
    tool = f", from {read.tool}" if read.tool else ""
    return f"{read.source}: {read.format}, {pluralize(len(read.cameras), 'camera')}{tool}"


def read_calibration(
    path: Path, camera_name: str | None, format: str | None, mirrored: bool | None
) -> calibrations.Calibration:
    """Read a calibration from a calibration file, a sensor file or an image."""
    is_scene = path.suffix.lower() in _SCENES and format is None
    if is_scene and path.suffix.lower() == ".usda":  # lenses alone need no usd-core
        is_scene = not format_named("isaac").looks_like(read_text(path))
    if is_scene:
        from omnisim.scene import read_scene  # calibrations seldom are scenes

        scene = read_scene(path)
        for notice in scene.notices:
            print_note(notice)
        cameras = [
            camera
            for mounted in scene.cameras
            if mounted.lens is not None
            for camera in calibrations.calibration_of(mounted.lens, mounted.name).cameras
        ]
        if not cameras:
            raise CalibrationError(f"{path}: expected a camera with a lens, got a scene with none")
        return calibrations.Calibration(tuple(cameras), "scene", str(path))
    camera = None if format is not None else _own_camera(path)
    if camera is not None:
        if camera_name is not None:
            raise CalibrationError(
                f"--camera-name: expected a calibration file, got {path}, whose camera has no name"
            )
        if isinstance(camera, NonCentralCamera):
            hint = "`omnisim calibration convert` fits one to it"
            raise CalibrationError(f"{path}: expected a central camera, got optics: {hint}")
        return calibrations.Calibration(
            calibrations.calibration_of(camera, "camera").cameras,
            "omnisim",
            str(path),
            (),
            "omnisim",
        )
    return calibrations.load_calibration(path, format, camera_name, mirrored)


def select_camera(
    calibration: calibrations.Calibration, name: str | None
) -> calibrations.Calibration:
    """Reduce a calibration to one camera: the named one, or the first with a note."""
    if name is None and len(calibration.cameras) > 1:
        names = ", ".join(calibration.names)
        print_note(
            f"{calibration.source}: the first of {len(calibration.cameras)} cameras, "
            f"{calibration.names[0]}, is used; --camera-name selects another of {names}"
        )
    return calibration.only(name or calibration.names[0])


def _own_camera(path: Path) -> CentralCamera | None:
    """Camera of a sensor file or an image, recognized by its suffix; None for other files."""
    suffix = path.suffix.lower()
    if suffix == ".toml":
        return OmniCamera.from_file(path).model
    if suffix not in EIGHT_BIT_SUFFIXES + FLOAT_SUFFIXES:
        return None
    _, metadata = read_image(path)
    parameters = None if metadata is None else metadata.get("camera")
    if not isinstance(parameters, dict):
        if suffix == ".exr":  # it may be a table of rays
            return None
        raise CalibrationError(f"{path}: expected an image by omnisim, got one without its camera")
    try:
        return camera_of_parameters(parameters)
    except OmnisimError as reason:
        raise CalibrationError(f"{path}: {reason}") from None


def _conversion(before: calibrations.CalibratedCamera, after: calibrations.CalibratedCamera) -> str:
    """Summarize a camera's conversion: name, model, residual."""
    name = after.name if before.name == after.name else f"{after.name} (was {before.name})"
    is_mirror = after.mirrored or (
        after.file_model != after.camera.model_name and is_catadioptric(after.camera)
    )
    model = f"{after.file_model}{' in a mirrored frame' if is_mirror else ''}"
    fit = after.residuals
    if fit is None or fit is before.residuals:
        return f"{name}: {model}, with identical rays"
    return (
        f"{name}: {model}, fitted to {fit.source_model}: "
        f"RMS {number_text(fit.rms_px, 3)} px, at most {number_text(fit.max_px, 3)} px, "
        f"within {math.degrees(fit.theta_max_rad):.1f}° of the axis"
    )


def _rows(calibrated: calibrations.CalibratedCamera) -> list[tuple[str, str]]:
    """Table rows of a camera's model, parameters and domain, and of its poses and fit."""
    camera = calibrated.camera
    parameters = camera.parameters()
    model = str(parameters.pop("model"))
    rows = [("model", model)]
    if calibrated.file_model not in (None, model):
        rows.append(("in the file", f"{calibrated.file_model}"))
    width, height = parameters.pop("width_px"), parameters.pop("height_px")
    rows.append(("image", f"{width} × {height} px"))
    seen = field_of_view(camera)
    parameters.pop("theta_max_deg", None)  # below: the model's limit
    rows += [_parameter_row(key, value) for key, value in parameters.items()]
    axis = ", from −z, as it looks into a mirror" if seen.axis[2] < 0.0 else ""
    across, upright = math.degrees(seen.horizontal_rad), math.degrees(seen.vertical_rad)
    limit_rad = seen.theta_limit_rad
    folds = ", where it folds" if is_fold(camera, limit_rad) else ""
    limit = f"θ = {math.degrees(limit_rad):.2f}°{folds}"
    rows += [
        ("field of view", f"{across:.1f}° × {upright:.1f}°"),
        ("largest θ", f"{math.degrees(seen.theta_max_rad):.2f}° in the image{axis}"),
        ("model's limit", "none: all directions" if limit_rad >= math.pi else limit),
        ("valid pixels", f"{100.0 * seen.covered:.1f} %"),
    ]
    for pose in calibrated.poses[:SHOWN_POSES]:
        place = point_text(pose.target_from_source[:3, 3])
        rows.append((f"{pose.target}_from_{pose.source}", f"at {place} m"))
    if len(calibrated.poses) > SHOWN_POSES:
        rows.append(("…", f"{len(calibrated.poses)} poses in total"))
    if (fit := calibrated.residuals) is not None:
        error = f"RMS {number_text(fit.rms_px, 3)} px, at most {number_text(fit.max_px, 3)} px"
        within = f"within {math.degrees(fit.theta_max_rad):.1f}°"
        rows.append(("fitted to", f"{fit.source_model}: {error} {within}"))
        rows += [
            (f"points at {each.at}", f"99 % within {number_text(each.percentile_99_px, 3)} px")
            for each in fit.at_distances
        ]
    return rows


def _parameter_row(key: str, value: object) -> tuple[str, str]:
    unit = " px" if key.endswith("_px") else "°" if key.endswith("_deg") else ""
    name = key.removesuffix("_px").removesuffix("_deg").replace("_", " ")
    if isinstance(value, bool):
        return name, str(value).lower()
    if isinstance(value, str):
        return name, value
    decimals = 9 if unit else 300  # a coefficient without a unit may be of any size
    values = value if isinstance(value, list | tuple) else (value,)
    return name, ", ".join(number_text(each, 10, decimals) for each in values) + unit
