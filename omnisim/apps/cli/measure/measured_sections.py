"""Sections of a camera's report: the measured numbers of each part, and their plots."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
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
    response_figure,
    sharpness_figure,
    timing_figure,
    vignetting_figure,
)
from omnisim.plots.plot_file import Figure
from omnisim.plots.residual_plot import residual_figure
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.report.report import CaptionedFigure, ResultTable, Section

PartReport = Mapping[str, Any]
_MODELS = ("model", "numbers", "RMS px", "held out px", "not fitted")


def measured_sections(sensor: Path) -> list[Section]:
    """Section of each part that was measured, from the report beside a sensor file.

    Raises:
        MeasurementError: the report is damaged.
        SensorFileError: a fault in the sensor file.
    """
    camera = OmniCamera.from_file(sensor)
    sections = []
    for part, report in read_reports(sensor).items():
        try:
            sections.append(_section(part, report, camera))
        except (KeyError, ValueError, TypeError, AttributeError):
            raise MeasurementError(
                f"{report_path(sensor)}: {part}: expected a report of `omnisim measure`"
            ) from None
    return sections


def _section(part: str, report: PartReport, camera: OmniCamera) -> Section:
    quantities, unobservable = quantities_of(report), unobservable_of(report)
    rows = tuple((one.name, *format_quantity(one), one.unit, one.basis) for one in quantities)
    tables = [
        ResultTable("Measured numbers.", ("name", "value", "±", "unit", "from"), rows),
    ]
    if unobservable:
        missing = tuple((one.name, one.reason) for one in unobservable)
        tables.append(ResultTable("Not measured.", ("name", "reason"), missing))
    if part == "geometry":
        tables += _geometry_tables(report)
    figures: list[CaptionedFigure] = []
    if part in _FIGURES:
        for name, (figure, caption) in _FIGURES[part](report, camera).items():
            figures.append(CaptionedFigure(name, figure, caption))
    return Section(part.capitalize(), tables=tables, figures=figures, key=part)


def _geometry_tables(report: PartReport) -> list[ResultTable]:
    models = tuple(
        (
            one["name"],
            str(one["parameters"]) if one["parameters"] else "–",
            _pixels(one["rms_px"]),
            _pixels(one["held_out_rms_px"]),
            str(one.get("reason", "")).removeprefix("camera: "),
        )
        for one in report["models"]
    )
    images = tuple(
        (one["name"], str(one["corners"]), _pixels(one["rms_px"])) for one in report["images"]
    )
    rejected = tuple((one["name"], one["reason"]) for one in report["rejected_images"])
    tables = [
        ResultTable("Camera models, the best one first.", _MODELS, models),
        ResultTable("Images.", ("image", "corners", "RMS px"), images),
    ]
    return tables + (
        [ResultTable("Images that were left out.", ("image", "reason"), rejected)]
        if rejected
        else []
    )


def _pixels(value: float | None) -> str:
    return "–" if value is None or not math.isfinite(value) else f"{value:.3f}"


Figures = dict[str, tuple[Figure, str]]


def _geometry_figures(report: PartReport, camera: OmniCamera) -> Figures:
    pixels_px, errors_px = (
        np.array(report["corners"][key], dtype=np.float64) for key in ("pixels_px", "errors_px")
    )
    size_px = camera.model.width_px, camera.model.height_px
    title = f"{report['model']}: {report['rms_px']:.3f} px RMS"
    figure = residual_figure(title, size_px, pixels_px, errors_px)
    return {
        "residuals": (figure, "Corners minus their predictions: a pattern means a model misfit.")
    }


def _noise_figures(report: PartReport, camera: OmniCamera) -> Figures:
    curve = report["photon_transfer"]
    (gain,) = (one.value for one in quantities_of(report) if one.name == "gain_e_per_dn")
    figure = photon_transfer_figure(curve["mean_dn"], curve["variance_dn2"], curve["used"], gain)
    return {"photon-transfer": (figure, "Temporal variance by mean level; the slope is the gain.")}


def _response_figures(report: PartReport, camera: OmniCamera) -> Figures:
    curve = report["response"]
    made: Figures = {
        "response": (
            response_figure(curve["light"], curve["levels"]),
            "Level by light, both as shares of the largest one.",
        )
    }
    if "vignetting" in report:
        made["vignetting"] = (
            vignetting_figure(report["vignetting"]),
            "Relative light of the flat fields by image radius, and the fitted polynomials.",
        )
    return made


def _sharpness_figures(report: PartReport, camera: OmniCamera) -> Figures:
    figure = sharpness_figure(report["edges"], report["center_px"])
    return {"sharpness": (figure, "Edges by their image radius, with two standard deviations.")}


def _timing_figures(report: PartReport, camera: OmniCamera) -> Figures:
    if "corners" in report:
        return _turning_figures(report["corners"], camera)
    figure = timing_figure(report["profile"][0], report["fitted"][0], report["lines"])
    return {"timing": (figure, "Bands of the flickering lamp in the first frame.")}


def _turning_figures(corners: PartReport, camera: OmniCamera) -> Figures:
    pixels_px = np.array(corners["pixels_px"], dtype=np.float64)
    size_px = camera.model.width_px, camera.model.height_px
    figures: Figures = {}
    for key, name, title in (
        ("without_readout_px", "timing-global", "global shutter"),
        ("errors_px", "timing", "rolling shutter"),
    ):
        errors_px = np.array(corners[key], dtype=np.float64)
        rms_px = float(np.sqrt(np.square(errors_px).sum(axis=1).mean()))
        figure = residual_figure(f"{title}: {rms_px:.3f} px RMS", size_px, pixels_px, errors_px)
        figures[name] = (figure, f"Corners of the turning board minus their predictions: {title}.")
    return figures


_FIGURES: Mapping[str, Callable[[PartReport, OmniCamera], Figures]] = {
    "geometry": _geometry_figures,
    "noise": _noise_figures,
    "response": _response_figures,
    "sharpness": _sharpness_figures,
    "timing": _timing_figures,
}
