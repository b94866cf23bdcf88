"""Polygons of a mirror's mesh that keep the image right to a tenth of a pixel."""

from __future__ import annotations

import numpy as np

from omnisim.cameras import CentralCamera, HyperbolicCamera, NonCentralCamera
from omnisim.cameras.mirrors.mirror_mesh_error import Annulus, largest_error, needed_polygons
from omnisim.cameras.mirrors.tessellation import MAX_POLYGONS, sectors_and_rings

MAX_ERROR_PX = 0.1
# Rasterizers place a mesh's vertices in steps of as much: that comes on top of its own error.
_RASTER_STEP_PX = 1.0 / 256.0
_MAX_TRACED_POLYGONS = 1 << 18  # beyond, an optical system's mesh takes longer than exact rays


def auto_polygons(camera: CentralCamera) -> int | None:
    """Fewest polygons with an error of at most `MAX_ERROR_PX` anywhere in a camera's image.

    Returns:
        None: exact, as no mesh is fine enough, or there is no mirror with a mesh.
    """
    most = most_polygons(camera)
    if most is None:
        return None
    if isinstance(camera, HyperbolicCamera):
        max_error = (MAX_ERROR_PX - _RASTER_STEP_PX) / camera.focal_length_px
        return needed_polygons(camera.mirror, max_error, _shown(camera))
    from omnisim.cameras.optics.mesh_error import SystemMeshErrors  # few cameras have one

    return SystemMeshErrors(camera).needed_polygons(MAX_ERROR_PX, most)


def most_polygons(camera: CentralCamera) -> int | None:
    """Most polygons that are chosen for a camera; None: it has no mirror with a mesh."""
    if isinstance(camera, HyperbolicCamera):
        return MAX_POLYGONS
    if not isinstance(camera, NonCentralCamera):
        return None
    from omnisim.cameras.optics.mesh_rays import has_mesh

    return _MAX_TRACED_POLYGONS if has_mesh(camera) else None


def mesh_error_px(camera: CentralCamera, polygons: int | None) -> float:
    """Largest error of a mesh anywhere in a camera's image, with that of its outline and of
    rasterization; exact: 0."""  # fmt: skip
    if polygons is not None and isinstance(camera, NonCentralCamera):
        from omnisim.cameras.optics.mesh_error import SystemMeshErrors

        return SystemMeshErrors(camera).of(polygons).max_px
    if polygons is None or not isinstance(camera, HyperbolicCamera):
        return 0.0
    error = largest_error(camera.mirror, *sectors_and_rings(polygons), _shown(camera))
    return camera.focal_length_px * error + _RASTER_STEP_PX


def _shown(camera: HyperbolicCamera) -> Annulus:
    """Circles around the mirror's axis between which the image lies."""
    first = -0.5 - np.asarray(camera.principal_point_px)
    last = first + (camera.width_px, camera.height_px)
    nearest = np.clip(0.0, first, last)
    farthest = np.maximum(-first, last)
    inner, outer = np.hypot(*nearest), np.hypot(*np.abs(farthest))
    return Annulus(float(inner) / camera.focal_length_px, float(outer) / camera.focal_length_px)
