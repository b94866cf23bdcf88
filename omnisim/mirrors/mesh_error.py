"""Distortion of the picture by a mirror's mesh, computed without rendering."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.mirrors.hyperbolic import HyperbolicMirror
from omnisim.mirrors.mirror_mesh import MirrorMesh

_AZIMUTHS, _RADII = 48, 720  # samples of one sector: two a pixel along the radius at 360 px


class MeshError(NamedTuple):
    """Distance between where the mesh shows a direction and where the mirror would, in pixels."""

    mean_px: float
    percentile_95_px: float
    max_px: float


def mesh_error(mirror: HyperbolicMirror, mesh: MirrorMesh, rim_radius_px: float) -> MeshError:
    """Error of a mesh in a picture whose rim has a radius of `rim_radius_px`.

    All sectors are equal: one is sampled, evenly over the area that its polygons cover in the
    picture. A sample's direction is that of the point where the pinhole's ray meets the flat
    polygon, as `shaders/capture/mirror_mesh.frag` has it.
    """
    rim_tangent = float(mirror.tangent_from_theta(mirror.theta_max_rad))
    focal_length_px = rim_radius_px / rim_tangent
    azimuth = (np.arange(_AZIMUTHS) + 0.5) * (2.0 * np.pi / mesh.sectors / _AZIMUTHS)
    # evenly over the area: equal steps of the squared radius
    radius = np.sqrt((np.arange(_RADII) + 0.5) / _RADII) * rim_tangent
    tangents = radius[:, None, None] * np.stack((np.cos(azimuth), np.sin(azimuth)), axis=-1)
    tangents = tangents.reshape(-1, 2)
    points = _first_hits(mirror, mesh, tangents)
    seen = np.isfinite(points[:, 0])
    points, tangents = points[seen], tangents[seen]
    across = np.hypot(points[:, 0], points[:, 1])
    shown = mirror.tangent_from_theta(np.arctan2(across, points[:, 2]))
    positions = points[:, :2] * (shown / across)[:, None]
    error = focal_length_px * np.linalg.norm(positions - tangents, axis=1)
    return MeshError(float(error.mean()), float(np.percentile(error, 95)), float(error.max()))


def _first_hits(
    mirror: HyperbolicMirror, mesh: MirrorMesh, tangents: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Points (n, 3), mirror frame, where rays of the pinhole meet the first sector, or NaN."""
    pinhole = np.array([0.0, 0.0, mirror.c_m])
    rays = np.concatenate((tangents, -np.ones((len(tangents), 1))), axis=1)
    points = np.full((len(tangents), 3), np.nan)
    for a, b, c in mesh.vertices_m[_first_sector(mesh)]:
        # Source: Möller & Trumbore 1997
        ab, ac, start = b - a, c - a, pinhole - a
        across = np.cross(rays, ac)
        determinant = across @ ab
        u = across @ start / determinant
        turned = np.cross(start, ab)
        v = rays @ turned / determinant
        inside = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
        distance = (ac @ turned) / determinant[inside]
        points[inside] = pinhole + distance[:, None] * rays[inside]
    return points


def _first_sector(mesh: MirrorMesh) -> NDArray[np.int64]:
    """Triangles of the sector from azimuth 0 on: their vertices stand on its two meridians."""
    column = np.where(mesh.triangles == 0, 0, (mesh.triangles - 1) % mesh.sectors)
    return mesh.triangles[np.all(column <= 1, axis=1)]
