"""Embree's answer to the same frame: one ray for each pixel of the mirror, on one thread.

Only which triangle is hit: no colours, no antialiasing, so that it is as fast as it can be.
"""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, pixel_grid
from omnisim.scene import Scene


def has_embree() -> bool:
    """Whether embreex, an optional package, is installed."""
    return find_spec("embreex") is not None


class EmbreeRays:
    """A scene and a camera's rays in it; everything that stays the same is made once."""

    def __init__(self, scene: Scene, camera: CentralCamera):
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        positions, triangles, base = [], [], 0
        for instance in scene.instances:
            mesh, world_from_mesh = scene.meshes[instance.mesh], instance.world_from_mesh
            placed = mesh.positions @ world_from_mesh[:3, :3].T + world_from_mesh[:3, 3]
            positions.append(placed.astype(np.float32))
            triangles.append(mesh.triangles.astype(np.int32) + np.int32(base))
            base += len(placed)
        self._scene = EmbreeScene()
        self._mesh = TriangleMesh(self._scene, np.concatenate(positions), np.concatenate(triangles))
        rays = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px))
        seen = rays.directions[rays.valid] @ camera.rig_from_optical.T
        self._rays_rig = seen.astype(np.float32)

    @property
    def count(self) -> int:
        """Rays of a frame."""
        return len(self._rays_rig)

    def cast(self, world_from_rig: NDArray[np.float64]) -> NDArray[np.int32]:
        """Numbers (n,) of the triangles that are hit from a pose (4, 4); −1: none."""
        directions = self._rays_rig @ world_from_rig[:3, :3].T.astype(np.float32)
        origins = np.tile(world_from_rig[:3, 3].astype(np.float32), (len(directions), 1))
        hit: NDArray[np.int32] = self._scene.run(origins, directions)
        return hit
