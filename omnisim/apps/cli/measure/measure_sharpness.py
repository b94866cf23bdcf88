"""`omnisim measure sharpness`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from omnisim.apps.cli.console import print_note, track
from omnisim.apps.cli.measure.measured_files import (
    check_outputs,
    check_size,
    print_measured,
    read_reports,
    sensor_tables,
    stated_camera,
    write_measured,
)
from omnisim.apps.cli.measure.requests import MeasureSharpnessRequest
from omnisim.cameras.optics.boards.board_corners import BoardCorners, read_corners
from omnisim.core.errors import MeasurementError
from omnisim.measurement.sharpness import (
    EdgeSharpness,
    MeasuredSharpness,
    find_edge_images,
    measure_sharpness,
    read_edge_image,
)
from omnisim.rendering.camera.degradations import Encoding

MIN_GAMMA, MAX_GAMMA = 0.1, 10.0


def sharpness(request: MeasureSharpnessRequest) -> None:
    """Measure sharpness, write a sensor file, and print the quantities.

    Raises:
        MeasurementError: images that cannot be measured.
        SensorFileError: a sensor file with a fault.
        OpticsError: a file of corners with a fault.
        OutputError: a file that cannot be written.
    """
    check_outputs(request.output, request.sensor)
    tables: dict[str, Any] = sensor_tables(request.sensor)
    encoding = _encoding(request.response, tables)
    files: Sequence[Path] = find_edge_images(request.images)
    boards = None
    if request.corners is not None:
        boards = read_corners(request.corners)
        files = _files_with_board(request, files, boards)
    center_px = None
    camera = stated_camera(request.sensor)
    if camera is not None and request.sensor is not None:
        u_px, v_px = camera.principal_point_px
        center_px = float(u_px), float(v_px)
        height, width = read_edge_image(files[0], encoding).shape[:2]
        check_size(files[0], (width, height), camera, request.sensor)
    numbers = track(range(len(files)), "Images", len(files))
    measured = measure_sharpness(
        (read_edge_image(files[number], encoding) for number in numbers),
        boards=boards,
        center_px=center_px,
        encoding=encoding,
        names=[str(path) for path in files],
    )
    degradation = _degradation(tables.get("degradation", {}), measured)
    tables = {**tables, **({"degradation": degradation} if degradation else {})}
    write_measured(
        "sharpness",
        request.output,
        request.sensor,
        tables,
        measured.quantities,
        measured.unobservable,
        _details(measured),
    )
    print_measured(request.output, measured.quantities, measured.unobservable)
    for flaw, count in measured.flaws.items():
        print_note(f"{count} edges left out: {flaw.value}")
    if camera is None:
        width, height = measured.size_px
        print_note(f"radii are those of {width} × {height} px: give the camera's --sensor file")


def _encoding(text: str | None, tables: dict[str, Any]) -> Encoding | None:
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


def _files_with_board(
    request: MeasureSharpnessRequest, files: Sequence[Path], boards: Sequence[BoardCorners]
) -> Sequence[Path]:
    """Image files of the detected corners, as listed in the geometry's report.

    Raises:
        MeasurementError: the number of files differs from the number of boards.
    """
    if len(boards) != len(files) and request.sensor is not None:
        images = read_reports(request.sensor).get("geometry", {}).get("images", ())
        names = {image["name"] for image in images}
        files = [path for path in files if path.name in names]
    if len(boards) != len(files):
        raise MeasurementError(
            f"{request.corners}: expected corners in each of {len(files)} images, in the order of "
            f"their names, got those of {len(boards)}"
        )
    return files


def _degradation(tables: dict[str, Any], measured: MeasuredSharpness) -> dict[str, Any]:
    """Tables of a sensor file in which measured effects replace those of the same kind."""
    result = dict(tables)
    if measured.point_spread is not None:
        result.pop("defocus", None)
        result["point_spread"] = measured.point_spread.to_table(full=True)
    if measured.chromatic_aberration is not None:
        color = measured.chromatic_aberration
        result["chromatic_aberration"] = {
            "red_offsets_px": color.red_offsets_px,
            "blue_offsets_px": color.blue_offsets_px,
        }
    return result


def _details(measured: MeasuredSharpness) -> dict[str, Any]:
    """Size, center, edges and the number of unusable edges for the report."""
    return {
        "size_px": measured.size_px,
        "center_px": measured.center_px,
        "edges": [_edge(edge) for edge in measured.edges],
        "edges_left_out": {flaw.name.lower(): count for flaw, count in measured.flaws.items()},
    }


def _edge(edge: EdgeSharpness) -> dict[str, Any]:
    """Edge as JSON: colors of a gray image are null."""
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
