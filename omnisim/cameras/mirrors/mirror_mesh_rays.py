"""Rays of pixels that see a mirror's mesh: its polygons, and their rim in the image."""

from __future__ import annotations

import math

import numpy as np

from omnisim.cameras.camera import Rays
from omnisim.cameras.mirrors.hyperbolic import HyperbolicCamera
from omnisim.cameras.mirrors.mirror_mesh import MirrorMesh
from omnisim.core.arrays import Bools, Floats, Indices
from omnisim.core.coordinate_frames import MIRROR_FROM_OPTICAL


def mesh_rays(camera: HyperbolicCamera, mesh: MirrorMesh, pixels_px: Floats) -> Rays:
    """Rays of pixels (..., 2) of a camera through the points of the flat polygons that they see.

    Beyond the rim of the mirror's mesh, pixels see the planes of its outermost polygons, and are
    invalid. Directions (..., 3) are unit vectors in the optical frame.

    Source: section 2.3 of the paper.
    """
    offsets = (pixels_px - camera.principal_point_px) / camera.focal_length_px
    seen = np.concatenate((offsets, np.ones((*offsets.shape[:-1], 1))), axis=-1)
    seen *= np.diag(MIRROR_FROM_OPTICAL)
    vertices, pinhole = mesh.vertices_m / camera.mirror.c_m, np.array([0.0, 0.0, 1.0])
    sector, radius_px = _sectors(camera, mesh.sectors, pixels_px)
    in_image = vertices[:, :2] / (1.0 - vertices[:, 2:])
    rings = np.hypot(*in_image[1 :: mesh.sectors].T) * camera.focal_length_px
    ring = np.minimum(np.searchsorted(rings, radius_px), mesh.rings - 1)
    # the diagonal of a cell, from its inner first corner to its outer second one
    inner = in_image[1 + np.maximum(ring - 1, 0) * mesh.sectors + sector]
    diagonal = in_image[1 + ring * mesh.sectors + (sector + 1) % mesh.sectors] - inner
    ahead = seen[..., :2] - inner
    is_upper = diagonal[..., 0] * ahead[..., 1] > diagonal[..., 1] * ahead[..., 0]
    cell = mesh.sectors * (2 * ring - 1) + 2 * sector + is_upper
    corners = vertices[mesh.triangles[np.where(ring > 0, cell, sector)]]
    first, second, third = np.moveaxis(corners, -2, 0)
    planes = np.cross(second - first, third - first)
    along = np.einsum("...c,...c->...", planes, seen)
    share = np.einsum("...c,...c->...", planes, first - pinhole)
    share = np.divide(share, along, out=np.ones_like(share), where=along != 0.0)
    points = pinhole + share[..., None] * seen
    points /= np.linalg.norm(points, axis=-1, keepdims=True)
    return Rays(points * np.diag(MIRROR_FROM_OPTICAL), inside_rim(camera, mesh.sectors, pixels_px))


def inside_rim(camera: HyperbolicCamera, sectors: int, pixels_px: Floats) -> Bools:
    """Mask (...,) of the pixels (..., 2) that see a mesh of so many sectors."""
    return _sectors(camera, sectors, pixels_px)[1] <= camera.rim_radius_px


def _sectors(camera: HyperbolicCamera, sectors: int, pixels_px: Floats) -> tuple[Indices, Floats]:
    """Sector (...,) of pixels (..., 2), and the radius of the ring's polygon through each."""
    x, y = np.moveaxis(pixels_px - camera.principal_point_px, -1, 0)
    half = math.pi / sectors
    azimuth = np.arctan2(-y, x)  # in the mirror frame
    sector = np.floor(azimuth / (2.0 * half))
    beside = azimuth - (2.0 * sector + 1.0) * half
    radius_px = np.hypot(x, y) * np.cos(beside) / math.cos(half)
    return sector.astype(np.intp) % sectors, radius_px
