"""Rays of a mirror mesh: pinhole rays cast at its flat polygons."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import HyperbolicCamera, Rays
from omnisim.cameras.mirrors import tessellate
from omnisim.core.coordinate_frames import MIRROR_FROM_OPTICAL
from omnisim.rendering.rays.embree import NO_TRIANGLE, EmbreeMesh

_PINHOLE = np.array([0.0, 0.0, 1.0])  # mirror frame, in units of c


class MirrorMeshRays:
    """Rays through the points on flat polygons that pixels see (section 2.3 of the paper).

    Args:
        camera: camera with the mirror.
        polygons: number of polygons of the mirror mesh.
    """

    def __init__(self, camera: HyperbolicCamera, polygons: int):
        self._camera = camera
        mesh = tessellate(camera.mirror, polygons)
        self._corners = (mesh.vertices_m / camera.mirror.c_m)[mesh.triangles]
        self._mesh = EmbreeMesh.of_corners(self._corners)

    def ray_from_pixel(self, pixels_px: NDArray[np.float64]) -> Rays:
        """Rays of pixels (..., 2), optical frame; valid where a polygon is visible."""
        camera = self._camera
        offsets = (pixels_px - camera.principal_point_px) / camera.focal_length_px
        seen = np.concatenate((offsets, np.ones((*offsets.shape[:-1], 1))), axis=-1)
        seen = seen.reshape(-1, 3) * np.diag(MIRROR_FROM_OPTICAL)
        origins = np.tile(_PINHOLE.astype(np.float32), (len(seen), 1))
        polygons = self._mesh.triangles_hit(origins, seen.astype(np.float32))
        valid = polygons != NO_TRIANGLE
        first, second, third = np.moveaxis(self._corners[polygons], 1, 0)
        planes = np.cross(second - first, third - first)
        along = np.einsum("nc,nc->n", planes, seen)
        share = np.einsum("nc,nc->n", planes, first - _PINHOLE) / np.where(valid, along, 1.0)
        points = _PINHOLE + share[:, None] * seen
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        shape = pixels_px.shape[:-1]
        directions = (points * np.diag(MIRROR_FROM_OPTICAL)).reshape(*shape, 3)
        return Rays(directions, valid.reshape(shape))
