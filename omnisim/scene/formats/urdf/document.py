"""Detection of URDF among XML files."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from xml.etree.ElementTree import ParseError, iterparse


def is_urdf(path: Path) -> bool:
    """True for a file with a `<robot>` root."""
    with path.open("rb") as file, suppress(ParseError, StopIteration, ValueError, LookupError):
        _, root = next(iterparse(file, ("start",)))
        return bool(root.tag == "robot")
    return False
