"""Lateral chromatic aberration: red-blue offset of distant points, in pixels."""

from __future__ import annotations

import numpy as np

from omnisim.cameras.optics.centrality import seen_rays
from omnisim.cameras.optics.shapes.shape import Floats
from omnisim.cameras.optics.system import OpticalSystem


def lateral_color_px(system: OpticalSystem) -> Floats:
    """Distances (n,) in pixels between the R and B images of points at infinity.

    The points are spread evenly over the image. The result is empty for systems of mirrors alone,
    which do not refract; points that are not seen in both colors are omitted.

    Raises:
        OpticsError: no pixel sees anything.
    """
    if all(surface.is_mirror for surface in system.surfaces):
        return np.empty(0)
    directions = seen_rays(system).directions
    red, blue = (
        one.pixel_from_ray(directions) for one in (system.of_color("R"), system.of_color("B"))
    )
    apart: Floats = np.linalg.norm(red.positions_px - blue.positions_px, axis=1)
    return apart[red.valid & blue.valid]
