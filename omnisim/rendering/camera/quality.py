"""Capture settings: quality, by name or by number, near plane, and polygons of a mirror's mesh.

Quality is two numbers, against jagged edges and lost detail: texels per side of the image's finest
pixels, and samples per pixel side, which are averaged. The named settings balance them: more texels
would need more samples to be visible, and more samples more texels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field

from omnisim.cameras import CentralCamera, HyperbolicCamera, NonCentralCamera
from omnisim.cameras.mirrors.mirror_mesh import (
    MAX_POLYGONS,
    Annulus,
    largest_error,
    needed_polygons,
    sectors_and_rings,
)
from omnisim.core.errors import OpticsError, did_you_mean
from omnisim.core.files.parameters import AboveZero, Number, Parameters

if TYPE_CHECKING:
    from omnisim.scene import Scene

NEAR_PER_SIZE = 0.05  # near plane per longest side of the scene


def scene_size_m(scene: Scene) -> float:
    """Longest side of the static geometry, else of the moving objects; 0: empty."""
    if not scene.instances and not scene.objects:
        return 0.0
    low, high = scene.bounds_m()
    return float((high - low).max())


def near_plane_m(size_m: float, default_m: float) -> float:
    """Distance of the near plane for a scene size: the default, or less in small scenes.

    Reversed float depth is equally precise with any near plane.
    """
    near_m = NEAR_PER_SIZE * size_m
    return near_m if 0.0 < near_m < default_m else default_m


MAX_IMAGE_PX = 32768  # limit of current GPUs; the actual GPU may allow less
MAX_SUPERSAMPLING = 8
MIN_DENSITY, MAX_DENSITY = 0.25, 8.0  # texels of the virtual cameras per pixel side

Size = Annotated[int, Field(strict=True, ge=1, le=MAX_IMAGE_PX)]
QualityName = Literal["fast", "default", "fine"]


class CaptureQuality(NamedTuple):
    """Texels and samples of a capture."""

    supersampling: int  # samples per pixel side of the image
    texels_per_pixel: float  # texels of the virtual cameras per side of the image's finest pixels


QUALITIES: dict[str, CaptureQuality] = {
    "fast": CaptureQuality(2, 1.0),
    "default": CaptureQuality(3, 2.9),
    "fine": CaptureQuality(4, 4.0),
}
DEFAULT_NEAR_M = 0.05  # of the virtual cameras
# Numbers of planar mirrors that virtual cameras reflect the scene in, and of panes.
DEFAULT_MIRRORS, MAX_MIRRORS = 4, 8
# Numbers of reflection probes, which curved and rough surfaces reflect.
DEFAULT_PROBES, MAX_PROBES = 8, 16
DEFAULT_QUALITY: QualityName = "default"


@dataclass(frozen=True, eq=False, kw_only=True)
class Capture(Parameters):
    """Settings of the virtual cameras, and of the samples of the image that they capture."""

    near_m: AboveZero = DEFAULT_NEAR_M
    """Near plane in meters; nearer surfaces are invisible, and a note reports them. The default
    0.05 is reduced in scenes of less than 1 m."""
    far_m: Annotated[float, Field(strict=True, gt=0.0, allow_inf_nan=True)] = math.inf
    """Far plane in meters; farther surfaces are invisible; may be inf."""
    samples: Literal[1, 2, 4, 8] = 1
    """Samples per texel, against jagged edges; at most as many as the GPU supports."""
    mirrors: Annotated[int, Field(strict=True, ge=0, le=MAX_MIRRORS)] = DEFAULT_MIRRORS
    """Maximum number of planar mirrors and glossy floors in view that reflect the scene, largest
    first, and of panes likewise; each costs another rendering. 0: they reflect sky and lamps."""
    reflection_probes: Annotated[int, Field(strict=True, ge=0, le=MAX_PROBES)] = DEFAULT_PROBES
    """Maximum number of reflection probes, by which curved and rough surfaces show the scene,
    most prominent surfaces first; each costs a small rendering, and if objects move, another one
    per image. 0: they reflect sky and lamps."""
    supersampling: Annotated[int, Field(strict=True, ge=1, le=MAX_SUPERSAMPLING)] = QUALITIES[
        DEFAULT_QUALITY
    ].supersampling
    """Samples per pixel side, averaged in linear light; left out: from quality."""
    texels_per_pixel: Annotated[Number, Field(ge=MIN_DENSITY, le=MAX_DENSITY)] = QUALITIES[
        DEFAULT_QUALITY
    ].texels_per_pixel
    """Texels per side of the image's finest pixels; left out: from camera.quality."""

    def _check(self) -> None:
        if not self.near_m < self.far_m:
            raise self._error("far_m", f"more than near_m = {self.near_m:g}")


def quality_named(name: str) -> CaptureQuality:
    """Capture quality by name.

    Raises:
        OpticsError: the name is unknown.
    """
    if name in QUALITIES:
        return QUALITIES[name]
    raise OpticsError(f"quality {name!r}: {did_you_mean(name, QUALITIES)}")


MAX_ERROR_PX = 0.1  # of a mirror's mesh, in the image
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
    from omnisim.cameras.optics.mesh_rays import SystemMeshErrors  # few cameras have one

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
        from omnisim.cameras.optics.mesh_rays import SystemMeshErrors

        return SystemMeshErrors(camera).of(polygons).max_px
    if polygons is None or not isinstance(camera, HyperbolicCamera):
        return 0.0
    error = largest_error(camera.mirror, *sectors_and_rings(polygons), _shown(camera))
    return camera.focal_length_px * error + _RASTER_STEP_PX


def _shown(camera: HyperbolicCamera) -> Annulus:
    """Circles around the mirror's axis that enclose the image; radii in focal lengths."""
    first = -0.5 - np.asarray(camera.principal_point_px)
    last = first + (camera.width_px, camera.height_px)
    inner = np.hypot(*np.clip(0.0, first, last))
    outer = np.hypot(*np.maximum(-first, last))
    return Annulus(float(inner) / camera.focal_length_px, float(outer) / camera.focal_length_px)
