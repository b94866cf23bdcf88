"""Cameras of pictures and runs, by the parameters that their files hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from omnisim.cameras import CentralCamera, camera_from_parameters


def camera_of_parameters(parameters: Mapping[str, Any]) -> CentralCamera:
    """Camera that any camera's `parameters()` describes, an optical system's among them.

    Raises:
        OmnisimError: naming the key, the expected value and its own.
    """
    if isinstance(parameters, Mapping) and parameters.get("model") == "optics":
        from omnisim.optics.system_file import parse_optics  # few cameras are one

        return parse_optics(parameters, "camera")
    return camera_from_parameters(parameters)
