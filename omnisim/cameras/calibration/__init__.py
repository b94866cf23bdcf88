"""Calibrations of cameras: files of other tools in and out, and fits from one model to another.

`load_calibration` reads a file, `save_calibration` writes one; README.md has formats, conventions,
and how to add a format. Modules import in one direction: the base of the formats, the formats,
their registry, reading and encoding, `calibration` and `rig`, which this package offers.
"""

from omnisim.cameras.calibration.calibrated_camera import (
    CalibratedCamera,
    NamedPose,
    Residuals,
    find_pose,
)
from omnisim.cameras.calibration.calibration import (
    Calibration,
    calibration_of,
    calibration_text,
    check_calibration_suffix,
    load_calibration,
    save_calibration,
)
from omnisim.cameras.calibration.calibration_formats import FORMATS
from omnisim.cameras.calibration.rig import Rig, RigCamera

__all__ = [
    "FORMATS",
    "CalibratedCamera",
    "Calibration",
    "NamedPose",
    "Residuals",
    "Rig",
    "RigCamera",
    "calibration_of",
    "calibration_text",
    "check_calibration_suffix",
    "find_pose",
    "load_calibration",
    "save_calibration",
]
