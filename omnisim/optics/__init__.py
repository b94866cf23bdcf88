"""Optical systems that need no single viewpoint: mirrors of any profile, misaligned, and ports."""

from omnisim.optics.caustic import caustic_points, pixel_jacobians, ray_jacobians
from omnisim.optics.centrality import CentralError, Centrality, common_point, measure_centrality
from omnisim.optics.design import Design
from omnisim.optics.surface import Rod, Surface
from omnisim.optics.system import OpticalSystem
from omnisim.optics.system_file import read_optics_file
from omnisim.optics.tracing import Fate, TracedRays

__all__ = [
    "CentralError",
    "Centrality",
    "Design",
    "Fate",
    "OpticalSystem",
    "Rod",
    "Surface",
    "TracedRays",
    "caustic_points",
    "common_point",
    "measure_centrality",
    "pixel_jacobians",
    "ray_jacobians",
    "read_optics_file",
]
