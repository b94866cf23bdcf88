"""Calibrations of cameras: files of other tools in and out, and fits from one model to another.

`load_calibration` reads a file, `save_calibration` writes one; README.md has formats, conventions,
and how to add a format.
"""

from omnisim.calibration.calibration import (
    CalibratedCamera,
    Calibration,
    Pose,
    Residual,
    calibration_of,
    find_pose,
)
from omnisim.calibration.formats import FORMATS
from omnisim.calibration.load import load_calibration
from omnisim.calibration.save import calibration_text, save_calibration

__all__ = [
    "FORMATS",
    "CalibratedCamera",
    "Calibration",
    "Pose",
    "Residual",
    "calibration_of",
    "calibration_text",
    "find_pose",
    "load_calibration",
    "save_calibration",
]
