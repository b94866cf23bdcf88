"""Rim of a mirror's mesh in the image: a polygon, which decides what pixels see the mesh."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras.camera import Rays
from omnisim.cameras.mirrors.hyperbolic import HyperbolicCamera
from omnisim.cameras.mirrors.mirror_mesh import MirrorMesh
from omnisim.core.coordinate_frames import MIRROR_FROM_OPTICAL

_PINHOLE = np.array([0.0, 0.0, 1.0])  # mirror frame, in units of c


def inside_rim(
    camera: HyperbolicCamera, sectors: int, pixels_px: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Mask (...,) of the pixels (..., 2) that see a mesh of so many sectors."""
    x, y = np.moveaxis(pixels_px - camera.principal_point_px, -1, 0)
    half = math.pi / sectors
    # angle from the middle of the edge, whose distance from the center is R cos(half)
    beside = np.mod(np.arctan2(y, x), 2.0 * half) - half
    distances_px = np.hypot(x, y) * np.cos(beside)
    return np.asarray(distances_px <= camera.rim_radius_px * math.cos(half))


def rim_rays(camera: HyperbolicCamera, mesh: MirrorMesh, pixels_px: NDArray[np.float64]) -> Rays:
    """Rays of pixels (..., 2) near the rim, by the polygons there; valid inside it."""
    seen = pinhole_directions(camera, pixels_px)
    share = np.arctan2(seen[..., 1], seen[..., 0]) / (2.0 * math.pi)
    sector = np.floor(share * mesh.sectors).astype(np.intp) % mesh.sectors
    # of the triangles in the outer ring, those with an edge on the rim
    outer = mesh.triangles[-mesh.sectors :]
    if mesh.rings > 1:
        outer = mesh.triangles[-2 * mesh.sectors :: 2]
    corners = (mesh.vertices_m / camera.mirror.c_m)[outer[sector]]
    return Rays(rays_by_polygons(corners, seen), inside_rim(camera, mesh.sectors, pixels_px))


def pinhole_directions(
    camera: HyperbolicCamera, pixels_px: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Directions (..., 3) from the pinhole to what pixels (..., 2) see, mirror frame."""
    offsets = (pixels_px - camera.principal_point_px) / camera.focal_length_px
    seen = np.concatenate((offsets, np.ones((*offsets.shape[:-1], 1))), axis=-1)
    return np.asarray(seen * np.diag(MIRROR_FROM_OPTICAL))


def rays_by_polygons(
    corners: NDArray[np.float64], seen: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Unit directions (..., 3) of rays, optical frame, by the polygons that pixels see.

    They pass through the points on the polygons' planes (section 2.3 of the paper).

    Args:
        corners: (..., 3, 3) corners of the polygons, mirror frame, in units of c.
        seen: (..., 3) directions from the pinhole, mirror frame.
    """
    first, second, third = np.moveaxis(corners, -2, 0)
    planes = np.cross(second - first, third - first)
    along = np.einsum("...c,...c->...", planes, seen)
    share = np.einsum("...c,...c->...", planes, first - _PINHOLE)
    share = np.divide(share, along, out=np.ones_like(share), where=along != 0.0)
    points = _PINHOLE + share[..., None] * seen
    points /= np.linalg.norm(points, axis=-1, keepdims=True)
    return np.asarray(points * np.diag(MIRROR_FROM_OPTICAL))
