"""`omnisim optics calibrate`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from omnisim.apps.cli.cameras.requests import OpticsCalibrateRequest
from omnisim.apps.cli.console import out, pluralize
from omnisim.cameras.optics.boards.board_corners import read_corners
from omnisim.cameras.optics.boards.calibrate import SystemCalibration, calibrate_system
from omnisim.cameras.optics.shapes.shape import Floats
from omnisim.cameras.optics.system_file import parse_optics, read_optics_tables
from omnisim.core.files.atomic_file import check_distinct, check_suffix, check_target, write_text
from omnisim.core.files.toml_file import Comment, toml_text
from omnisim.core.short_repr import number_text


def calibrate(request: OpticsCalibrateRequest) -> None:
    """Fit an optical system to corners, write it, and print parameters and residuals."""
    check_suffix(request.output, ".toml")
    check_target(request.output)
    check_distinct(
        {"what is written": request.output},
        {"the optics file": request.system, "the corners' file": request.corners},
    )
    file = read_optics_tables(request.system)
    parse_optics(*file)  # reports faults with the names of the keys
    keys = [key.strip() for key in request.free.split(",")]
    boards = read_corners(request.corners)
    fit = calibrate_system(file.table, keys, boards, file.source)
    corners = sum(len(board.points_m) for board in boards)
    summary = (
        f"{pluralize(len(boards), 'image')}, {pluralize(corners, 'corner')}: RMS "
        f"{number_text(_rms(fit.before_px), 3)} px before, "
        f"{number_text(_rms(fit.errors_px), 3)} px after, at most "
        f"{number_text(np.linalg.norm(fit.errors_px, axis=1).max(), 3)} px"
    )
    write_text(request.output, _text(request, fit, summary))
    out.print(f"{request.output}: {summary}", markup=False)
    shown = Table(box=None, pad_edge=False)
    for heading in ("", "before", "fitted", "±"):
        shown.add_column(heading, justify="right" if heading else "left")
    for one in fit.parameters:
        values = (number_text(value, 6, 9) for value in (one.before, one.value))
        shown.add_row(one.name, *values, number_text(one.sigma, 2, 9))
    out.print(shown)


def _rms(errors_px: Floats) -> float:
    """Root mean square of errors (n, 2) along each image axis, px."""
    return float(np.sqrt(np.mean(errors_px * errors_px)))


def _text(request: OpticsCalibrateRequest, fit: SystemCalibration, summary: str) -> str:
    """Text of the fitted optics file."""
    lines = [f"Fitted to {request.corners.name}: {summary}."]
    lines += [
        f"{one.name}: {number_text(one.value, 6, 9)} ± {number_text(one.sigma, 2, 9)}"
        for one in fit.parameters
    ]
    table = _beside(fit.table, request.system.parent, request.output.parent)
    return toml_text({f"# {line}": Comment(line) for line in lines} | table)


def _beside(table: dict[str, Any], old: Path, new: Path) -> dict[str, Any]:
    """Rebase the table's relative file names from the old folder to the new one."""

    def moved(part: dict[str, Any], key: str) -> dict[str, Any]:
        if not isinstance(part.get(key), str):
            return part
        return {**part, key: os.path.relpath(old / part[key], new)}

    if old.resolve() == new.resolve():
        return table
    surfaces = [moved(part, "file") for part in table["surfaces"]]
    return {**table, "camera": moved(table["camera"], "calibration"), "surfaces": surfaces}
