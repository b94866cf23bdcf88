"""`omnisim measure compare`: a camera's images beside its twin's, as a report."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from omnisim.apps.cli.console import out, pluralize, print_note, track
from omnisim.apps.cli.measure.measured_files import read_board_shape
from omnisim.apps.cli.measure.requests import MeasureCompareRequest
from omnisim.core.errors import MeasurementError
from omnisim.core.extras import require_extra
from omnisim.measurement.comparison import ImageComparison, compare_images
from omnisim.measurement.comparison.comparison import MAX_OFFSET_PX, Comparison, compare_image
from omnisim.measurement.geometry import BoardView, find_boards, read_board, read_gray
from omnisim.measurement.geometry.board_images import image_files
from omnisim.rendering.camera.omnicamera import OmniCamera

if TYPE_CHECKING:
    from omnisim.validation.report.report import Section

_SHOWN = 6  # images in the report
_BIAS_PX, _LEVELS, _RISE = 0.05, 4.0, 0.15


def compare(request: MeasureCompareRequest) -> None:
    """Render each image's board by the twin, compare both, and write a report.

    Raises:
        MeasurementError: images without the board, or of another camera.
        SensorFileError: a sensor file with a fault.
        OutputError: the report cannot be written.
    """
    require_extra("measure", "omnisim measure compare", MeasurementError)
    require_extra("reports", "omnisim measure compare", MeasurementError)
    from omnisim.apps.cli.measure.measured_sections import measured_sections
    from omnisim.validation.report.report import Report, check_report_target

    check_report_target(request.output)
    parts = measured_sections(request.sensor)
    comparison = _compare(request)
    facts = {"sensor": request.sensor.name, "images": [one.name for one in comparison.images]}
    text = f"{pluralize(len(comparison.images), 'image')}."
    report = Report("Camera twin", text, (_section(comparison), *parts), facts)
    report.write(request.output)
    _print(request.output, comparison)


def _compare(request: MeasureCompareRequest) -> Comparison:
    """Compare all images that have the board."""
    sensor = OmniCamera.from_file(request.sensor)
    board = read_board(request.board)
    board_m = read_board_shape(request.sensor)
    files = image_files(request.images)
    searches = find_boards(files, board, request.mirrored)
    compared: list[ImageComparison] = []
    for number in track(range(len(files)), "Images", len(files)):
        search = next(searches)
        view = search.found
        if search.size_px != (sensor.model.width_px, sensor.model.height_px):
            size = search.size_px
            raise MeasurementError(
                f"{files[number]}: {size[0]} × {size[1]} px: expected {sensor.model.width_px} × "
                f"{sensor.model.height_px} px as in {request.sensor}"
            )
        if not isinstance(view, BoardView):
            print_note(f"{view.name} not used: {view.reason}")
            continue
        image = read_gray(files[number])
        try:
            compared.append(compare_image(sensor, board, view, image, board_m, request.mirrored))
        except MeasurementError as reason:
            print_note(f"{reason}: not compared")
    if not compared:
        raise MeasurementError(f"{request.images}: no image could be compared")
    return compare_images(sensor, compared)


def _level_error(comparison: Comparison) -> float:
    """90th percentile of the squares' absolute differences, gray levels."""
    return float(np.percentile(np.abs(comparison.level_errors), 90.0))


def _rise_error(comparison: Comparison) -> float:
    """Maximum relative difference of the edge rise over the rings; NaN: no edge was long enough."""
    ratios = [ring.twin_rise_px / ring.rise_px - 1.0 for ring in comparison.rings]
    finite = [abs(ratio) for ratio in ratios if math.isfinite(ratio)]
    return max(finite, default=math.nan)


def _print(output: Path, comparison: Comparison) -> None:
    rise = _rise_error(comparison)
    out.print(f"{output}: written", markup=False)
    out.print(
        f"{pluralize(len(comparison.images), 'image')}: corners found again with a bias of "
        f"{comparison.bias_px:.3f} px at most by ring, {comparison.lost} lost; gray levels within "
        f"{_level_error(comparison):.1f} of 255 for 90 % of the squares; "
        + (f"edges within {100.0 * rise:.0f} %" if math.isfinite(rise) else "no edge long enough"),
        markup=False,
    )


def _section(comparison: Comparison) -> Section:
    from omnisim.validation.plots.twin_plots import edge_figure, sheet_figure
    from omnisim.validation.report.measure import Measure
    from omnisim.validation.report.report import CaptionedFigure, ResultTable, Section

    rows = tuple(
        (
            f"{ring.radius_px:.0f}",
            str(ring.corners),
            str(ring.lost),
            f"{ring.bias_px[0]:+.3f}",
            f"{ring.bias_px[1]:+.3f}",
            f"{ring.rms_px:.3f}",
            f"{ring.rise_px:.2f}",
            f"{ring.twin_rise_px:.2f}",
        )
        for ring in comparison.rings
    )
    columns = (
        "up to px",
        "corners",
        "lost",
        "bias along the radius",
        "bias across it",
        "RMS",
        "edge rise",
        "twin's",
    )
    step = max(1, len(comparison.images) // _SHOWN)
    shown = comparison.images[::step][:_SHOWN]
    return Section(
        "The camera beside its twin",
        "Each image's board is rendered in its solved pose by the sensor file, under smooth light "
        "that was fitted to its ink and to its paper. The same detector finds the corners in both.",
        measures=(
            Measure("largest bias of corners, by ring", comparison.bias_px, "px", _BIAS_PX),
            Measure(
                "gray levels of 90 % of the squares", _level_error(comparison), "of 255", _LEVELS
            ),
            Measure("10–90 % rise of edges, by ring", _rise_error(comparison), "", _RISE),
        ),
        tables=(
            ResultTable(
                f"Rings of the image, px. Lost: more than {MAX_OFFSET_PX:g} px off, or not found.",
                columns,
                rows,
            ),
        ),
        figures=(
            CaptionedFigure(
                "images", sheet_figure(shown), "Images, the twin's, and twin minus image"
            ),
            CaptionedFigure("edges", edge_figure(comparison), "Corners and edges over the field"),
        ),
    )
