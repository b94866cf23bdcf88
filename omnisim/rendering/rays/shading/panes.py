"""Thin panes of glass: what they reflect and transmit, by both of their interfaces.

A surface stands for the whole pane. Rays pass it straight: its faces are parallel, and thin.

Source: Fresnel's equations for unpolarized light, at each interface; the sum of all reflections
between the two is 2 r / (1 + r) (Pharr, Jakob and Humphreys, "Physically Based Rendering", 4th
edition, section 11.5.4, "thin dielectrics"); KHR_materials_transmission, for the tint.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.model import Material

Floats = NDArray[np.floating]


class Panes(NamedTuple):
    """Panes among the surfaces of a scene.

    Attributes:
        transmission: (surfaces,) share of the light that is not reflected and passes; 0: no pane.
        ior: (surfaces,) refractive index.
    """

    transmission: NDArray[np.float64]
    ior: NDArray[np.float64]

    @classmethod
    def of(cls, materials: list[Material]) -> Panes:
        """Panes of the surfaces' materials; metal transmits nothing."""
        shares = [0.0 if m.unlit else m.transmission * (1.0 - m.metallic) for m in materials]
        return cls(np.array(shares), np.array([material.ior for material in materials]))

    def transmitted(
        self, surfaces: NDArray[np.int32], colors: Floats, cosines: Floats
    ) -> NDArray[np.float32]:
        """Shares (n, 3) of light that pass surfaces (n,) of base colors (n, 3), by cosines (n,)."""
        passing = 1.0 - pane_reflectance(cosines, self.ior[surfaces])
        passing = passing * self.transmission[surfaces]
        shares: NDArray[np.float32] = (passing[:, None] * colors).astype(np.float32)
        return shares


def pane_reflectance(cosines: Floats, ior: Floats) -> Floats:
    """Share (n,) of light that a pane reflects, by the cosines (n,) of the angle of incidence."""
    cosines = np.clip(cosines, 1e-4, 1.0).astype(np.float64)
    inside = np.sqrt(np.maximum(1.0 - (1.0 - cosines**2) / ior**2, 0.0))
    across = ((cosines - ior * inside) / (cosines + ior * inside)) ** 2
    along = ((inside - ior * cosines) / (inside + ior * cosines)) ** 2
    once = 0.5 * (across + along)
    reflected: Floats = 2.0 * once / (1.0 + once)
    return reflected
