"""Non-central optical systems: mirrors of any profile, misalignment, and underwater ports."""

from omnisim.cameras.central_error import CentralError
from omnisim.cameras.optics.boards.board_corners import BoardCorners, read_corners, write_corners
from omnisim.cameras.optics.boards.calibrate import SystemCalibration, calibrate_system
from omnisim.cameras.optics.central_view import CentralView, fit_central
from omnisim.cameras.optics.centrality import (
    Centrality,
    caustic_points,
    common_point,
    measure_centrality,
    pixel_jacobians,
    ray_jacobians,
)
from omnisim.cameras.optics.design import Design
from omnisim.cameras.optics.surface import Fate, Rod, Surface, TracedRays
from omnisim.cameras.optics.system import OpticalSystem
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
