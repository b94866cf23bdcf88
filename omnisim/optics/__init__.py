"""Optical systems that need no single viewpoint: mirrors of any profile, misaligned, and ports."""

from omnisim.optics.surface import Rod, Surface
from omnisim.optics.system import OpticalSystem
from omnisim.optics.tracing import Fate, TracedRays

__all__ = ["Fate", "OpticalSystem", "Rod", "Surface", "TracedRays"]
