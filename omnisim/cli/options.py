"""From the words of options to what they mean, and from counts to words."""

from __future__ import annotations

from pathlib import Path

from omnisim.errors import OpticsError
from omnisim.sensors import OmniCamera
from omnisim.sensors.degradations import Degradation, preset


def read_sensor(path: Path | None) -> OmniCamera:
    """The sensor of a file, or the paper's.

    Raises:
        SensorFileError: naming file, key, value and what was wanted.
    """
    return OmniCamera() if path is None else OmniCamera.from_file(path)


def read_preset(name: str | None) -> Degradation | None:
    """The degradations of a preset, or None: as the sensor file says.

    Raises:
        SensorFileError: there is no such preset, or its file has a fault.
    """
    return None if name is None else preset(name)


def parse_polygons(text: str) -> int | None:
    """A polygon count, or None for "exact".

    Raises:
        OpticsError: neither a whole number nor "exact".
    """
    if text.lower() == "exact":
        return None
    try:
        return int(text)
    except ValueError:
        raise OpticsError(f"-n {text}: want a number of polygons or 'exact'") from None


def counted(count: int, thing: str) -> str:
    """A count with its noun: 1 step, 2 steps."""
    return f"{count} {thing}{'' if count == 1 else 's'}"
