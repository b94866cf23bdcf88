"""Cameras of images and runs, from the parameters stored in their files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from omnisim.cameras import CentralCamera, camera_from_parameters
from omnisim.core.errors import OpticsError, SensorFileError


def camera_of_parameters(parameters: Mapping[str, Any]) -> CentralCamera:
    """Camera described by the `parameters()` of any camera, including an optical system.

    Raises:
        OpticsError: names the first faulty key, with the expected and the actual value.
    """
    if not isinstance(parameters, Mapping) or parameters.get("model") != "optics":
        return camera_from_parameters(parameters)
    from omnisim.cameras.optics.system_file import parse_optics  # few cameras need it

    _check_whole(parameters)
    try:
        return parse_optics(parameters, "camera")
    except SensorFileError as faults:
        raise OpticsError(str(faults).partition("\n")[0]) from None


def _check_whole(parameters: Mapping[str, Any]) -> None:
    """Refuse references to other files: an image or a run contains its whole camera."""
    surfaces = parameters.get("surfaces")
    tables = list(surfaces) if isinstance(surfaces, list | tuple) else []
    for table in (parameters.get("camera"), *tables):
        for key in ("calibration", "file"):
            if isinstance(table, Mapping) and key in table:
                raise OpticsError(f"camera: {key}: expected its content, got {table[key]!r}")
