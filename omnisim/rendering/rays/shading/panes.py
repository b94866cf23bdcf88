"""Reflectance and transmittance of thin panes of glass.

One surface represents both interfaces of a pane. They are parallel and close together, so rays pass
straight through.

Sources: Fresnel's equations for unpolarized light, at each interface, with reflectance r; all
reflections between the two sum to 2 r / (1 + r) (Pharr, Jakob and Humphreys, "Physically Based
Rendering", 4th edition, section 11.5.4, "thin dielectrics"); KHR_materials_transmission, for the
tint.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.rays.shading.glass import interface_reflectance
from omnisim.scene.model import Material

Floats = NDArray[np.floating]


class Panes(NamedTuple):
    """Pane parameters of a scene's surfaces.

    Attributes:
        transmission: (surfaces,) transmitted share of the light that is not reflected; 0: no pane.
        ior: (surfaces,) refractive index.
        depths: (surfaces, 3) optical depths of slabs, see `SlabMaterial`.
    """

    transmission: NDArray[np.float64]
    ior: NDArray[np.float64]
    depths: NDArray[np.float64]

    @classmethod
    def of(cls, materials: list[Material]) -> Panes:
        """Pane parameters of materials, one per surface; metal transmits nothing."""
        shares = [material.pane_transmission for material in materials]
        depths = np.array([material.optical_depths for material in materials]).reshape(-1, 3)
        return cls(np.array(shares), np.array([material.ior for material in materials]), depths)

    def transmitted(
        self, surfaces: NDArray[np.int32], colors: Floats, cosines: Floats
    ) -> NDArray[np.float32]:
        """Transmittance (n, 3), linear RGB.

        Args:
            surfaces: (n,) surface indices.
            colors: (n, 3) base colors, linear RGB.
            cosines: (n,) cosines of the angles of incidence.
        """
        passing = 1.0 - pane_reflectance(cosines, self.ior[surfaces])
        passing = passing * self.transmission[surfaces]
        return (passing[:, None] * colors).astype(np.float32)

    def slab_colors(
        self, surfaces: NDArray[np.int32], colors: Floats, cosines: Floats
    ) -> NDArray[np.float64]:
        """Tint (n, 3) of both faces of slabs and of the glass between, see `transmitted`."""
        inside = np.sqrt(1.0 - (1.0 - cosines**2) / self.ior[surfaces] ** 2)
        left = np.exp(-self.depths[surfaces] / np.maximum(inside, 1e-4)[:, None])
        return colors.astype(np.float64) ** 2 * left


def pane_reflectance(cosines: Floats, ior: Floats) -> Floats:
    """Reflectance (n,) of panes by the cosines (n,) of the angles of incidence."""
    once = interface_reflectance(cosines, ior)
    return 2.0 * once / (1.0 + once)
