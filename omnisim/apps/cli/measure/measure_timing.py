"""`omnisim measure timing`: readout and exposure time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.apps.cli.console import track
from omnisim.apps.cli.measure.measured_files import (
    check_outputs,
    print_measured,
    round_to_sigma,
    sensor_tables,
    write_measured,
)
from omnisim.apps.cli.measure.requests import MeasureTimingRequest
from omnisim.core.errors import MeasurementError
from omnisim.measurement.geometry.board_images import image_files
from omnisim.measurement.quantity import Unseen
from omnisim.measurement.response.mean_images import mean_image
from omnisim.measurement.timing import line_profiles, measure_timing
from omnisim.rendering.camera.degradations import Encoding

_GREEN = 1


def timing(request: MeasureTimingRequest) -> None:
    """Measure readout and exposure time, and write a sensor file with its shutter.

    Raises:
        MeasurementError: frames that cannot be measured.
        SensorFileError: a sensor file with a fault.
        OutputError: a file that cannot be written.
    """
    check_outputs(request.output, request.sensor)
    if not request.flicker > 0.0:  # before the frames are read
        message = f"flicker: expected a frequency above 0 Hz, got {request.flicker:g}"
        raise MeasurementError(message)
    tables = sensor_tables(request.sensor)
    degradation = dict(tables.get("degradation", {}))
    encoding = Encoding(**degradation.get("encoding", {"gamma": 1.0}))
    files = image_files(request.images)
    profiles = line_profiles(_frames(files, encoding), 1.0, str(request.images))
    measured = measure_timing(profiles, request.flicker, request.modulation, str(request.images))
    shutter = dict(degradation.get("shutter", {}))
    unseen = list(measured.unseen)
    written = {"readout_s", "exposure_s"}
    if measured.lines == "columns":
        reason = "columns are read out one after the other; a sensor file says it of rows: turn it"
        unseen.append(Unseen("degradation.shutter.readout_s", reason))
        written.remove("readout_s")
    for quantity in measured.quantities:
        if quantity.name in written:
            shutter[quantity.name] = round_to_sigma(quantity.value, quantity.sigma)
    tables["degradation"] = {**degradation, "shutter": shutter}
    details = {
        "lines": measured.lines,
        "profile": measured.profile.tolist(),
        "fitted": measured.fitted.tolist(),
    }
    write_measured(
        "timing", request.output, request.sensor, tables, measured.quantities, unseen, details
    )
    print_measured(request.output, measured.quantities, unseen)


def _frames(files: Sequence[Path], encoding: Encoding) -> Iterator[NDArray[np.float64]]:
    """Linear light of frames, from 0 to 1."""
    for number in track(range(len(files)), "Frames", len(files)):
        levels, white = mean_image(files[number : number + 1], _GREEN)
        yield encoding.linearized(levels / white)
