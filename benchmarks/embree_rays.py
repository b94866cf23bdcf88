"""Embree's answer to the same frame: one ray for each pixel of the mirror, on one thread.

Only which triangle is hit: no colours, no antialiasing, so that it is as fast as it can be.
"""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.batching import in_world
from omnisim.cameras import CentralCamera, pixel_grid
from omnisim.scene import Scene


def has_embree() -> bool:
    """Whether embreex, an optional package, is installed."""
    return find_spec("embreex") is not None


class EmbreeRays:
    """A scene and a camera's rays in it; everything that stays the same is made once.

    Attributes:
        embree: the scene, with the triangles of all instances in their order.
        valid: (height, width) pixels that have a ray.
    """

    def __init__(self, scene: Scene, camera: CentralCamera):
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        positions, triangles, base = [], [], 0
        for instance in scene.instances:
            placed = in_world(scene.meshes[instance.mesh], instance)
            positions.append(placed.positions)
            triangles.append(placed.triangles.astype(np.int32) + np.int32(base))
            base += len(placed.positions)
        self.embree = EmbreeScene()
        self._mesh = TriangleMesh(self.embree, np.concatenate(positions), np.concatenate(triangles))
        self.look_through(camera)

    def look_through(self, camera: CentralCamera) -> None:
        """Cast a camera's rays from now on."""
        rays = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px))
        self.valid = rays.valid
        seen = rays.directions[rays.valid] @ camera.rig_from_optical.T
        self._rays_rig = seen.astype(np.float32)
        self._origins_m = np.empty_like(self._rays_rig)
        self._directions = np.empty_like(self._rays_rig)

    @property
    def count(self) -> int:
        """Rays of a frame."""
        return len(self._rays_rig)

    def cast(self, world_from_rig: NDArray[np.float64]) -> NDArray[np.int32]:
        """Numbers (n,) of the triangles that are hit from a pose (4, 4); −1: none."""
        hit: NDArray[np.int32] = self.embree.run(*self.aim(world_from_rig))
        return hit

    def aim(
        self, world_from_rig: NDArray[np.float64]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Origins and directions (n, 3), world, from a pose (4, 4): the same arrays each time."""
        # No matrix product: of so many rays BLAS makes work for other threads, which then spin and
        # slow down whatever is timed next.
        turn = world_from_rig[:3, :3].astype(np.float32)
        np.einsum("nj,ij->ni", self._rays_rig, turn, out=self._directions)
        self._origins_m[:] = world_from_rig[:3, 3]
        return self._origins_m, self._directions
