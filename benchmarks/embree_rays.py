"""Embree, through embreex: triangles and rays, in float32, on one thread."""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.batching import in_world
from omnisim.cameras import CentralCamera, pixel_grid
from omnisim.scene import Scene

if TYPE_CHECKING:
    from embreex.rtcore_scene import Hits


def has_embree() -> bool:
    """True if embreex, an optional package, is installed."""
    return find_spec("embreex") is not None


class EmbreeMesh:
    """Bounding volume hierarchy of triangles.

    Args:
        positions_m: (n, 3) float32 vertices.
        triangles: (m, 3) int32.
    """

    def __init__(self, positions_m: NDArray[np.float32], triangles: NDArray[np.int32]):
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._scene = EmbreeScene()
        self._mesh = TriangleMesh(self._scene, positions_m, triangles)  # owns the vertices

    @classmethod
    def of_corners(cls, corners_m: NDArray[np.float64]) -> EmbreeMesh:
        """Mesh of triangles (m, 3, 3) that share no vertices."""
        positions = corners_m.reshape(-1, 3).astype(np.float32)
        return cls(positions, np.arange(len(positions), dtype=np.int32).reshape(-1, 3))

    def triangles_hit(
        self, origins_m: NDArray[np.float32], directions: NDArray[np.float32]
    ) -> NDArray[np.int32]:
        """Indices (n,) of the nearest triangles along rays (n, 3); −1: none."""
        return self._scene.run(origins_m, directions)

    def hits(self, origins_m: NDArray[np.float32], directions: NDArray[np.float32]) -> Hits:
        """Nearest triangles along rays (n, 3), with ranges and barycentric coordinates (n,)."""
        return self._scene.run(origins_m, directions, output=True)


class EmbreeRays:
    """A ray for each pixel of a camera in a scene; everything constant is made once.

    Attributes:
        mesh: triangles of all instances in their order.
        valid: (height, width) pixels that have a ray.
    """

    def __init__(self, scene: Scene, camera: CentralCamera):
        positions, triangles, base = [], [], 0
        for instance in scene.instances:
            placed = in_world(scene.meshes[instance.mesh], instance)
            positions.append(placed.positions)
            triangles.append(placed.triangles.astype(np.int32) + np.int32(base))
            base += len(placed.positions)
        self.mesh = EmbreeMesh(np.concatenate(positions), np.concatenate(triangles))
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
        """Number of rays in a frame."""
        return len(self._rays_rig)

    def cast(self, world_from_rig: NDArray[np.float64]) -> NDArray[np.int32]:
        """Indices (n,) of the triangles that are hit from a pose (4, 4); −1: none."""
        return self.mesh.triangles_hit(*self.aim(world_from_rig))

    def aim(
        self, world_from_rig: NDArray[np.float64]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Origins and directions (n, 3), world, from a pose (4, 4): the same arrays each time."""
        # No matrix product: of so many rays BLAS makes work for other threads, which then spin and
        # slow down whatever is timed next.
        rotation = world_from_rig[:3, :3].astype(np.float32)
        np.einsum("nj,ij->ni", self._rays_rig, rotation, out=self._directions)
        self._origins_m[:] = world_from_rig[:3, 3]
        return self._origins_m, self._directions
