"""Camera models read from tables in files; errors name file, key, value and expected value."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from omnisim.cameras import CentralCamera, camera_from_parameters
from omnisim.core.errors import OpticsError, SensorFileError, did_you_mean


def camera_from_table(parameters: Mapping[str, Any], source: str, key: str) -> CentralCamera:
    """Build a camera from a table that holds its model and parameters, and nothing else.

    Args:
        parameters: model name and parameters by key.
        source: file name, for messages.
        key: key of the table in its file.

    Raises:
        SensorFileError: the table is invalid; names the key and the expected value.
    """
    try:
        camera = camera_from_parameters(parameters)
    except OpticsError as reason:
        message = str(reason).removeprefix("camera: ")
        raise SensorFileError(f"{source}: {key}.{message}") from None
    known = camera.parameters()
    for name in parameters.keys() - known.keys():
        hint = did_you_mean(name, known)
        raise SensorFileError(f"{source}: {key}.{name}: unknown key; {hint}")
    return camera
