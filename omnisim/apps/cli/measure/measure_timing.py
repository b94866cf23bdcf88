"""`omnisim measure timing`: readout and exposure time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.apps.cli.console import track
from omnisim.apps.cli.measure.measured_files import (
    check_outputs,
    check_size,
    print_measured,
    read_board_shape,
    round_to_sigma,
    sensor_tables,
    write_measured,
)
from omnisim.apps.cli.measure.requests import MeasureTimingRequest
from omnisim.core.errors import MeasurementError
from omnisim.core.extras import require_extra
from omnisim.measurement.geometry import BoardView, find_boards, read_board
from omnisim.measurement.geometry.board_detection import image_files
from omnisim.measurement.geometry.placed_board import BoardSurface
from omnisim.measurement.inputs import frame_numbers
from omnisim.measurement.quantity import Unobservable
from omnisim.measurement.response.light_falloff import mean_image
from omnisim.measurement.timing import (
    MeasuredReadout,
    MeasuredTiming,
    line_profiles,
    measure_readout,
    measure_timing,
)
from omnisim.rendering.camera.degradations import Encoding
from omnisim.rendering.camera.omnicamera import OmniCamera

_GREEN = 1


def timing(request: MeasureTimingRequest) -> None:
    """Measure readout and exposure time, and write a sensor file with its shutter.

    Raises:
        MeasurementError: frames that cannot be measured.
        SensorFileError: a sensor file with a fault.
        OutputError: a file that cannot be written.
    """
    check_outputs(request.output, request.sensor)
    _check_options(request)
    tables = sensor_tables(request.sensor)
    measured: MeasuredTiming | MeasuredReadout
    if request.board is None:
        measured, details = _under_a_lamp(request, tables)
    else:
        measured, details = _of_a_board(request)
    degradation = dict(tables.get("degradation", {}))
    shutter = dict(degradation.get("shutter", {}))
    unobservable = list(measured.unobservable)
    written = {"readout_s", "exposure_s"}
    if measured.lines == "columns":
        reason = (
            "columns are read out one after another, and a sensor file describes rows only: "
            "rotate the images by 90°"
        )
        unobservable.append(Unobservable("degradation.shutter.readout_s", reason))
        written.remove("readout_s")
    for quantity in measured.quantities:
        if quantity.name in written:
            shutter[quantity.name] = round_to_sigma(quantity.value, quantity.sigma)
    tables["degradation"] = {**degradation, "shutter": shutter}
    write_measured(
        "timing",
        request.output,
        request.sensor,
        tables,
        measured.quantities,
        unobservable,
        {"lines": measured.lines, **details},
    )
    print_measured(request.output, measured.quantities, unobservable)


def _check_options(request: MeasureTimingRequest) -> None:
    """Reject options that contradict each other, before the frames are read.

    Raises:
        MeasurementError: names the option.
    """
    if (request.flicker is None) == (request.board is None):
        raise MeasurementError("timing: expected either --flicker HZ or --board BOARD")
    for option, value in (("--flicker", request.flicker), ("--frame-rate", request.frame_rate)):
        if value is not None and not 0.0 < value < math.inf:
            raise MeasurementError(f"{option}: expected a frequency above 0 Hz, got {value:g}")
    if request.board is None:
        return
    if request.sensor is None:
        raise MeasurementError("--board: expected --sensor with the measured camera model")
    if request.frame_rate is None:
        raise MeasurementError("--board: expected --frame-rate HZ")
    if request.modulation is not None:
        raise MeasurementError("--modulation: expected --flicker HZ, whose lamp it describes")


def _under_a_lamp(
    request: MeasureTimingRequest, tables: Mapping[str, Any]
) -> tuple[MeasuredTiming, dict[str, Any]]:
    """Timing from frames under a flickering lamp, and its plot's data."""
    assert request.flicker is not None
    encoding = Encoding(**tables.get("degradation", {}).get("encoding", {"gamma": 1.0}))
    files = image_files(request.images)
    profiles = line_profiles(_frames(files, encoding), 1.0, str(request.images))
    measured = measure_timing(profiles, request.flicker, request.modulation, str(request.images))
    return measured, {"profile": measured.profile.tolist(), "fitted": measured.fitted.tolist()}


def _of_a_board(request: MeasureTimingRequest) -> tuple[MeasuredReadout, dict[str, Any]]:
    """Readout from frames of a turning board, and its plot's data."""
    require_extra("measure", "omnisim measure timing --board", MeasurementError)
    assert request.board is not None
    assert request.sensor is not None
    assert request.frame_rate is not None
    camera, board = OmniCamera.from_file(request.sensor).model, read_board(request.board)
    files = image_files(request.images)
    searches = find_boards(files, board, request.mirrored)
    found = [next(searches) for _ in track(range(len(files)), "Boards", len(files))]
    check_size(files[0], found[0].size_px, camera, request.sensor)
    numbers = frame_numbers(request.images, files)
    seen = [
        (one.found, number)
        for one, number in zip(found, numbers, strict=True)
        if isinstance(one.found, BoardView)
    ]
    board_m, surface = read_board_shape(request.sensor), None
    if board_m is not None and seen:
        corners_m = np.unique(np.concatenate([view.points_m for view, _ in seen]), axis=0)
        surface = BoardSurface.measured(board_m, corners_m)
    measured = measure_readout(
        camera,
        [view for view, _ in seen],
        [number for _, number in seen],
        request.frame_rate,
        surface,
        str(request.images),
    )
    return measured, {
        "corners": {
            "pixels_px": measured.pixels_px.round(3).tolist(),
            "errors_px": measured.errors_px.round(4).tolist(),
            "without_readout_px": measured.frozen_px.round(4).tolist(),
        }
    }


def _frames(files: Sequence[Path], encoding: Encoding) -> Iterator[NDArray[np.float64]]:
    """Linear light of frames, from 0 to 1."""
    for number in track(range(len(files)), "Frames", len(files)):
        levels, white = mean_image(files[number : number + 1], _GREEN)
        yield encoding.linearized(levels / white)
