"""`omnisim calibration check`."""

from __future__ import annotations

import json
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.markup import escape

from omnisim.apps.cli.cameras.calibration import headline, read_calibration
from omnisim.apps.cli.cameras.requests import CalibrationCheckRequest
from omnisim.apps.cli.console import out, print_note, table, wrapped
from omnisim.apps.cli.measure.measured_files import check_size
from omnisim.cameras import CentralCamera
from omnisim.cameras.calibration import calibration_check as checks
from omnisim.core.errors import CalibrationError, NoticeWarning
from omnisim.core.extras import require_extra
from omnisim.core.files.atomic_file import check_distinct, check_target

SHOWN_CAMERAS = 8
_COLORS = {checks.OK: "green", checks.UNUSUAL: "yellow", checks.WRONG: "bold red"}


class _CheckedCamera(NamedTuple):
    camera: CentralCamera
    findings: list[checks.Finding]
    others: list[checks.OtherFormats]


def check(request: CalibrationCheckRequest) -> bool:
    """Print findings and formats, and write the plots; return whether nothing is wrong."""
    folder, images = request.output, request.images or []
    if images and folder is None:
        raise CalibrationError(f"-o: missing: expected a folder for the plot of {images[0]}")
    if folder is not None:
        require_extra("plots", "-o of omnisim calibration check")
        check_target(folder / "check.png")
        check_distinct({f"the plot of {path}": _plot_of(path, folder) for path in images}, {})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NoticeWarning)  # notes are findings
        name = request.camera_name
        read = read_calibration(request.source, name, request.format, request.mirrored)
    if images and len(read.cameras) > 1:
        expected = f"expected one of {', '.join(read.names)}, which took {images[0]}"
        raise CalibrationError(f"--camera-name: missing: {expected}")
    if len(read.cameras) > SHOWN_CAMERAS:
        shown = f"the first {SHOWN_CAMERAS} of {len(read.cameras)} cameras are checked"
        print_note(f"{request.source}: {shown}; --camera-name selects another")
    cameras = {
        each.name: _CheckedCamera(
            each.camera, checks.check_camera(each), checks.other_formats(each)
        )
        for each in read.cameras[:SHOWN_CAMERAS]
    }
    rig = checks.check_rig(read)
    plots = [] if folder is None else _write_plots(folder, cameras, images, read.source)
    findings = [finding for each in cameras.values() for finding in each.findings] + rig
    statuses = [finding.status for finding in findings]
    if request.json:
        content: dict[str, Any] = {"file": read.source, "format": read.format, "tool": read.tool}
        content["cameras"] = {name: _content(each) for name, each in cameras.items()}
        content["rig"] = [finding._asdict() for finding in rig]
        content["plots"] = list(map(str, plots))
        out.print(json.dumps(content, indent=1, ensure_ascii=False))
        return checks.WRONG not in statuses
    out.print(headline(read))
    for name, each in cameras.items():
        size = f"{each.camera.width_px} × {each.camera.height_px} px"
        out.print(f"\n{name}: {each.camera.model_name}, {size}", style="bold")
        _print_findings(each.findings)
        _print_formats(each.others)
    if rig:
        out.print("\nfile and rig", style="bold")
        _print_findings(rig)
    out.print("\n" + ", ".join(f"{statuses.count(each)} {each}" for each in _COLORS))
    for path in plots:
        out.print(f"{path}: plot")
    return checks.WRONG not in statuses


def _plot_of(image: Path, folder: Path) -> Path:
    return folder / f"{image.stem}-lines.png"


def _write_plots(
    folder: Path, cameras: dict[str, _CheckedCamera], images: Sequence[Path], source: str
) -> list[Path]:
    from omnisim.measurement.inputs.recorded_frames import read_photo
    from omnisim.plots.calibration_plot import check_figure, lines_figure
    from omnisim.plots.style import write_plot

    camera = next(iter(cameras.values())).camera
    photos = [read_photo(path) for path in images]
    for path, photo in zip(images, photos, strict=True):
        check_size(path, (photo.shape[1], photo.shape[0]), camera, source)
    write_plot(folder / "check.png", check_figure(cameras))
    for path, photo in zip(images, photos, strict=True):
        write_plot(_plot_of(path, folder), lines_figure(path.name, photo, camera))
    return [folder / "check.png", *(_plot_of(path, folder) for path in images)]


def _print_findings(findings: Sequence[checks.Finding]) -> None:
    wide = max(len(finding.subject) for finding in findings)
    for status, subject, text, remedy in findings:
        head = f"{status:9}{subject:{wide}}  "
        line = wrapped(text + (f": {remedy}" if remedy else ""), head)[len(status) :]
        out.print(f"[{_COLORS[status]}]{status}[/]{escape(line)}", markup=True)


def _print_formats(others: Sequence[checks.OtherFormats]) -> None:
    shown = table("model", ">RMS", ">at most", "in the formats")
    for each in others:
        sizes = ["", "exact" if each.is_exact else "–"]
        if each.residuals is not None:
            fit = each.residuals
            sizes = [checks.pixels_text(value) for value in (fit.rms_px, fit.max_px)]
        note = f": {each.note}" if each.note else ""
        shown.add_row(each.model or "none", *sizes, ", ".join(each.formats) + note)
    out.print(shown)


def _content(checked: _CheckedCamera) -> dict[str, Any]:
    """Findings and formats of a camera, for programs."""
    formats = [
        {
            "formats": each.formats, "model": each.model or None, "is_exact": each.is_exact,
            "rms_px": each.residuals and each.residuals.rms_px,
            "max_px": each.residuals and each.residuals.max_px, "note": each.note,
        }
        for each in checked.others
    ]  # fmt: skip
    findings = [finding._asdict() for finding in checked.findings]
    return {"model": checked.camera.model_name, "findings": findings, "formats": formats}
