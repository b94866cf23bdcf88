"""Sections of a camera's report: the measured numbers of each part, and their plots."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.apps.cli.measure.measured_files import (
    format_quantity,
    quantities_of,
    read_reports,
    report_path,
    unobservable_of,
)
from omnisim.core.errors import MeasurementError
from omnisim.plots.measured_plots import (
    photon_transfer_figure,
    residual_figure,
    response_figure,
    sharpness_figure,
    timing_figure,
    vignetting_figure,
)
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.report.report import CaptionedFigure, ResultTable, Section

PartReport = Mapping[str, Any]
_MODELS = ("model", "numbers", "RMS px", "held out px", "not fitted")


def measured_sections(sensor: Path) -> list[Section]:
    """Section of each part that was measured, from the report beside a sensor file."""
    camera = OmniCamera.from_file(sensor)
    sections = []
    for part, report in read_reports(sensor).items():
        try:
            quantities, missing = quantities_of(report), unobservable_of(report)
            rows = tuple(
                (each.name, *format_quantity(each), each.unit, each.basis) for each in quantities
            )
            columns = ("name", "value", "±", "unit", "from")
            tables = [ResultTable("Measured numbers.", columns, rows)]
            if missing:
                reasons = tuple((each.name, each.reason) for each in missing)
                tables.append(ResultTable("Not measured.", ("name", "reason"), reasons))
            if part == "geometry":
                tables += _geometry_tables(report)
            figures = list(_figures(part, report, camera))
        except (KeyError, ValueError, TypeError, AttributeError):
            expected = "expected a report of `omnisim measure`"
            raise MeasurementError(f"{report_path(sensor)}: {part}: {expected}") from None
        sections.append(Section(part.capitalize(), tables=tables, figures=figures, key=part))
    return sections


def _geometry_tables(report: PartReport) -> list[ResultTable]:
    models = tuple(
        (
            fit["name"],
            str(fit["parameters"]) if fit["parameters"] else "–",
            _pixels(fit["rms_px"]),
            _pixels(fit["held_out_rms_px"]),
            str(fit.get("reason", "")).removeprefix("camera: "),
        )
        for fit in report["models"]
    )
    images = tuple(
        (image["name"], str(image["corners"]), _pixels(image["rms_px"]))
        for image in report["images"]
    )
    tables = [
        ResultTable("Camera models, the best one first.", _MODELS, models),
        ResultTable("Images.", ("image", "corners", "RMS px"), images),
    ]
    if rejected := tuple((image["name"], image["reason"]) for image in report["rejected_images"]):
        tables.append(ResultTable("Images that were left out.", ("image", "reason"), rejected))
    return tables


def _pixels(value: float | None) -> str:
    return "–" if value is None or not math.isfinite(value) else f"{value:.3f}"


def _figures(part: str, report: PartReport, camera: OmniCamera) -> Iterator[CaptionedFigure]:
    size_px = camera.model.width_px, camera.model.height_px
    if part == "noise":
        curve = report["photon_transfer"]
        (gain,) = (each.value for each in quantities_of(report) if each.name == "gain_e_per_dn")
        levels = curve["mean_dn"], curve["variance_dn2"], curve["used"]
        caption = "Temporal variance by mean level; the slope is the gain."
        yield CaptionedFigure("photon-transfer", photon_transfer_figure(*levels, gain), caption)
    if part == "response":
        curve = report["response"]
        caption = "Level by light, both as shares of the largest one."
        yield CaptionedFigure("response", response_figure(curve["light"], curve["levels"]), caption)
        if "vignetting" in report:
            caption = "Relative light of the flat fields by image radius; fitted polynomials."
            yield CaptionedFigure("vignetting", vignetting_figure(report["vignetting"]), caption)
    if part == "sharpness":
        caption = "Edges by their image radius, with two standard deviations."
        figure = sharpness_figure(report["edges"], report["center_px"])
        yield CaptionedFigure("sharpness", figure, caption)
    if part == "timing" and "corners" not in report:
        figure = timing_figure(report["profile"][0], report["fitted"][0], report["lines"])
        yield CaptionedFigure("timing", figure, "Bands of the flickering lamp in the first frame.")
    elif part == "timing":
        pixels_px = np.array(report["corners"]["pixels_px"], dtype=np.float64)
        for key, name, title in (
            ("without_readout_px", "timing-global", "global shutter"),
            ("errors_px", "timing", "rolling shutter"),
        ):
            errors_px = np.array(report["corners"][key], dtype=np.float64)
            rms_px = float(np.sqrt(np.square(errors_px).sum(axis=1).mean()))
            figure = residual_figure(f"{title}: {rms_px:.3f} px RMS", size_px, pixels_px, errors_px)
            caption = f"Corners of the turning board minus their predictions: {title}."
            yield CaptionedFigure(name, figure, caption)
    if part == "geometry":
        keys = ("pixels_px", "errors_px")
        corners_px = (np.array(report["corners"][key], dtype=np.float64) for key in keys)
        title = f"{report['model']}: {report['rms_px']:.3f} px RMS"
        caption = "Corners minus their predictions: a pattern means a model misfit."
        yield CaptionedFigure("residuals", residual_figure(title, size_px, *corners_px), caption)
