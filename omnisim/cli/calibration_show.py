"""`omnisim calibration show`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from omnisim.calibration import CalibratedCamera
from omnisim.cameras.domain import domain
from omnisim.cli.calibration_source import read_calibration


def run(
    source: Path,
    camera_name: str | None,
    format: str | None,
    mirrored: bool | None,
    out: Console,
    err: Console,
) -> None:
    """Show the cameras of a calibration file.

    Raises:
        OmnisimError: anything that the user can put right.
    """
    found = read_calibration(source, camera_name, format, mirrored, err)
    count = len(found.cameras)
    out.print(f"{source}: {found.format}, {count} camera{'' if count == 1 else 's'}", markup=False)
    for camera in found.cameras:
        table = Table(box=None, pad_edge=False, show_header=False, title=None)
        table.add_column(style="bold", no_wrap=True)
        table.add_column()
        for key, value in _rows(camera):
            table.add_row(key, value)
        out.print()
        out.print(camera.name, style="bold", markup=False)
        out.print(table)


def _rows(calibrated: CalibratedCamera) -> list[tuple[str, str]]:
    camera: Any = calibrated.camera
    told = camera.parameters()
    model = str(told.pop("model"))
    rows = [("model", model)]
    if calibrated.said_as not in (None, model):
        rows.append(("in the file", f"{calibrated.said_as}"))
    width, height = told.pop("width_px"), told.pop("height_px")
    rows.append(("picture", f"{width} × {height} px"))
    rows += [(_name(key), _value(key, value)) for key, value in told.items()]
    seen = domain(camera)
    down = ", from −z, as it looks into a mirror" if seen.axis[2] < 0.0 else ""
    across, upright = math.degrees(seen.horizontal_rad), math.degrees(seen.vertical_rad)
    rows.append(("field of view", f"{across:.1f}° × {upright:.1f}°"))
    rows.append(("largest θ", f"{math.degrees(seen.theta_max_rad):.2f}° in the picture{down}"))
    rows.append(("the model ends", _limit(camera, seen.theta_limit_rad)))
    rows.append(("valid pixels", f"{100.0 * seen.covered:.1f} %"))
    for pose in calibrated.poses[:8]:
        x, y, z = pose.target_from_source[:3, 3]
        rows.append((f"{pose.target}_from_{pose.source}", f"at ({x:.6g}, {y:.6g}, {z:.6g}) m"))
    if len(calibrated.poses) > 8:
        rows.append(("…", f"{len(calibrated.poses)} poses in all"))
    if calibrated.residual is not None:
        fit = calibrated.residual
        rows.append(
            (
                "fitted to",
                f"{fit.source_model}: RMS {fit.rms_px:.3g} px, at most {fit.max_px:.3g} px "
                f"within {math.degrees(fit.theta_max_rad):.1f}°",
            )
        )
    return rows


def _limit(camera: Any, limit_rad: float) -> str:
    lens = getattr(camera, "lens", camera)
    fold = getattr(lens, "fold_rad", math.inf)
    if limit_rad >= math.pi:
        return "nowhere: it could show all directions"
    at = f"at θ = {math.degrees(limit_rad):.2f}°"
    return f"{at}, where it folds" if abs(limit_rad - fold) < 1e-6 else at


def _name(key: str) -> str:
    for suffix in ("_px", "_deg"):
        key = key.removesuffix(suffix)
    return key.replace("_", " ")


def _value(key: str, value: Any) -> str:
    unit = " px" if key.endswith("_px") else "°" if key.endswith("_deg") else ""
    if isinstance(value, bool | str):
        return str(value).lower() if isinstance(value, bool) else value
    if isinstance(value, list | tuple):
        return ", ".join(f"{one:.10g}" for one in value) + unit
    return f"{value:.10g}{unit}"
