"""Names of sensors, which are also the names of their folders in a run."""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import AfterValidator

from omnisim.core.files.parameters import Name as Name

# No dots, which occur in the names of the run's own files.
FOLDER_NAME = re.compile(r"\w[\w -]{0,58}\w|\w")


def folder_name(name: str) -> str:
    """Replace a sensor name's invalid characters with `_`, to make it a valid folder name."""
    return re.sub(r"[^\w -]", "_", name)[:60].strip(" -") or "_"


def _check_folder_name(name: str) -> str:
    if not FOLDER_NAME.fullmatch(name):
        raise ValueError("expected letters, digits, _, and - or blanks between them, at most 60")
    return name


SensorName = Annotated[Name, AfterValidator(_check_folder_name)]
