"""Rays of a mirror mesh: pinhole rays cast at its flat polygons."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import HyperbolicCamera, Rays
from omnisim.cameras.mirrors import tessellate
from omnisim.cameras.mirrors.mesh_rim import (
    inside_rim,
    pinhole_directions,
    rays_by_polygons,
    rim_rays,
)
from omnisim.rendering.rays.embree import NO_TRIANGLE, EmbreeMesh

_PINHOLE = np.array([0.0, 0.0, 1.0])  # mirror frame, in units of c


class MirrorMeshRays:
    """Rays through the points on flat polygons that pixels see (section 2.3 of the paper).

    Args:
        camera: camera with the mirror.
        polygons: number of polygons of the mirror mesh.
    """

    def __init__(self, camera: HyperbolicCamera, polygons: int):
        self._camera, self._tessellation = camera, tessellate(camera.mirror, polygons)
        vertices = self._tessellation.vertices_m / camera.mirror.c_m
        self._corners = vertices[self._tessellation.triangles]
        self._mesh = EmbreeMesh.of_corners(self._corners)

    def ray_from_pixel(self, pixels_px: NDArray[np.float64]) -> Rays:
        """Rays of pixels (..., 2), optical frame; valid where a polygon is visible."""
        camera = self._camera
        seen = pinhole_directions(camera, pixels_px).reshape(-1, 3)
        origins = np.tile(_PINHOLE.astype(np.float32), (len(seen), 1))
        polygons = self._mesh.triangles_hit(origins, seen.astype(np.float32))
        directions = rays_by_polygons(self._corners[polygons], seen)
        directions = directions.reshape(*pixels_px.shape[:-1], 3)
        valid = inside_rim(camera, self._tessellation.sectors, pixels_px)
        missed = valid & (polygons == NO_TRIANGLE).reshape(valid.shape)  # at the rim, by rounding
        directions[missed] = rim_rays(camera, self._tessellation, pixels_px[missed]).directions
        return Rays(directions, valid)
