"""Where commands take a calibration from: a calibration file, a sensor file, or a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.console import Console

from omnisim.calibration import Calibration, calibration_of, load_calibration
from omnisim.cameras import camera_from_parameters
from omnisim.errors import CalibrationError, OmnisimError
from omnisim.image_files import EIGHT_BIT_SUFFIXES, FLOAT_SUFFIXES, read_image
from omnisim.sensors import OmniCamera


def read_calibration(
    path: Path, name: str | None, format: str | None, mirrored: bool | None, err: Console
) -> Calibration:
    """The calibration that a file is, or that a sensor file or picture has.

    Prints its notes.

    Raises:
        OmnisimError: naming the file, the key and what was wanted.
    """
    suffix = path.suffix.lower()
    if format is None and (suffix == ".toml" or suffix in EIGHT_BIT_SUFFIXES + FLOAT_SUFFIXES):
        if name is not None:
            raise CalibrationError(f"--camera-name {name}: {path} has one camera, without a name")
        camera = OmniCamera.from_file(path).model if suffix == ".toml" else _of_picture(path)
        found = calibration_of(camera, "camera")
        return Calibration(found.cameras, "omnisim", str(path))
    found = load_calibration(path, format, name, mirrored)
    for note in found.notes:
        err.print("note: ", note, sep="", markup=False)
    return found


def first_camera(calibration: Calibration, name: str | None, err: Console) -> Calibration:
    """The calibration with one camera: the one that is asked for, or the first, which is said.

    Raises:
        CalibrationError: there is no camera of that name.
    """
    if name is None and len(calibration.cameras) > 1:
        names = ", ".join(calibration.names)
        err.print(
            f"note: {calibration.source}: the first of {len(calibration.cameras)} cameras, "
            f"{calibration.names[0]}: --camera-name takes another of {names}",
            markup=False,
        )
    return calibration.only(name or calibration.names[0])


def _of_picture(path: Path) -> Any:
    _, metadata = read_image(path)
    told = None if metadata is None else metadata.get("camera")
    if not isinstance(told, dict):
        raise CalibrationError(f"{path}: does not say what camera took it: want omnisim's picture")
    try:
        return camera_from_parameters(told)
    except OmnisimError as reason:
        raise CalibrationError(f"{path}: {reason}") from None
