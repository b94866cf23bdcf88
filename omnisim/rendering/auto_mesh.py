"""Choice of a mirror mesh's polygons that keeps the image error below 0.1 px."""

from __future__ import annotations

import numpy as np

from omnisim.cameras import CentralCamera, HyperbolicCamera, NonCentralCamera
from omnisim.cameras.mirrors.mirror_mesh import (
    MAX_POLYGONS,
    Annulus,
    largest_error,
    needed_polygons,
    sectors_and_rings,
)

MAX_ERROR_PX = 0.1
# Rasterizers snap vertices to a grid of this size, which adds to the mesh's own error.
_RASTER_STEP_PX = 1.0 / 256.0
_MAX_TRACED_POLYGONS = 1 << 18  # above, an optical system's mesh takes longer than exact rays


def auto_polygons(camera: CentralCamera) -> int | None:
    """Minimum number of polygons with an error of at most `MAX_ERROR_PX` anywhere in the image.

    Returns:
        None: exact rays, because no mesh is fine enough or the camera has no mirror mesh.
    """
    limit = max_polygons(camera)
    if limit is None:
        return None
    if isinstance(camera, HyperbolicCamera):
        max_error = (MAX_ERROR_PX - _RASTER_STEP_PX) / camera.focal_length_px
        return needed_polygons(camera.mirror, max_error, _shown(camera))
    from omnisim.cameras.optics.mesh_error import SystemMeshErrors  # few cameras have one

    return SystemMeshErrors(camera).needed_polygons(MAX_ERROR_PX, limit)


def max_polygons(camera: CentralCamera) -> int | None:
    """Maximum number of polygons chosen for a camera; None: it has no mirror mesh."""
    if isinstance(camera, HyperbolicCamera):
        return MAX_POLYGONS
    if not isinstance(camera, NonCentralCamera):
        return None
    from omnisim.cameras.optics.mesh_rays import has_mesh

    return _MAX_TRACED_POLYGONS if has_mesh(camera) else None


def mesh_error_px(camera: CentralCamera, polygons: int | None) -> float:
    """Largest mesh error in the image, outline and rasterization included; exact: 0."""
    if polygons is not None and isinstance(camera, NonCentralCamera):
        from omnisim.cameras.optics.mesh_error import SystemMeshErrors

        return SystemMeshErrors(camera).of(polygons).max_px
    if polygons is None or not isinstance(camera, HyperbolicCamera):
        return 0.0
    error = largest_error(camera.mirror, *sectors_and_rings(polygons), _shown(camera))
    return camera.focal_length_px * error + _RASTER_STEP_PX


def _shown(camera: HyperbolicCamera) -> Annulus:
    """Circles around the mirror's axis that enclose the image; radii in focal lengths."""
    first = -0.5 - np.asarray(camera.principal_point_px)
    last = first + (camera.width_px, camera.height_px)
    nearest = np.clip(0.0, first, last)
    farthest = np.maximum(-first, last)
    inner, outer = np.hypot(*nearest), np.hypot(*np.abs(farthest))
    return Annulus(float(inner) / camera.focal_length_px, float(outer) / camera.focal_length_px)
