"""Lateral color: pixels by which red and blue of far points are apart."""

from __future__ import annotations

import numpy as np

from omnisim.cameras.optics.centrality import seen_rays
from omnisim.cameras.optics.shapes.shape import Floats
from omnisim.cameras.optics.system import OpticalSystem


def lateral_color_px(system: OpticalSystem) -> Floats:
    """Distances (n,) between the pixels of R and B that show what pixels show at infinity.

    Evenly over the image; empty for mirrors alone, which do not refract, and where not both
    colors are seen.

    Raises:
        OpticsError: no pixel sees anything.
    """
    if all(surface.is_mirror for surface in system.surfaces):
        return np.empty(0)
    directions = seen_rays(system).directions
    red, blue = (system.of_color(color).pixel_from_ray(directions) for color in "RB")
    apart: Floats = np.linalg.norm(red.positions_px - blue.positions_px, axis=1)
    return apart[red.valid & blue.valid]
