"""Which pixels of a picture show the scene."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, HyperbolicCamera, pixel_grid
from omnisim.mirrors.tessellation import sectors_and_rings


def covered_pixels(camera: CentralCamera, polygons: int | None) -> NDArray[np.bool_]:
    """Mask (height, width) of the pixels that are sure to show the scene.

    Args:
        camera: the camera.
        polygons: of the mirror's mesh, or None: captured exactly. A mesh's outline is a polygon
            with its corners on the rim: what is inside the circle that fits into it counts.

    Raises:
        OpticsError: a polygon count that makes no mesh.
    """
    pixels = pixel_grid(camera.width_px, camera.height_px)
    covered = camera.ray_from_pixel(pixels).valid
    if polygons is not None and isinstance(camera, HyperbolicCamera):
        sectors, _ = sectors_and_rings(polygons)
        inner_radius_px = camera.rim_radius_px * math.cos(math.pi / sectors)
        radii_px = np.linalg.norm(pixels - camera.principal_point_px, axis=-1)
        covered &= radii_px <= inner_radius_px
    return covered
