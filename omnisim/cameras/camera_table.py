"""Camera models read from tables in files; errors name file, key, value and expected value."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from omnisim.cameras import CAMERA_MODELS, CentralCamera, camera_from_parameters
from omnisim.cameras.camera import without_prefix
from omnisim.core.errors import CalibrationError, OpticsError, SensorFileError, did_you_mean

FIELDS = [model.__dataclass_fields__.keys() for model in CAMERA_MODELS.values()]


def camera_from_table(parameters: Mapping[str, Any], source: str, key: str) -> CentralCamera:
    """Build a camera from a table that holds its model and parameters, and nothing else.

    `source` and `key` name the file and its table, for messages.

    Raises:
        SensorFileError: the table is invalid; names the key and the expected value.
    """
    try:
        camera = camera_from_parameters(parameters)
    except OpticsError as reason:
        message, *others = map(without_prefix, str(reason).split("\n"))
        others = [line.removesuffix(": missing") for line in others if line.endswith(": missing")]
        missing, _, rest = message.partition(": missing")
        for name in parameters if missing != message and not rest else ():
            hint = did_you_mean(name, [missing])
            # a key that is misspelled, and no other key of a model
            if hint.startswith("did") and not any(name in fields for fields in FIELDS):
                message = f"{name}: unknown key; {hint}"
        if message.endswith(": missing"):
            message = f"{', '.join((message.removesuffix(': missing'), *others))}: missing"
        raise SensorFileError(f"{source}: {key}.{message}") from None
    known = camera.parameters()
    for name in parameters:
        if name not in known:
            hint = did_you_mean(name, known)
            raise SensorFileError(f"{source}: {key}.{name}: unknown key; {hint}")
    return camera


def camera_from_calibration(
    file: str,
    camera: str | None,
    keys: Mapping[str, Any],
    source: str,
    key: str,
    allowed: Sequence[str] = ("theta_max_deg",),
) -> CentralCamera:
    """Read the camera of a calibration file that a table names; by default the first.

    `file` is relative to `source`, the table's file, and `key` is the table's key in it. `keys` are
    the table's further keys, of which those `allowed` are valid.

    Raises:
        SensorFileError: the file or a key is invalid; names the key and the expected value.
    """
    from omnisim.cameras.calibration import load_calibration  # loads the formats only when needed

    has_it = "expected none with calibration, which states it"
    if "model" in keys:
        raise SensorFileError(f"{source}: {key}.model: {has_it}")
    mirrored, theta_max_deg = keys.get("mirrored"), keys.get("theta_max_deg")
    if mirrored is not None and type(mirrored) is not bool:
        raise SensorFileError(f"{source}: {key}.mirrored: expected true or false, got {mirrored!r}")
    path = Path(file) if file.startswith("catalog:") else Path(source).parent / file
    try:
        (found, *_) = load_calibration(path, None, camera, mirrored, theta_max_deg).cameras
    except CalibrationError as reason:
        of_key = str(reason).startswith("theta_max_deg")
        place = f"{source}: {key}{'.' if of_key else '.calibration: '}"
        raise SensorFileError(f"{place}{reason}") from None
    for other in sorted(keys.keys() - allowed):
        hint = f"unknown key with calibration; {did_you_mean(other, ('camera', *allowed))}"
        is_of_lens = any(other in fields for fields in FIELDS)
        raise SensorFileError(f"{source}: {key}.{other}: {has_it if is_of_lens else hint}")
    return found.camera
