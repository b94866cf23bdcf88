"""Mask of an image's pixels that show the scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, HyperbolicCamera, NonCentralCamera, pixel_grid
from omnisim.cameras.mirrors.mirror_mesh import sectors_and_rings
from omnisim.cameras.mirrors.mirror_mesh_rays import inside_rim

BLOCK_PIXELS = 1 << 20  # pixels per step, to bound the memory of intermediate arrays


def valid_mask(camera: CentralCamera, polygons: int | None) -> NDArray[np.bool_]:
    """Mask (height, width) of the pixels whose center shows the scene.

    Args:
        camera: camera of the image.
        polygons: polygons of the mirror mesh; None: exact.

    Raises:
        OpticsError: the polygon count does not make a mesh.
    """
    if polygons is not None and isinstance(camera, NonCentralCamera):
        from omnisim.cameras.optics.mesh_rays import MeshRays  # imported late: few cameras need it

        pixels = pixel_grid(camera.width_px, camera.height_px)
        return MeshRays(camera, polygons).ray_from_pixel(pixels).valid
    sectors = None
    if polygons is not None and isinstance(camera, HyperbolicCamera):
        sectors, _ = sectors_and_rings(polygons)
    mask = np.empty((camera.height_px, camera.width_px), dtype=np.bool_)
    step = max(1, BLOCK_PIXELS // camera.width_px)
    for first in range(0, camera.height_px, step):
        rows = mask[first : first + step]
        pixels = pixel_grid(camera.width_px, len(rows)) + (0.0, first)
        if sectors is not None and isinstance(camera, HyperbolicCamera):
            rows[:] = inside_rim(camera, sectors, pixels)
        else:
            rows[:] = camera.ray_from_pixel(pixels).valid
    return mask
