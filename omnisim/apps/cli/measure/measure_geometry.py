"""`omnisim measure geometry`."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Sequence
from typing import Any

import numpy as np

from omnisim.apps.cli.console import out, pluralize, print_note, table, track
from omnisim.apps.cli.measure.measured_files import (
    check_outputs,
    check_size,
    sensor_tables,
    write_measured,
)
from omnisim.apps.cli.measure.requests import MeasureGeometryRequest
from omnisim.cameras.optics.system import OpticalSystem
from omnisim.cameras.optics.system_calibration import (
    BoardCorners,
    FreeParameters,
    read_corners,
    write_corners,
)
from omnisim.cameras.optics.system_file import OpticsTables, parse_optics, read_optics_tables
from omnisim.core.errors import MeasurementError, OpticsError
from omnisim.core.extras import is_installed, require_extra
from omnisim.measurement.geometry import (
    BoardView,
    MeasuredGeometry,
    RejectedImage,
    find_boards,
    measure_geometry,
    measure_optics,
    read_board,
)
from omnisim.measurement.geometry.board_detection import image_files
from omnisim.measurement.geometry.model_choice import CANDIDATES
from omnisim.rendering.camera.omnicamera import OmniCamera

_SHOWN_MODELS = 5
_MANY_PX = 0.3  # RMS error; sharp images of one camera and a firm board leave less
_CAMERAS = ("lens", "mirror", "optics")  # tables of a sensor file, one of which states the camera


def geometry(request: MeasureGeometryRequest) -> None:
    """Measure a camera's model, write a sensor file with it, and print model and residuals."""
    stem = request.output.stem
    corners = request.output.with_name(f"{stem}-corners.csv")
    plot = request.output.with_name(f"{stem}-residuals.png")
    check_outputs(request.output, request.sensor, corners=corners, plot=plot)
    for name in request.model or ():
        if name not in CANDIDATES:
            expected = f"expected one of {', '.join(CANDIDATES)}"
            raise MeasurementError(f"--model: {expected}, got {name!r}")
    optics = _read_optics(request)
    tables = sensor_tables(request.sensor)
    views, rejected, size_px = _views(request)
    if optics is None:
        models, is_flat = request.model or CANDIDATES, request.flat_board
        measured = measure_geometry(
            views, size_px, mirrored=request.mirrored, models=models, is_flat=is_flat
        )
    else:
        file, free, system = optics
        check_size(request.images, size_px, system, file.source)
        measured = measure_optics(file.table, free, views, file.source)
    rejected = [*rejected, *measured.rejected]
    boards = [BoardCorners(view.points_m, view.pixels_px) for view in measured.views]
    write_corners(corners, boards)
    if is_installed("matplotlib"):
        from omnisim.plots.measured_plots import residual_figure
        from omnisim.plots.style import write_plot

        pixels = np.concatenate([view.pixels_px for view in measured.views])
        title = f"{measured.model}: {measured.rms_px:.3f} px RMS"
        write_plot(plot, residual_figure(title, size_px, pixels, measured.errors_px))
    written = tomllib.loads(OmniCamera(measured.camera).to_toml())
    old: dict[str, Any] = next((tables[key] for key in _CAMERAS if key in tables), {})
    key = next(key for key in _CAMERAS if key in written)
    camera = {**written[key], "mounting": old.get("mounting", written[key]["mounting"])}
    others = {name: value for name, value in tables.items() if name not in _CAMERAS}
    image = {"supersampling": tables["camera"]["supersampling"]} if "camera" in tables else {}
    others.setdefault("virtual_cameras", written["virtual_cameras"])
    tables = {key: camera} | {**others, "camera": image or written["camera"]}
    details = _details(measured, rejected)
    write_measured("geometry", request, tables, measured.quantities, measured.unobservable, details)
    _print(measured, rejected)


def _read_optics(
    request: MeasureGeometryRequest,
) -> tuple[OpticsTables, list[str], OpticalSystem] | None:
    """Optics to fit: the file's table, keys of the free parameters, and the system."""
    if request.optics is None:
        if request.free:
            raise MeasurementError("--free: requires --optics, whose keys it names")
        return None
    if request.model:
        raise MeasurementError("--model: expected none with --optics, which states the model")
    if not request.free:
        raise MeasurementError("--optics: requires --free KEY, such as surfaces.0.tilt_deg")
    file = read_optics_tables(request.optics)
    system = parse_optics(*file)
    try:
        free = FreeParameters(file.table, request.free, str(request.optics)).names
    except OpticsError as reason:
        raise MeasurementError(str(reason)) from None
    return file, free, system


def _views(
    request: MeasureGeometryRequest,
) -> tuple[list[BoardView], list[RejectedImage], tuple[int, int]]:
    """The board in each image, images without it, and the size of the images."""
    if request.images.suffix.lower() == ".csv":
        if request.size is None:
            raise MeasurementError(f"{request.images}: corners need --size WIDTH HEIGHT")
        try:
            boards = read_corners(request.images)
        except OpticsError as reason:
            raise MeasurementError(str(reason)) from None
        views = [
            BoardView(f"image {number}", board.points_m, board.pixels_px)
            for number, board in enumerate(boards)
        ]
        return views, [], request.size
    if request.board is None:
        raise MeasurementError(f"{request.images}: images need --board, such as 8x6:30mm")
    require_extra("measure", "omnisim measure geometry", MeasurementError)
    board = read_board(request.board)
    files = image_files(request.images)
    results = list(track(find_boards(files, board, request.mirrored), "Boards", len(files)))
    views = [each.found for each in results if isinstance(each.found, BoardView)]
    rejected = [each.found for each in results if isinstance(each.found, RejectedImage)]
    if not views:
        fault = f"the board was found in no image; {rejected[0].name}: {rejected[0].reason}"
        raise MeasurementError(f"{request.images}: {fault}")
    return views, rejected, results[0].size_px


def _details(measured: MeasuredGeometry, rejected: Sequence[RejectedImage]) -> dict[str, Any]:
    starts = np.cumsum([0, *(len(view.points_m) for view in measured.views)])
    squared = np.square(measured.errors_px).sum(axis=1)
    parts = zip(measured.views, starts[:-1], starts[1:], measured.poses, strict=True)
    images = [
        {
            "name": view.name,
            "corners": len(view.points_m),
            "rms_px": math.sqrt(float(squared[first:last].mean())),
            "optical_from_board": pose.tolist(),
        }
        for view, first, last, pose in parts
    ]
    pixels_px = np.concatenate([view.pixels_px for view in measured.views])
    return {
        "model": measured.model,
        "rms_px": measured.rms_px,
        "held_out_rms_px": measured.held_out_rms_px,
        "models": [
            {
                "name": fit.name,
                "parameters": fit.parameters,
                "rms_px": _finite(fit.rms_px),
                "held_out_rms_px": _finite(fit.held_out_rms_px),
                "reason": fit.reason,
            }
            for fit in measured.models
        ],
        "images": images,
        "rejected_images": [{"name": image.name, "reason": image.reason} for image in rejected],
        "board_m": measured.board_m.tolist(),
        "corners": {
            "pixels_px": pixels_px.round(3).tolist(),
            "errors_px": measured.errors_px.round(4).tolist(),
        },
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _print(measured: MeasuredGeometry, rejected: Sequence[RejectedImage]) -> None:
    corners = sum(len(view.points_m) for view in measured.views)
    out.print(
        f"{measured.model}: {measured.rms_px:.3f} px RMS, {measured.held_out_rms_px:.3f} px in "
        f"held-out images ({pluralize(len(measured.views), 'image')}, "
        f"{pluralize(corners, 'corner')})"
    )
    shown = table("model", ">numbers", ">RMS px", ">held out px")
    for fit in measured.models[:_SHOWN_MODELS]:
        held_out = f"{fit.held_out_rms_px:.3f}" if math.isfinite(fit.held_out_rms_px) else "–"
        shown.add_row(fit.name, str(fit.parameters), f"{fit.rms_px:.3f}", held_out)
    out.print(shown)
    bow_m = float(np.abs(measured.board_m[:, 2]).max())
    if bow_m > 0.0:
        print_note(f"the board is bent by up to {1e3 * bow_m:.2g} mm, which is measured as well")
    for image in rejected:
        print_note(f"{image.name} not used: {image.reason}")
    if measured.rms_px > _MANY_PX:
        print_note(
            f"{measured.rms_px:.2f} px RMS is more than sharp images have; possible causes: "
            "several cameras, zoom or focus, a moved or bent board, or a lens no model describes"
        )
