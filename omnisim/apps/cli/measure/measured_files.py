"""Sensor files and reports of `omnisim measure`: values with their standard deviations, plots."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from omnisim.apps.cli.console import out, print_note, table
from omnisim.cameras import CentralCamera
from omnisim.core.arrays import Floats
from omnisim.core.errors import MeasurementError, SensorFileError
from omnisim.core.files.atomic_file import check_distinct, check_suffix, check_target, write_text
from omnisim.core.files.toml_file import Comment, read_tables, toml_text
from omnisim.measurement import Quantity, Unobservable
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.camera.sensor_file import extended_sensor

if TYPE_CHECKING:  # slow to import
    from omnisim.report.report import Section

PartReport = Mapping[str, Any]

_CAMERA = ("lens", "mirror", "optics", "camera")  # tables that state a camera


def check_outputs(output: Path, sensor: Path | None, **others: Path) -> None:
    """Check that a measurement's files can be written, before it starts.

    Args:
        output: sensor file to write; its report is written beside it.
        sensor: sensor file to complete, which may be `output`.
        others: further files to write, by their name in messages.
    """
    check_suffix(output, ".toml")
    check_target(output)
    written = {"the sensor file": output, "the report": report_path(output)}
    written |= {f"the {name}": path for name, path in others.items()}
    is_same = sensor is not None and sensor.resolve() == output.resolve()
    check_distinct(written, {"--sensor": None if is_same else sensor})
    read_reports(sensor)


def report_path(output: Path) -> Path:
    """Path of the report beside a sensor file."""
    return output.with_suffix(".json")


def sensor_tables(sensor: Path | None) -> dict[str, Any]:
    """Tables of a sensor file to complete, without values at their defaults; empty without a file.

    A file that states no camera, such as one of a measured response, gets none.
    """
    if sensor is None:
        return {}
    tables = tomllib.loads(OmniCamera.from_file(sensor).to_toml())
    if stated_camera(sensor) is None:
        tables = {key: table for key, table in tables.items() if key not in _CAMERA}
    return tables


def stated_camera(sensor: Path | None) -> CentralCamera | None:
    """Camera model of a sensor file; None without a file, or if the file states no camera."""
    if sensor is None:
        return None
    camera = OmniCamera.from_file(sensor)
    stated = extended_sensor(read_tables(sensor, SensorFileError), str(sensor))
    return camera.model if stated.keys() & set(_CAMERA) else None


def check_size(
    name: Path | str, size_px: tuple[int, int], camera: CentralCamera, sensor: Path | str
) -> None:
    """Check that images have the size, width and height, of a sensor file's camera."""
    wanted = camera.width_px, camera.height_px
    if size_px != wanted:
        wide, high = wanted
        expected = f"expected {wide} × {high} px as in {sensor}"
        raise MeasurementError(f"{name}: {size_px[0]} × {size_px[1]} px: {expected}")


class MeasureRequest(Protocol):
    """Request to measure a part of a camera."""

    @property
    def output(self) -> Path:
        """Sensor file to write."""

    @property
    def sensor(self) -> Path | None:
        """Sensor file to complete."""


def write_measured(
    part: str,
    request: MeasureRequest,
    tables: Mapping[str, Any],
    quantities: Sequence[Quantity],
    unobservable: Sequence[Unobservable],
    details: Mapping[str, Any],
) -> None:
    """Write a sensor file whose comments give the standard deviations, and a report as JSON.

    The reports of other parts, beside the completed sensor file, are kept. The measured quantities
    are printed as a table, and the reasons why others are missing as notes.

    Args:
        part: measured part, such as "noise": key of its report.
        unobservable: quantities that the images do not determine.
        details: further entries of the report, JSON values.
    """
    rows = [
        asdict(each) | {"sigma": each.sigma if math.isfinite(each.sigma) else None}
        for each in quantities
    ]
    missing = [asdict(each) for each in unobservable]
    report = {"quantities": rows, "not_measured": missing, **details}
    output, reports = request.output, {**read_reports(request.sensor), part: report}
    lines = [line for name, each in reports.items() for line in _comments(name, each)]
    write_text(output, toml_text({f"# {line}": Comment(line) for line in lines} | dict(tables)))
    write_text(report_path(output), json.dumps(reports, indent=2) + "\n")
    shown = table("", ">value", ">±", "unit", "from")
    for quantity in quantities:
        shown.add_row(quantity.name, *format_quantity(quantity), quantity.unit, quantity.basis)
    out.print(f"{output}: written")
    out.print(shown)
    for each in unobservable:
        print_note(f"{each.name} not measured: {each.reason}")


def mark_inputs(output: Path, part: str, digest: str) -> None:
    """Store a digest of a part's arguments and files in its report."""
    reports = read_reports(output)
    reports[part]["inputs"] = digest
    write_text(report_path(output), json.dumps(reports, indent=2) + "\n")


def read_reports(sensor: Path | None) -> dict[str, dict[str, Any]]:
    """Results by name of the part, from the report beside a sensor file; empty if it is missing."""
    path = None if sensor is None else report_path(sensor)
    if path is None or not path.exists():
        return {}
    try:
        reports = json.loads(path.read_text(encoding="utf-8"))
        for report in reports.values():
            names = [each.name for each in quantities_of(report)]
            names += [each.name for each in unobservable_of(report)]
            if not all(isinstance(name, str) for name in names):
                raise TypeError(names)
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        raise MeasurementError(f"{path}: expected a report of `omnisim measure`") from None
    return dict(reports)


def read_board_shape(sensor: Path) -> Floats | None:
    """Shape of the board in the report beside a sensor file, if there is one."""
    report, path = read_reports(sensor).get("geometry"), report_path(sensor)
    if report is None:
        return None
    try:
        shape = np.array(report["board_m"], dtype=np.float64)
    except (KeyError, ValueError, TypeError) as reason:
        raise MeasurementError(f"{path}: geometry: board_m: no positions: {reason}") from None
    if shape.ndim != 2 or shape.shape[1] != 3 or not np.isfinite(shape).all():
        raise MeasurementError(f"{path}: board_m: expected positions x, y, z of corners")
    return shape


def quantities_of(report: Mapping[str, Any]) -> list[Quantity]:
    """Measured quantities of a part's report."""
    rows = [
        row | {"sigma": math.nan} if row["sigma"] is None else row for row in report["quantities"]
    ]
    return [Quantity(**row) for row in rows]


def unobservable_of(report: Mapping[str, Any]) -> list[Unobservable]:
    """Quantities of a part's report that its images do not determine."""
    return [Unobservable(**row) for row in report["not_measured"]]


def _comments(part: str, report: Mapping[str, Any]) -> list[str]:
    """Comments of a sensor file about a part's quantities."""
    lines = []
    for quantity in quantities_of(report):
        if math.isfinite(quantity.sigma):
            number = f"{' ± '.join(format_quantity(quantity))} {quantity.unit}".rstrip()
            lines.append(f"{part}: {quantity.name} = {number} ({quantity.basis})")
    missing = unobservable_of(report)
    return lines + [f"{part}: {each.name} not measured: {each.reason}" for each in missing]


def round_to_sigma(value: float, sigma: float) -> float:
    """Value, rounded to a tenth of its standard deviation."""
    if not math.isfinite(sigma) or sigma <= 0.0:
        return float(f"{value:.6g}")
    return round(value, 1 - math.floor(math.log10(sigma))) + 0.0  # no -0


def format_quantity(quantity: Quantity) -> tuple[str, str]:
    """Value and standard deviation of a quantity, as text."""
    if not math.isfinite(quantity.sigma):
        return f"{quantity.value:z.3g}", ""
    return f"{round_to_sigma(quantity.value, quantity.sigma):.10g}", f"{quantity.sigma:.2g}"


def measured_sections(sensor: Path) -> list[Section]:
    """Section of each part that was measured, from the report beside a sensor file."""
    from omnisim.report.report import CaptionedFigure, ResultTable, Section

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
                tables += [ResultTable(*table) for table in _geometry_tables(report)]
            figures = [CaptionedFigure(*drawn) for drawn in _figures(part, report, camera)]
        except (KeyError, ValueError, TypeError, AttributeError):
            expected = "expected a report of `omnisim measure`"
            raise MeasurementError(f"{report_path(sensor)}: {part}: {expected}") from None
        sections.append(Section(part.capitalize(), tables=tables, figures=figures, key=part))
    return sections


def _geometry_tables(report: PartReport) -> Iterator[tuple[str, tuple[str, ...], Any]]:
    """Captions, columns and rows of the tables of models and images."""
    columns = ("model", "numbers", "RMS px", "held out px", "not fitted")
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
    yield "Camera models, the best one first.", columns, models
    images = tuple(
        (image["name"], str(image["corners"]), _pixels(image["rms_px"]))
        for image in report["images"]
    )
    yield "Images.", ("image", "corners", "RMS px"), images
    if rejected := tuple((image["name"], image["reason"]) for image in report["rejected_images"]):
        yield "Excluded images.", ("image", "reason"), rejected


def _pixels(value: float | None) -> str:
    return "–" if value is None or not math.isfinite(value) else f"{value:.3f}"


def _figures(part: str, report: PartReport, camera: OmniCamera) -> Iterator[tuple[str, Any, str]]:
    """Names, figures and captions of a part's plots."""
    from omnisim.plots import measured_plots as plots

    size_px = camera.model.width_px, camera.model.height_px
    if part == "noise":
        curve = report["photon_transfer"]
        (gain,) = (each.value for each in quantities_of(report) if each.name == "gain_e_per_dn")
        levels = curve["mean_dn"], curve["variance_dn2"], curve["used"]
        caption = "Temporal variance over mean level; the slope is the inverse of the gain in e/DN."
        yield "photon-transfer", plots.photon_transfer_figure(*levels, gain), caption
    if part == "response":
        curve = report["response"]
        caption = "Gray level over light, each relative to its maximum."
        yield "response", plots.response_figure(curve["light"], curve["levels"]), caption
        if "vignetting" in report:
            caption = (
                "Relative light of the flat fields over the image radius, with fitted polynomials."
            )
            yield "vignetting", plots.vignetting_figure(report["vignetting"]), caption
    if part == "sharpness":
        caption = "Edges over the image radius, ± two standard deviations."
        figure = plots.sharpness_figure(report["edges"], report["center_px"])
        yield "sharpness", figure, caption
    if part == "timing" and "corners" not in report:
        figure = plots.timing_figure(report["profile"][0], report["fitted"][0], report["lines"])
        yield "timing", figure, "Bands of the flickering lamp in the first frame."
    elif part == "timing":
        pixels_px = np.array(report["corners"]["pixels_px"], dtype=np.float64)
        for key, name, title in (
            ("without_readout_px", "timing-global", "global shutter"),
            ("errors_px", "timing", "rolling shutter"),
        ):
            errors_px = np.array(report["corners"][key], dtype=np.float64)
            rms_px = float(np.sqrt(np.square(errors_px).sum(axis=1).mean()))
            figure = plots.residual_figure(
                f"{title}: {rms_px:.3f} px RMS", size_px, pixels_px, errors_px
            )
            caption = f"Corners of the turning board minus their predictions: {title}."
            yield name, figure, caption
    if part == "geometry":
        keys = ("pixels_px", "errors_px")
        corners_px = (np.array(report["corners"][key], dtype=np.float64) for key in keys)
        title = f"{report['model']}: {report['rms_px']:.3f} px RMS"
        caption = "Corners minus their predictions: a pattern means a model misfit."
        yield "residuals", plots.residual_figure(title, size_px, *corners_px), caption
