"""Calibration files of other tools: one module a format, a `Format` in each."""

from omnisim.calibration.formats.basalt import BASALT
from omnisim.calibration.formats.camodocal import KITTI360
from omnisim.calibration.formats.colmap import COLMAP
from omnisim.calibration.formats.format import Format, Remarks, Said
from omnisim.calibration.formats.foxglove import FOXGLOVE
from omnisim.calibration.formats.gazebo import GAZEBO
from omnisim.calibration.formats.kalibr import KALIBR
from omnisim.calibration.formats.nerfstudio import NERFSTUDIO
from omnisim.calibration.formats.ocamcalib import OCAMCALIB
from omnisim.calibration.formats.opencv import OPENCV_FISHEYE, OPENCV_OMNIDIR, OPENCV_PINHOLE
from omnisim.calibration.formats.own import OWN
from omnisim.calibration.formats.ros import ROS
from omnisim.calibration.formats.woodscape import WOODSCAPE

# In the order in which a file is asked what it is.
FORMATS: dict[str, Format] = {
    one.name: one
    for one in (
        OWN,
        KALIBR,
        KITTI360,
        OPENCV_OMNIDIR,
        OPENCV_FISHEYE,
        OPENCV_PINHOLE,
        ROS,
        BASALT,
        WOODSCAPE,
        NERFSTUDIO,
        FOXGLOVE,
        OCAMCALIB,
        COLMAP,
        GAZEBO,
    )
}

__all__ = ["FORMATS", "Format", "Remarks", "Said"]
