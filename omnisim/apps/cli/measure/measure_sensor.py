"""`omnisim measure response`, `noise`, `timing` and `sharpness`: the sensor behind the lens."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.apps.cli.console import out, print_note, track
from omnisim.apps.cli.measure import requests
from omnisim.apps.cli.measure.measured_files import (
    check_outputs,
    check_size,
    read_board_shape,
    read_reports,
    round_to_sigma,
    sensor_tables,
    stated_camera,
    write_measured,
)
from omnisim.cameras import CentralCamera
from omnisim.cameras.optics.system_calibration import read_corners
from omnisim.core.arrays import Floats
from omnisim.core.errors import MeasurementError
from omnisim.core.extras import require_extra
from omnisim.measurement import Quantity, Unobservable
from omnisim.measurement.geometry import BoardView, find_boards, read_board
from omnisim.measurement.geometry.board_detection import image_files
from omnisim.measurement.geometry.placed_board import BoardSurface
from omnisim.measurement.inputs import frame_numbers
from omnisim.measurement.noise import find_frame_sets, measure_noise, read_statistics
from omnisim.measurement.response import MeasuredVignetting, measure_response, measure_vignetting
from omnisim.measurement.response.response_curve import check_unclipped, mean_image
from omnisim.measurement.sharpness import (
    EdgeSharpness,
    find_edge_images,
    measure_sharpness,
    read_edge_image,
)
from omnisim.measurement.timing import (
    MeasuredReadout,
    MeasuredTiming,
    line_profiles,
    measure_readout,
    measure_timing,
)
from omnisim.rendering.camera.degradations import Encoding
from omnisim.rendering.camera.degradations.noise import write_pattern
from omnisim.rendering.camera.omnicamera import OmniCamera

_GREEN = 1
_NAMES = ("red", "green", "blue")
_MIN_TINT = 0.005  # below: balanced
MIN_GAMMA, MAX_GAMMA = 0.1, 10.0


def response(request: requests.MeasureResponseRequest) -> None:
    """Measure the response and, from flat fields, the vignetting, and write a sensor file."""
    check_outputs(request.output, request.sensor)
    if request.white is not None and not request.white > request.black:
        expected = f"expected a level above --black {request.black:g}"
        raise MeasurementError(f"--white: {expected}, got {request.white:g}")
    tables = sensor_tables(request.sensor)
    sets = find_frame_sets(request.images, is_lossy_allowed=True)
    images, times, largest = [], [], 0.0
    for frames in track(sets, "Exposures"):
        if not frames.files:
            raise MeasurementError(f"{frames.folder}: expected images, got none")
        mean, largest = mean_image(frames.files, _GREEN)
        largest = request.white or largest
        images.append(mean)
        times.append(frames.exposure_s)
    measured = measure_response(images, times, request.black, largest, str(request.images))
    quantities, unobservable = list(measured.quantities), list[Unobservable]()
    degradation: dict[str, Any] = dict(tables.get("degradation", {}))
    encoding, sigma = measured.encoding, measured.quantities[0].sigma
    degradation["encoding"] = _encoding(degradation.get("encoding", {}), encoding, sigma)
    curves = {"light": measured.light.tolist(), "levels": measured.levels.tolist()}
    details: dict[str, Any] = {"response": {**curves, "errors": measured.errors}}
    if request.flat is None:
        reason = "no flat fields: photograph an evenly lit surface, and pass it as --flat"
        unobservable.append(Unobservable("vignetting.coefficients", reason))
    else:
        channels = _vignetting(request.flat, request, encoding)
        green = channels.get("green", next(iter(channels.values())))
        degradation["vignetting"] = green.vignetting.to_table(full=True)
        if set(_NAMES) <= channels.keys():
            tint = [channels[name].middle / channels["green"].middle for name in _NAMES]
            if max(abs(value - 1.0) for value in tint) > _MIN_TINT:
                response = [round(value, 4) for value in tint]
                degradation["white_balance"] = {"response": response, "gains": [1.0, 1.0, 1.0]}
            basis = "center of the flat fields, whose light is assumed to be white"
            quantities += [
                Quantity(f"white_balance.{name}", value, math.nan, "of green", basis)
                for name, value in zip(_NAMES, tint, strict=True)
                if name != "green"
            ]
        details["vignetting"] = {}
        for name, channel in channels.items():
            quantities += [replace(part, name=f"{name}.{part.name}") for part in channel.quantities]
            details["vignetting"][name] = {
                "radius": channel.radii.tolist(),
                "light": channel.light.tolist(),
                "fitted": channel.fitted.tolist(),
                "gradient": channel.gradient.tolist(),
                "residual": channel.residual,
            }
    tables = {**tables, "degradation": degradation}
    write_measured("response", request, tables, quantities, unobservable, details)
    errors = ", ".join(f"{name} {100.0 * share:.2f} %" for name, share in measured.errors.items())
    out.print(f"errors of full scale: {errors}")


def _vignetting(
    folder: Path, request: requests.MeasureResponseRequest, encoding: Encoding
) -> dict[str, MeasuredVignetting]:
    """Vignetting of each channel, by name; a gray image has a single channel."""
    files = image_files(folder)
    camera = stated_camera(request.sensor)
    center = None if camera is None else _principal_point_px(camera)
    channels: dict[str, MeasuredVignetting] = {}
    planes: list[Floats] = []
    for number in track(range(3), "Channels"):
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
        light = encoding.linearized(levels)
        channels[name] = measure_vignetting(light, center, str(folder))
    return {"gray": channels["red"]} if len(channels) == 1 else channels


def _principal_point_px(camera: CentralCamera) -> tuple[float, float]:
    u_px, v_px = camera.principal_point_px
    return float(u_px), float(v_px)


def _encoding(table: dict[str, Any], encoding: Encoding, sigma: float) -> dict[str, Any]:
    """Table of an encoding whose gamma has a standard deviation, with the other keys of `table`."""
    others = {key: value for key, value in table.items() if key not in ("gamma", "curve")}
    gamma, curve = encoding.gamma, encoding.curve
    if curve is not None:
        return {**others, "curve": [[round(value, 5) for value in point] for point in curve]}
    if not isinstance(gamma, str) and gamma != 1.0:
        gamma = round_to_sigma(gamma, sigma)
    return {**others, "gamma": gamma}


def noise(request: requests.MeasureNoiseRequest) -> None:
    """Measure noise, write a sensor file with its pattern, and print the quantities."""
    pattern = request.output.with_name(f"{request.output.stem}-pattern.exr")
    check_outputs(request.output, request.sensor, pattern=pattern)
    tables = sensor_tables(request.sensor)
    dark, flat = (
        [read_statistics(frames) for frames in track(find_frame_sets(folder), title)]
        for folder, title in ((request.dark, "Dark frames"), (request.flat, "Flat fields"))
    )
    measured = measure_noise(dark, flat, bit_depth=request.bit_depth, mosaic=request.bayer)
    digits = {each.name: round_to_sigma(each.value, each.sigma) for each in measured.quantities}
    values = measured.noise.to_table(full=True)  # with no more digits than were measured
    left_out = {"pattern_seed"} if measured.pattern is None else {"pattern_seed", "prnu", "dsnu_e"}
    keys = {key: digits.get(key, value) for key, value in values.items() if key not in left_out}
    if measured.pattern is not None:
        write_pattern(pattern, measured.pattern)
        keys["pattern"] = pattern.name
    degradation = {**tables.get("degradation", {}), "noise": keys}
    shutter = degradation.setdefault("shutter", {})
    shutter.setdefault("exposure_s", measured.exposure_s)  # which the dark current needs
    tables = {**tables, "degradation": degradation}
    curve = measured.curve
    details = {
        "photon_transfer": {
            "mean_dn": curve.means_dn.tolist(),
            "variance_dn2": curve.variances_dn2.tolist(),
            "used": curve.used.tolist(),
        },
        "defective_pixels": measured.defects[:, ::-1].tolist(),
    }
    numbers = measured.quantities, measured.unobservable
    write_measured("noise", request, tables, *numbers, details)
    if len(measured.defects):
        out.print(f"{len(measured.defects)} defective pixels")


def timing(request: requests.MeasureTimingRequest) -> None:
    """Measure readout and exposure time, and write a sensor file with its shutter."""
    check_outputs(request.output, request.sensor)
    if (request.flicker is None) == (request.board is None):
        raise MeasurementError("timing: expected either --flicker HZ or --board BOARD")
    for option, value in (("--flicker", request.flicker), ("--frame-rate", request.frame_rate)):
        if value is not None and not 0.0 < value < math.inf:
            raise MeasurementError(f"{option}: expected a frequency above 0 Hz, got {value:g}")
    for is_wrong, fault in (
        (request.sensor is None, "--board: requires --sensor with the measured camera model"),
        (request.frame_rate is None, "--board: requires --frame-rate HZ"),
        (request.modulation is not None,
         "--modulation: requires --flicker HZ, whose lamp it describes"),
    ):  # fmt: skip
        if request.board is not None and is_wrong:
            raise MeasurementError(fault)
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
    details = {"lines": measured.lines, **details}
    write_measured("timing", request, tables, measured.quantities, unobservable, details)


def _under_a_lamp(
    request: requests.MeasureTimingRequest, tables: Mapping[str, Any]
) -> tuple[MeasuredTiming, dict[str, Any]]:
    """Timing from frames under a flickering lamp, and its plot's data."""
    assert request.flicker is not None
    encoding = Encoding(**tables.get("degradation", {}).get("encoding", {"gamma": 1.0}))
    files = image_files(request.images)
    means = (mean_image([file], _GREEN) for file in files)
    frames = (encoding.linearized(levels / white) for levels, white in means)
    tracked = track(frames, "Frames", len(files))
    profiles = line_profiles(tracked, 1.0, str(request.images))
    measured = measure_timing(profiles, request.flicker, request.modulation, str(request.images))
    return measured, {"profile": measured.profile.tolist(), "fitted": measured.fitted.tolist()}


def _of_a_board(request: requests.MeasureTimingRequest) -> tuple[MeasuredReadout, dict[str, Any]]:
    """Readout from frames of a turning board, and its plot's data."""
    require_extra("measure", "omnisim measure timing --board", MeasurementError)
    assert request.board is not None
    assert request.sensor is not None
    assert request.frame_rate is not None
    camera, board = OmniCamera.from_file(request.sensor).model, read_board(request.board)
    files = image_files(request.images)
    found = list(track(find_boards(files, board, request.mirrored), "Boards", len(files)))
    check_size(files[0], found[0].size_px, camera, request.sensor)
    numbers = frame_numbers(request.images, files)
    seen = [
        (board_in.found, number)
        for board_in, number in zip(found, numbers, strict=True)
        if isinstance(board_in.found, BoardView)
    ]
    board_m, surface = read_board_shape(request.sensor), None
    if board_m is not None and seen:
        corners_m = np.unique(np.concatenate([view.points_m for view, _ in seen]), axis=0)
        surface = BoardSurface.measured(board_m, corners_m)
    views, places = [view for view, _ in seen], [number for _, number in seen]
    rate, name = request.frame_rate, str(request.images)
    measured = measure_readout(camera, views, places, rate, surface, name)
    corners = {
        "pixels_px": measured.pixels_px.round(3).tolist(),
        "errors_px": measured.errors_px.round(4).tolist(),
        "without_readout_px": measured.frozen_px.round(4).tolist(),
    }
    return measured, {"corners": corners}


def sharpness(request: requests.MeasureSharpnessRequest) -> None:
    """Measure sharpness, write a sensor file, and print the quantities."""
    check_outputs(request.output, request.sensor)
    tables: dict[str, Any] = sensor_tables(request.sensor)
    encoding = _encoding_of(request.response, tables)
    files: Sequence[Path] = find_edge_images(request.images)
    boards = None
    if request.corners is not None:
        boards = read_corners(request.corners)
        if len(boards) != len(files) and request.sensor is not None:
            # those that the geometry's report lists
            reported = read_reports(request.sensor).get("geometry", {}).get("images", ())
            with_board = {image["name"] for image in reported}
            files = [path for path in files if path.name in with_board]
        if len(boards) != len(files):
            raise MeasurementError(
                f"{request.corners}: expected the corners of all {len(files)} images in the order "
                f"of their names, got those of {len(boards)}"
            )
    center_px = None
    camera = stated_camera(request.sensor)
    if camera is not None and request.sensor is not None:
        center_px = _principal_point_px(camera)
        height, width = read_edge_image(files[0], encoding).shape[:2]
        check_size(files[0], (width, height), camera, request.sensor)
    images = (read_edge_image(file, encoding) for file in track(files, "Images"))
    names = [str(path) for path in files]
    measured = measure_sharpness(
        images, boards=boards, center_px=center_px, encoding=encoding, names=names
    )
    degradation = dict(tables.get("degradation", {}))  # measured effects replace those of a kind
    if measured.point_spread is not None:
        degradation.pop("defocus", None)
        degradation["point_spread"] = measured.point_spread.to_table(full=True)
    if (color := measured.chromatic_aberration) is not None:
        offsets = {"red_offsets_px": color.red_offsets_px, "blue_offsets_px": color.blue_offsets_px}
        degradation["chromatic_aberration"] = offsets
    tables = {**tables, **({"degradation": degradation} if degradation else {})}
    details = {
        "size_px": measured.size_px,
        "center_px": measured.center_px,
        "edges": [_edge(edge) for edge in measured.edges],
        "edges_left_out": {flaw.name.lower(): count for flaw, count in measured.flaws.items()},
    }
    numbers = measured.quantities, measured.unobservable
    write_measured("sharpness", request, tables, *numbers, details)
    for flaw, count in measured.flaws.items():
        print_note(f"{count} edges left out: {flaw.value}")
    if camera is None:
        width, height = measured.size_px
        hint = "pass the camera's sensor file as --sensor"
        print_note(f"radii apply to images of {width} × {height} px: {hint}")


def _encoding_of(text: str | None, tables: dict[str, Any]) -> Encoding | None:
    """Encoding of the images: the given one, or that of the sensor file."""
    if text is None:
        table = tables.get("degradation", {}).get("encoding")
        return None if table is None else Encoding(**table)
    if text == "srgb":
        return Encoding(gamma="srgb")
    try:
        gamma = float(text)
    except ValueError:
        gamma = 0.0
    if not MIN_GAMMA <= gamma <= MAX_GAMMA:
        expected = f"expected srgb or a number from {MIN_GAMMA:g} to {MAX_GAMMA:g}"
        raise MeasurementError(f"--response: {expected}, got {text!r}")
    return Encoding(gamma=gamma)


def _edge(edge: EdgeSharpness) -> dict[str, Any]:
    red, blue = (
        None if math.isnan(shift) else [shift, sigma]
        for shift, sigma in zip(edge.shifts_px.tolist(), edge.shift_sigmas_px.tolist(), strict=True)
    )
    return {
        "image": edge.image,
        "center_px": edge.center_px.round(2).tolist(),
        "normal": edge.normal.round(4).tolist(),
        "mtf50": [edge.mtf50, edge.mtf50_sigma],
        "rise_px": [edge.rise_px, edge.rise_sigma_px],
        "red_shift_px": red,
        "blue_shift_px": blue,
    }
