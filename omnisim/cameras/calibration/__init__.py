"""Camera calibrations: read and write other tools' files, and fit one model to another.

`load_calibration` reads a file and `save_calibration` writes one. README.md lists the formats and
conventions, and explains how to add a format. Imports point in one direction: the base class of
formats, the formats, their registry, encoding, then `calibration`, which this package exports.
"""

from omnisim.cameras.calibration.calibrated_camera import (
    CalibratedCamera,
    NamedPose,
    Residuals,
    find_pose,
)
from omnisim.cameras.calibration.calibration import (
    Calibration,
    Rig,
    RigCamera,
    calibration_of,
    calibration_text,
    check_calibration_suffix,
    load_calibration,
    save_calibration,
)
from omnisim.cameras.calibration.calibration_formats import FORMATS

__all__ = [
    "FORMATS", "CalibratedCamera", "Calibration", "NamedPose", "Residuals", "Rig", "RigCamera",
    "calibration_of", "calibration_text", "check_calibration_suffix", "find_pose",
    "load_calibration", "save_calibration",
]  # fmt: skip
