"""`omnisim calibration convert`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from omnisim.atomic_file import check_distinct, check_target
from omnisim.calibration import FORMATS, CalibratedCamera, save_calibration
from omnisim.calibration.file_frame import looks_back
from omnisim.calibration.load import format_named
from omnisim.cli.calibration_source import first_camera, read_calibration


@dataclass(frozen=True)
class ConvertRequest:
    """The arguments of the command, as its help explains them."""

    source: Path
    to: str
    output: Path
    camera_name: str | None
    format: str | None
    model: str | None
    mirrored: bool | None


def run(request: ConvertRequest, out: Console, err: Console) -> None:
    """Write a calibration in another format and say how near it is.

    Raises:
        OmnisimError: anything that the user can put right.
    """
    form = format_named(request.to)
    check_target(request.output)
    check_distinct({"what is written": request.output}, {"the file to convert": request.source})
    found = read_calibration(
        request.source, request.camera_name, request.format, request.mirrored, err
    )
    if not form.several:
        found = first_camera(found, request.camera_name, err)
    written = save_calibration(found, request.output, request.to, request.model)
    out.print(f"{request.output}: {FORMATS[request.to].title}", markup=False)
    for before, after in zip(found.cameras, written.cameras, strict=True):
        out.print(f"  {_line(before, after)}", markup=False)
        for note in after.notes:
            err.print(f"note: {after.name}: {note}", markup=False)


def _is_mirror(camera: CalibratedCamera) -> bool:
    """Whether the file says a mirror by a lens."""
    return camera.mirrored or (
        camera.said_as != camera.camera.model_name and looks_back(camera.camera)
    )


def _line(before: CalibratedCamera, after: CalibratedCamera) -> str:
    same = before.name == after.name
    named = after.name if same else f"{after.name} (was {before.name})"
    residual = after.residual
    model = f"{after.said_as}{' in a mirrored frame' if _is_mirror(after) else ''}"
    if residual is None or residual is before.residual:
        return f"{named}: {model}, the same rays"
    return (
        f"{named}: {model}, fitted to {residual.source_model}: "
        f"RMS {residual.rms_px:.3g} px, at most {residual.max_px:.3g} px, "
        f"within {math.degrees(residual.theta_max_rad):.1f}° of the axis"
    )
