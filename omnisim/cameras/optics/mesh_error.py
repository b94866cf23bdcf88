"""Image distortion caused by the mesh of an optical system's mirror, in pixels.

Through the mesh, a pixel shows the direction that the exact system shows some pixels away. This
distance is the difference of the two directions over the exact direction's derivative by pixel.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from omnisim.cameras import CentralCamera
from omnisim.cameras.mirrors.mirror_mesh import MeshError, fewest_polygons
from omnisim.cameras.optics.centrality import ray_jacobians
from omnisim.cameras.optics.mesh_rays import MeshRays, as_system
from omnisim.cameras.optics.surface import Fate, Paths
from omnisim.core.arrays import Floats

_SAMPLES = 20_000
# Ratio of the largest error to the largest sampled error: measured up to 1.04, at 17 424 polygons.
_MISSED = 1.05
# Steps of a sequence that fills the square evenly. Source: Roberts 2018, R2: powers of the real
# root of x³ = x + 1.
_STEPS = 1.0 / 1.32471795724474602596 ** np.array([1.0, 2.0])


class SystemMeshErrors:
    """Mesh errors of one optical system, at samples across its image.

    Args:
        camera: optical system.

    Raises:
        OpticsError: the camera is not an optical system.
    """

    def __init__(self, camera: CentralCamera):
        self._system = as_system(camera)
        size = (camera.width_px, camera.height_px)
        share = np.outer(np.arange(1, _SAMPLES + 1), _STEPS) % 1.0
        self._pixels = share * size - 0.5

    def of(self, polygons: int) -> MeshError:
        """Errors over the pixels that the mesh shows; the maximum includes the outline.

        Raises:
            OpticsError: see `MeshRays`.
        """
        mesh = MeshRays(self._system, polygons)
        errors_px = self._errors_px(mesh)
        lost_px = _lost_px(mesh)
        if len(errors_px) == 0:
            return MeshError(np.inf, np.inf, np.inf)
        percentile_95_px = float(np.percentile(errors_px, 95.0))
        largest_px = max(_MISSED * float(errors_px.max()), lost_px)
        return MeshError(float(errors_px.mean()), percentile_95_px, largest_px)

    def needed_polygons(self, max_error_px: float, max_polygons: int) -> int | None:
        """Smallest polygon count within an error bound, with four sectors per ring.

        Args:
            max_error_px: tolerance.
            max_polygons: maximum number of polygons.

        Returns:
            Number of polygons, or None if `max_polygons` are not enough.
        """
        return fewest_polygons(
            lambda rings: self.of(4 * rings * rings).max_px <= max_error_px,
            math.isqrt(max_polygons // 4),
        )

    @cached_property
    def _exact(self) -> Paths:
        return self._system.paths(self._pixels)

    @cached_property
    def _by_direction(self) -> Floats:
        """Derivatives (n, 2, 3) of the pixels by direction; NaN where unknown."""
        by_pixel = ray_jacobians(self._system, self._pixels).directions
        known = (self._exact.fates == Fate.SEEN) & np.isfinite(by_pixel).all(axis=(1, 2))
        by_direction = np.full((len(known), 2, 3), np.nan)
        by_direction[known] = np.linalg.pinv(by_pixel[known])
        return by_direction

    def _errors_px(self, mesh: MeshRays) -> Floats:
        rays = mesh.rays_of(self._exact)
        off = rays.directions - self._exact.directions
        errors_px: Floats = np.linalg.norm(np.einsum("nij,nj->ni", self._by_direction, off), axis=1)
        return errors_px[rays.valid & np.isfinite(errors_px)]


def _lost_px(mesh: MeshRays) -> float:
    """Largest distance between the mesh's outline and the rim, where the image shows the rim."""
    inside_px, rim_px = (mesh.pixels_of(points_m) for points_m in mesh.outline_m)
    is_seen = mesh.system.paths(inside_px).fates == Fate.SEEN
    sizes = np.array((mesh.system.width_px, mesh.system.height_px))
    is_seen &= np.all((inside_px > -0.5) & (inside_px < sizes - 0.5), axis=1)
    is_seen &= np.isfinite(rim_px).all(axis=1)
    return float(np.linalg.norm(rim_px - inside_px, axis=1)[is_seen].max(initial=0.0))
