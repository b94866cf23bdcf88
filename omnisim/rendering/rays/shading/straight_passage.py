"""Light that passes glass straight: of shadow rays, and of the rays of bakes.

A body of glass counts as a slab: its front reflects what both interfaces reflect, each surface
tints the rest, and the way between them absorbs. The back of a single-sided pane does not count, as
in images.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.rays.shading.panes import pane_reflectance
from omnisim.rendering.rays.shading.shading import Shading, View


def straight_shares(
    shading: Shading, view: View, colors: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Shares (n, 3) of light that pass hits straight, linear RGB; 0 for all but panes and glass.

    Args:
        shading: appearance of the surfaces.
        view: rays (n,) and their hits on either side; all rays must hit.
        colors: (n, 3 or more) base colors.
    """
    shares = np.zeros((len(colors), 3), dtype=np.float32)
    surfaces = shading.surfaces(view.hits)
    some = np.flatnonzero(shading.is_pane[surfaces] | shading.is_glass[surfaces])
    if len(some) == 0:
        return shares
    rays, hits, poses, _ = view.take(some)
    surfaces, colors = surfaces[some], colors[some, :3]
    is_back, is_glass = ~shading.is_front(hits, poses), shading.is_glass[surfaces]
    cosines = np.abs(np.einsum("nc,nc->n", shading.normals(hits, poses), rays.directions))
    reflected = pane_reflectance(cosines, shading.panes.ior[surfaces])
    reflected[is_back & is_glass] = 0.0
    transmission = np.maximum(shading.panes.transmission, shading.glass.transmission)[surfaces]
    passed = ((1.0 - reflected) * transmission)[:, None] * colors
    leaving = np.flatnonzero(is_back & is_glass)
    inside_m = (hits.ranges_m - rays.near_m)[leaving]
    passed[leaving] *= shading.glass.attenuation(surfaces[leaving], inside_m)
    passed[is_back & ~is_glass & ~shading.is_double_sided[surfaces]] = 1.0
    shares[some] = passed
    return shares
