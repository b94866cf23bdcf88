"""From the words of options to what they mean."""

from __future__ import annotations

from pathlib import Path

from omnisim.errors import OpticsError
from omnisim.sensors import OmniCamera


def read_sensor(path: Path | None) -> OmniCamera:
    """The sensor of a file, or the paper's.

    Raises:
        SensorFileError: naming file, key, value and what was wanted.
    """
    return OmniCamera() if path is None else OmniCamera.from_file(path)


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
