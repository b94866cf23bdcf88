"""Non-central optical systems: mirrors of any profile, misalignment, and underwater ports."""

from omnisim.cameras.calibration.calibrated_camera import CentralError
from omnisim.cameras.optics.centrality import (
    Centrality,
    CentralView,
    caustic_points,
    common_point,
    fit_central,
    measure_centrality,
    pixel_jacobians,
    ray_jacobians,
)
from omnisim.cameras.optics.profiles import Design
from omnisim.cameras.optics.surface import Fate, Rod, Surface, TracedRays
from omnisim.cameras.optics.system import OpticalSystem
from omnisim.cameras.optics.system_calibration import (
    BoardCorners,
    SystemCalibration,
    calibrate_system,
    read_corners,
    write_corners,
)
from omnisim.cameras.optics.system_file import read_optics_file

__all__ = [
    "BoardCorners",
    "CentralError",
    "CentralView",
    "Centrality",
    "Design",
    "Fate",
    "OpticalSystem",
    "Rod",
    "Surface",
    "SystemCalibration",
    "TracedRays",
    "calibrate_system",
    "caustic_points",
    "common_point",
    "fit_central",
    "measure_centrality",
    "pixel_jacobians",
    "ray_jacobians",
    "read_corners",
    "read_optics_file",
    "write_corners",
]
