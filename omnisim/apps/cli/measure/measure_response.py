"""`omnisim measure response`: transfer function and vignetting."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.apps.cli.console import out, track
from omnisim.apps.cli.measure.measured_files import (
    check_outputs,
    check_size,
    print_measured,
    round_to_sigma,
    sensor_tables,
    stated_camera,
    write_measured,
)
from omnisim.apps.cli.measure.requests import MeasureResponseRequest
from omnisim.core.errors import MeasurementError
from omnisim.measurement.geometry.board_images import image_files
from omnisim.measurement.noise import find_frame_sets
from omnisim.measurement.quantity import Quantity, Unobservable
from omnisim.measurement.response import (
    MeasuredResponse,
    MeasuredVignetting,
    measure_response,
    measure_vignetting,
)
from omnisim.measurement.response.mean_images import check_unclipped, mean_image

_GREEN = 1
_NAMES = ("red", "green", "blue")
_MIN_TINT = 0.005  # below: balanced


def response(request: MeasureResponseRequest) -> None:
    """Measure the response and, from flat fields, the vignetting, and write a sensor file.

    Raises:
        MeasurementError: images that cannot be measured.
        SensorFileError: a sensor file with a fault.
        OutputError: a file that cannot be written.
    """
    check_outputs(request.output, request.sensor)
    if request.white is not None and not request.white > request.black:
        raise MeasurementError(
            f"--white: expected a level above the black one, {request.black:g}, "
            f"got {request.white:g}"
        )
    tables = sensor_tables(request.sensor)
    measured = _response(request)
    quantities, unobservable = list(measured.quantities), list[Unobservable]()
    degradation: dict[str, Any] = dict(tables.get("degradation", {}))
    degradation["encoding"] = _encoding(degradation.get("encoding", {}), measured)
    details: dict[str, Any] = {
        "response": {
            "light": measured.light.tolist(),
            "levels": measured.levels.tolist(),
            "errors": measured.errors,
        }
    }
    if request.flat is None:
        reason = "no flat fields: photograph an evenly lit surface, and give --flat"
        unobservable.append(Unobservable("vignetting.coefficients", reason))
    else:
        channels = _vignetting(request.flat, request, measured)
        green = channels.get("green", next(iter(channels.values())))
        degradation["vignetting"] = green.vignetting.to_table(full=True)
        if set(_NAMES) <= channels.keys():
            tint = [channels[name].middle / channels["green"].middle for name in _NAMES]
            if max(abs(value - 1.0) for value in tint) > _MIN_TINT:
                response = [round(value, 4) for value in tint]
                degradation["white_balance"] = {"response": response, "gains": [1.0, 1.0, 1.0]}
            basis = "middle of the flat fields, whose light is taken as white"
            quantities += [
                Quantity(f"white_balance.{name}", value, math.nan, "of green", basis)
                for name, value in zip(_NAMES, tint, strict=True)
                if name != "green"
            ]
        for name, one in channels.items():
            quantities += [replace(part, name=f"{name}.{part.name}") for part in one.quantities]
        details["vignetting"] = {
            name: {
                "radius": one.radii.tolist(),
                "light": one.light.tolist(),
                "fitted": one.fitted.tolist(),
                "gradient": one.gradient.tolist(),
                "residual": one.residual,
            }
            for name, one in channels.items()
        }
    tables = {**tables, "degradation": degradation}
    write_measured(
        "response", request.output, request.sensor, tables, quantities, unobservable, details
    )
    print_measured(request.output, quantities, unobservable)
    _print(measured)


def _response(request: MeasureResponseRequest) -> MeasuredResponse:
    sets = find_frame_sets(request.images, is_lossy_allowed=True)
    images, times, largest = [], [], 0.0
    for number in track(range(len(sets)), "Exposures", len(sets)):
        if not sets[number].files:
            raise MeasurementError(f"{sets[number].folder}: expected images, got none")
        mean, largest = mean_image(sets[number].files, _GREEN)
        largest = request.white or largest
        images.append(mean)
        times.append(sets[number].exposure_s)
    return measure_response(images, times, request.black, largest, str(request.images))


def _vignetting(
    folder: Path, request: MeasureResponseRequest, measured: MeasuredResponse
) -> dict[str, MeasuredVignetting]:
    """Vignetting of each channel, by name; a gray image has a single channel."""
    files = image_files(folder)
    camera = stated_camera(request.sensor)
    center = (
        None
        if camera is None
        else (float(camera.principal_point_px[0]), float(camera.principal_point_px[1]))
    )
    channels: dict[str, MeasuredVignetting] = {}
    planes: list[NDArray[np.float64]] = []
    for number in track(range(3), "Channels", 3):
        mean, largest = mean_image(files, number)
        largest = request.white or largest
        if planes and np.array_equal(mean, planes[0]):
            continue  # gray images
        planes.append(mean)
        if camera is not None and request.sensor is not None:
            check_size(folder, (mean.shape[1], mean.shape[0]), camera, request.sensor)
        check_unclipped(mean, largest, str(folder))
        levels = np.clip((mean - request.black) / (largest - request.black), 0.0, 1.0)
        name = _NAMES[number] if number else "red"
        light = measured.encoding.linearized(levels)
        channels[name] = measure_vignetting(light, center, str(folder))
    return {"gray": channels["red"]} if len(channels) == 1 else channels


def _encoding(table: dict[str, Any], measured: MeasuredResponse) -> dict[str, Any]:
    """Table of the sensor file with the measured transfer function."""
    others = {key: value for key, value in table.items() if key not in ("gamma", "curve")}
    gamma, curve = measured.encoding.gamma, measured.encoding.curve
    if curve is not None:
        return {**others, "curve": [[round(value, 5) for value in point] for point in curve]}
    if not isinstance(gamma, str) and gamma != 1.0:
        gamma = round_to_sigma(gamma, measured.quantities[0].sigma)
    return {**others, "gamma": gamma}


def _print(measured: MeasuredResponse) -> None:
    errors = ", ".join(f"{name} {100.0 * one:.2f} %" for name, one in measured.errors.items())
    out.print(f"errors of full scale: {errors}", markup=False)
