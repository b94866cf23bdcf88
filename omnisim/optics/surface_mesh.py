"""Mesh of a surface of an optical system, in its own frame, the axis z turned to the camera."""

from __future__ import annotations

import math

import numpy as np

from omnisim.errors import OpticsError
from omnisim.frames import MIRROR_FROM_OPTICAL
from omnisim.mirrors.mirror_mesh import UnfoldedMirrorMesh
from omnisim.mirrors.tessellation import sectors_and_rings
from omnisim.optics.surface import Surface

_TURN = np.diag(MIRROR_FROM_OPTICAL)


def tessellate_surface(surface: Surface, polygons: int) -> UnfoldedMirrorMesh:
    """Mesh whose vertices are on the surface, the last ring on its rim.

    Its texture coordinates are x and y, the rim's bounding square from 0 to 1.

    Args:
        surface: with a rim, and a hole only about the rim's middle.
        polygons: see `sectors_and_rings`.

    Raises:
        OpticsError: no rim, a hole beside the rim's middle, or a count that makes no mesh.
    """
    sectors, rings = sectors_and_rings(polygons)
    is_centred = surface.rim_center_m == (0.0, 0.0)
    rim_m = min(surface.rim_radius_m, surface.shape.domain_m)
    if math.isinf(rim_m):
        raise OpticsError(f"{surface.name}: rim_radius_m: missing")
    if not is_centred and surface.hole_radius_m > 0.0:
        raise OpticsError(f"{surface.name}: rim_center_m: expected [0, 0] beside hole_radius_m")
    radii = np.linspace(surface.hole_radius_m, rim_m, rings + 1)[:, None]
    azimuths = np.arange(sectors) * (2.0 * math.pi / sectors)
    x = (surface.rim_center_m[0] + radii * np.cos(azimuths)).ravel()
    y = (surface.rim_center_m[1] + radii * np.sin(azimuths)).ravel()
    points_m = np.column_stack((x, y, surface.shape.sag_m(np.hypot(x, y))))
    gradients = surface.shape.level(points_m).gradients
    gradients[~gradients.any(axis=1)] = (0.0, 0.0, -1.0)  # a cone's tip
    normals = gradients / np.linalg.norm(gradients, axis=1, keepdims=True)
    normals *= -np.sign(normals[:, 2:])
    near = (np.arange(rings)[:, None] * sectors + np.arange(sectors)).ravel()
    beside = near - near % sectors + (near + 1) % sectors
    one = np.column_stack((near, beside + sectors, near + sectors))
    other = np.column_stack((near, beside, beside + sectors))
    triangles = np.concatenate((one, other))
    corners = points_m[triangles]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    texture = 0.5 + 0.5 * (points_m[:, :2] - surface.rim_center_m) / rim_m
    return UnfoldedMirrorMesh(
        points_m * _TURN, normals * _TURN, texture, triangles[areas > 0.0].astype(np.int64)
    )
