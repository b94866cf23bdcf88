"""Shapes of mirrors and boundaries: surfaces of revolution in their own frames."""

from omnisim.cameras.optics.shapes.profiles import Asphere, Polynomial, TabulatedProfile
from omnisim.cameras.optics.shapes.quadrics import Cone, Conic, Hyperbolic, Plane
from omnisim.cameras.optics.shapes.shape import Shape

__all__ = [
    "Asphere",
    "Cone",
    "Conic",
    "Hyperbolic",
    "Plane",
    "Polynomial",
    "Shape",
    "TabulatedProfile",
]
