"""Rays of an optical system through a mesh of its mirror: the paper's section 2.3 for any mirror.

The meshed mirror is the first that rays from the camera meet. Each corner of a polygon has the
exact ray of its point, traced through the rest of the system. A corner's viewpoint is the point of
its ray nearest to a point common to all rays, and the polygon's points are projected from the
viewpoints of its corners. For a central mirror this is the effective viewpoint, as in the paper.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from omnisim.cameras import CentralCamera, Rays
from omnisim.cameras.camera import as_pixels
from omnisim.cameras.optics.centrality import common_point
from omnisim.cameras.optics.surface import Fate, Paths, Surface, deflected, trace
from omnisim.cameras.optics.surface_mesh import heights_m, rim_of_mesh, tessellate_surface
from omnisim.cameras.optics.system import OpticalSystem
from omnisim.core.arrays import Floats, Ints
from omnisim.core.errors import OpticsError

_STEPS = 200  # maximum number of polygons from the exact point's to the one in front of it
_WIDER = 2.0  # widens the rims of later surfaces, for corners just outside them
_PIXELS_PER_BATCH = 1 << 15  # keeps intermediate arrays in the cache


class _Corners(NamedTuple):
    """Outgoing rays of a mesh's vertices (n,), system frame; NaN where no ray leaves."""

    origins_m: Floats  # (n, 3)
    directions: Floats  # (n, 3), with the length from the vertex's viewpoint


class MeshRays:
    """Rays of pixels through a mesh.

    Pixels see polygons, so the image ends where the mesh does. Shadows, and the holes and rims of
    other surfaces, follow the exact rays.

    Args:
        camera: optical system.
        polygons: polygon count of the mesh, see `sectors_and_rings`.

    Raises:
        OpticsError: the camera is no optical system, it has no mirror, the mirror has no rim, or a
            mesh with this polygon count does not exist.
    """

    def __init__(self, camera: CentralCamera, polygons: int):
        system = as_system(camera)
        self.system, self._number = system, mesh_surface(system)
        self._surface = system.surfaces[self._number]
        camera_m = system.system_from_camera[:3, 3]
        mesh = tessellate_surface(self._surface, polygons, camera_m)
        self._mesh = mesh
        self._vertices_m = self._to_system(mesh.vertices_m)
        self._corners = self._traced()
        corners = self._corners.directions[mesh.triangles]
        self._is_whole = np.asarray(np.isfinite(corners).all(axis=(1, 2)))

    @cached_property
    def _neighbors(self) -> Ints:
        """Triangles (m, 3) across the edge opposite each corner; −1: none."""
        corners = self._mesh.connectivity
        edges = np.stack((corners[:, [1, 2]], corners[:, [2, 0]], corners[:, [0, 1]]), axis=1)
        keys = (edges.min(axis=2) * len(self._vertices_m) + edges.max(axis=2)).ravel()
        order = np.argsort(keys, kind="stable")
        same = np.flatnonzero(keys[order[1:]] == keys[order[:-1]])
        neighbors = np.full(keys.shape, -1)
        one, other = order[same], order[same + 1]
        neighbors[one], neighbors[other] = other // 3, one // 3
        return neighbors.reshape(-1, 3)

    def ray_from_pixel(self, pixels_px: ArrayLike) -> Rays:
        """Rays of pixels (..., 2) with their origins, sensor's optical frame."""
        pixels = as_pixels(pixels_px)
        flat, shape = pixels.reshape(-1, 2), pixels.shape[:-1]
        batches = range(0, max(1, len(flat)), _PIXELS_PER_BATCH)
        parts = [
            self.rays_of(self.system.paths(flat[first : first + _PIXELS_PER_BATCH]))
            for first in batches
        ]
        directions, valid, origins_m = (np.concatenate(part) for part in zip(*parts, strict=True))
        return Rays(
            directions.reshape(*shape, 3), valid.reshape(shape), origins_m.reshape(*shape, 3)
        )

    def rays_of(self, exact: Paths) -> Rays:
        """Rays (n,) through the mesh for exact paths."""
        count = len(exact.fates)
        directions, origins_m = np.tile((0.0, 0.0, 1.0), (count, 1)), np.zeros((count, 3))
        rows = np.flatnonzero(exact.fates == Fate.SEEN)
        triangles, weights = self._found(*exact.points_m[self._number : self._number + 2, rows])
        meets = triangles >= 0
        rows, weights = rows[meets], weights[meets, None]
        corners = self._mesh.triangles[triangles[meets]]
        origins_m[rows] = (weights @ self._corners.origins_m[corners])[:, 0] - self.system.origin_m
        interpolated = (weights @ self._corners.directions[corners])[:, 0]
        directions[rows] = interpolated / np.linalg.norm(interpolated, axis=1, keepdims=True)
        valid = np.zeros(count, dtype=np.bool_)
        valid[rows] = True
        return Rays(directions, valid, origins_m)

    @property
    def outline_m(self) -> tuple[Floats, Floats]:
        """Midpoints (sectors, 3) of the rim edges and of the rim arcs, system frame."""
        rim = self._mesh.vertices_m[-self._mesh.sectors :]
        middles = 0.5 * (rim + np.roll(rim, -1, axis=0))
        x, y = self._surface.rim_center_m
        away = middles[:, :2] - (x, y)
        away *= rim_of_mesh(self._surface) / np.linalg.norm(away, axis=1, keepdims=True)
        arcs = away + (x, y)
        heights = heights_m(self._surface, np.linalg.norm(arcs, axis=1))
        return self._to_system(middles), self._to_system(np.column_stack((arcs, heights)))

    def _to_system(self, points_m: Floats) -> Floats:
        surface = self._surface
        return surface.directions_to_system(points_m) + surface.system_from_surface[:3, 3]

    def _traced(self) -> _Corners:
        system, number, vertices_m = self.system, self._number, self._vertices_m
        normals = self._surface.directions_to_system(self._mesh.normals)
        outgoing = deflected(normals, self._incoming(), is_mirror=True)
        fates = np.where(np.isfinite(outgoing).all(axis=1), Fate.SEEN, Fate.MISSED)
        later = tuple(_widened(surface) for surface in system.surfaces[number + 1 :])
        paths = trace(
            later,
            system.indices[number + 1 :],
            (),
            vertices_m,
            outgoing,
            fates.astype(np.uint8),
            can_block=False,
        )
        leaves = (paths.fates == Fate.SEEN)[:, None]
        origins_m = np.where(leaves, paths.points_m[-1], np.nan)
        directions = np.where(leaves, paths.directions, np.nan)
        rows = np.flatnonzero(leaves)
        if len(rows):
            viewpoint_m = common_point(origins_m[rows], directions[rows])
            lengths_m = np.einsum("nj,nj->n", origins_m - viewpoint_m, directions)
            if lengths_m[rows].min() > 0.0:  # otherwise rays cross in front of the mirror
                directions *= lengths_m[:, None]
        return _Corners(origins_m, directions)

    def pixels_of(self, points_m: Floats) -> Floats:
        """Pixels (n, 2) of mirror points (n, 3), system frame; NaN: not seen by the camera."""
        system = self.system
        if self._number > 0:
            pixels = self._front.pixel_from_point(points_m)
        else:
            pixels = system.camera.pixel_from_ray(system.camera_directions(points_m))
        return np.where(pixels.valid[:, None], pixels.positions_px, np.nan)

    @cached_property
    def _front(self) -> OpticalSystem:
        """Camera and boundaries in front of the mirror."""
        surfaces = self.system.surfaces[: self._number]
        return replace(self.system, surfaces=surfaces, obstacles=(), origin_m=(0.0, 0.0, 0.0))

    def _incoming(self) -> Floats:
        """Directions (n, 3) in which the camera's rays reach the vertices."""
        if self._number > 0:
            return self._front.paths(self.pixels_of(self._vertices_m)).directions
        away = self._vertices_m - self.system.system_from_camera[:3, 3]
        return away / np.linalg.norm(away, axis=1, keepdims=True)

    def _found(self, begin_m: Floats, end_m: Floats) -> tuple[Ints, Floats]:
        """Triangles (n,) met by rays, −1: none, and the weights (n, 3) of their corners.

        The search starts at the exact point's cell. It continues across the edge that the ray
        passes farthest outside.

        Args:
            begin_m: (n, 3) points of the rays before the mirror, system frame.
            end_m: (n, 3) exact points on the mirror.
        """
        origins, at = (self._surface.points_from_system(points) for points in (begin_m, end_m))
        gradients = self._surface.shape.level(at).gradients
        normals = np.where(gradients[:, 2:] > 0.0, -gradients, gradients)
        # orients the rays to the side of the triangles that the camera sees
        along = at - origins
        along *= -np.sign(np.einsum("nj,nj->n", normals, along))[:, None]
        triangles = self._cells(at)
        weights = np.zeros((len(triangles), 3))
        active = np.arange(len(triangles))
        for _ in range(_STEPS):
            volumes = self._volumes(triangles[active], origins[active], along[active])
            least = volumes.argmin(axis=1)
            inside = volumes.min(axis=1, initial=np.inf) >= 0.0
            weights[active[inside]] = volumes[inside]
            active, least = active[~inside], least[~inside]
            triangles[active] = self._neighbors[triangles[active], least]
            active = active[triangles[active] >= 0]
            if len(active) == 0:
                break
        triangles[active] = -1
        triangles[~self._is_whole[triangles]] = -1
        sums = weights.sum(axis=1, keepdims=True)
        return triangles, weights / np.where(sums > 0.0, sums, 1.0)

    def _volumes(self, triangles: Ints, origins_m: Floats, along: Floats) -> Floats:
        """Volumes (n, 3) spanned by rays and edges; none is negative for a ray that hits."""
        corners = self._mesh.vertices_m[self._mesh.triangles[triangles]] - origins_m[:, None]
        edges = [
            np.cross(corners[:, (corner + 2) % 3], corners[:, (corner + 1) % 3])
            for corner in range(3)
        ]
        return np.einsum("nj,cnj->nc", along, np.stack(edges))

    def _cells(self, at_m: Floats) -> Ints:
        """First triangles (n,) of the cells of surface points, in the surface's frame."""
        mesh, center = self._mesh, self._surface.rim_center_m
        rings_m = np.linalg.norm(mesh.vertices_m[:: mesh.sectors, :2] - center, axis=1)
        x, y = (at_m[:, :2] - center).T
        ring = np.clip(np.searchsorted(rings_m, np.hypot(x, y)) - 1, 0, len(rings_m) - 2)
        share = np.arctan2(-y, x) / (2.0 * math.pi)
        sector = np.floor(share * mesh.sectors).astype(np.int64) % mesh.sectors
        return ring * mesh.sectors + sector


def has_mesh(camera: CentralCamera) -> bool:
    """True for an optical system with a mirror that has a rim."""
    if not isinstance(camera, OpticalSystem):
        return False
    try:
        mesh_surface(camera)
    except OpticsError:
        return False
    return True


def mesh_surface(system: OpticalSystem) -> int:
    """Index of the meshed mirror: the first that rays from the camera meet.

    Raises:
        OpticsError: there is no mirror, or it has no rim.
    """
    number = next((n for n, surface in enumerate(system.surfaces) if surface.is_mirror), None)
    if number is None:
        raise OpticsError("an optical system without a mirror has no mesh: expected 'exact'")
    rim_of_mesh(system.surfaces[number])
    return number


def as_system(camera: CentralCamera) -> OpticalSystem:
    """The camera, if it is an optical system.

    Raises:
        OpticsError: it is another camera.
    """
    if not isinstance(camera, OpticalSystem):
        raise OpticsError(f"a camera of model {camera.model_name!r} has no mirror with a mesh")
    return camera


def _widened(surface: Surface) -> Surface:
    """A surface without a hole, extended beyond its rim."""
    rim_m = _WIDER * surface.rim_radius_m
    return replace(surface, rim_radius_m=rim_m, hole_radius_m=0.0)
