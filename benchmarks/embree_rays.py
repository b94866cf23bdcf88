"""Rays of a camera's pixels, cast by Embree in float32 on one thread."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, pixel_grid
from omnisim.core.extras import missing_packages
from omnisim.rendering.rays.caster import EmbreeMesh
from omnisim.rendering.rays.geometry import build_geometry
from omnisim.scene import Scene


def has_embree() -> bool:
    """True if embreex, an optional package, is installed."""
    return not missing_packages("rays")


class EmbreeRays:
    """Ray caster with one ray per pixel of a camera; constant data is computed once.

    Attributes:
        mesh: triangles of all instances, in the scene's order.
        valid: (height, width) pixels that have a ray.
    """

    def __init__(self, scene: Scene, camera: CentralCamera):
        geometry = build_geometry(scene)
        self.mesh = EmbreeMesh(geometry.positions_m.astype(np.float32), geometry.corners)
        rays = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px))
        self.valid = rays.valid
        seen = rays.directions[rays.valid] @ camera.rig_from_optical.T
        self._rays_rig = seen.astype(np.float32)
        self._origins_m = np.empty_like(self._rays_rig)
        self._directions = np.empty_like(self._rays_rig)

    @property
    def count(self) -> int:
        """Number of rays per frame."""
        return len(self._rays_rig)

    def cast(self, world_from_rig: NDArray[np.float64]) -> NDArray[np.int32]:
        """Indices (n,) of the triangles hit from a pose (4, 4); −1: no hit."""
        return self.mesh.triangles_hit(*self.aim(world_from_rig))

    def aim(
        self, world_from_rig: NDArray[np.float64]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Origins and directions (n, 3), world, from a pose (4, 4); the arrays are reused."""
        # No matrix product: for so many rays, BLAS uses other threads, which then spin and slow
        # down the next measurement.
        rotation = world_from_rig[:3, :3].astype(np.float32)
        np.einsum("nj,ij->ni", self._rays_rig, rotation, out=self._directions)
        self._origins_m[:] = world_from_rig[:3, 3]
        return self._origins_m, self._directions
