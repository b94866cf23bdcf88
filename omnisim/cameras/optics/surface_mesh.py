"""Mesh of a surface of an optical system: the paper's Fig. 3 for any shape."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from omnisim.cameras.mirrors.mirror_mesh import RING_EXPONENT, UnfoldedMirrorMesh, sectors_and_rings
from omnisim.cameras.optics.profile_file import profile_lengths_m
from omnisim.cameras.optics.surface import Surface
from omnisim.core.arrays import Floats, Ints
from omnisim.core.coordinate_frames import MIRROR_FROM_OPTICAL
from omnisim.core.errors import OpticsError

_TURN = np.diag(MIRROR_FROM_OPTICAL)
_SAMPLES = 4097  # along a profile
_MAX_SLANT = 2.0  # ratio of the apparent widths of equal parts of a profile
_BISECTIONS = 64
_SHARE_OF_TIP = 1e-8  # distance from the axis where a tip's normal is taken, in rim radii


class SurfaceMesh(NamedTuple):
    """Triangles with vertices on a surface, in its own frame; counter-clockwise from z < 0.

    The vertices form rings from the axis to the rim, with `sectors` vertices each. Without a hole,
    the first ring is the surface's vertex, repeated for each sector.
    """

    vertices_m: Floats  # (n, 3)
    normals: Floats  # (n, 3), unit, z ≤ 0; at a tip the normal at the middle of the sector
    triangles: Ints  # (m, 3)
    sectors: int

    @property
    def connectivity(self) -> Ints:
        """Triangles (m, 3) over vertex indices that are equal where positions are."""
        is_point = bool(np.ptp(self.vertices_m[: self.sectors], axis=0).max() == 0.0)
        return np.maximum(self.triangles, self.sectors - 1) if is_point else self.triangles

    def as_seen(self, rim_center_m: tuple[float, float], rim_m: float) -> UnfoldedMirrorMesh:
        """Mesh with z toward the camera; texture coordinates map the rim's square to [0, 1]."""
        texture = 0.5 + 0.5 * (self.vertices_m[:, :2] - rim_center_m) / rim_m
        return UnfoldedMirrorMesh(
            self.vertices_m * _TURN, self.normals * _TURN, texture, self.triangles
        )


def rim_of_mesh(surface: Surface) -> float:
    """Radius of a surface's rim, or of its shape.

    Raises:
        OpticsError: there is no rim, or a hole is not centered on the rim.
    """
    aside_m = math.hypot(*surface.rim_center_m)
    rim_m = min(surface.rim_radius_m, surface.shape.domain_m - aside_m)
    if math.isinf(rim_m):
        raise OpticsError(f"{surface.name}: rim_radius_m: missing")
    if aside_m > 0.0 and surface.hole_radius_m > 0.0:
        raise OpticsError(f"{surface.name}: rim_center_m: expected [0, 0] beside hole_radius_m")
    return rim_m


def tessellate_surface(surface: Surface, polygons: int, camera_m: Floats) -> SurfaceMesh:
    """Tessellate a surface: every vertex is on it, the last ring on its rim.

    Args:
        surface: surface with a rim; a hole must be centered on the rim.
        polygons: polygon count, see `sectors_and_rings`.
        camera_m: (3,) position of the pinhole, system frame; determines the spacing of rings.

    Raises:
        OpticsError: there is no rim, a hole is not centered on the rim, or a mesh with this polygon
            count does not exist.
    """
    sectors, rings = sectors_and_rings(polygons)
    radii = _ring_radii_m(surface, rim_of_mesh(surface), rings, camera_m)[:, None]
    azimuths = np.tile(np.arange(sectors) * (2.0 * math.pi / sectors), (rings + 1, 1))
    points_m = _on_surface(surface, radii, azimuths)
    # at an apex, each triangle's corner has the normal at the middle of its sector
    azimuths[0] += math.pi / sectors if radii[0] == 0.0 else 0.0
    radii[0] = max(float(radii[0, 0]), _SHARE_OF_TIP * float(radii[-1, 0]))
    gradients = surface.shape.level(_on_surface(surface, radii, azimuths)).gradients
    normals = gradients / np.linalg.norm(gradients, axis=1, keepdims=True)
    normals *= -np.where(normals[:, 2:] > 0.0, 1.0, -1.0)
    here = (np.arange(rings)[:, None] * sectors + np.arange(sectors)).ravel()
    following = here - here % sectors + (here + 1) % sectors
    outer = np.column_stack((here, here + sectors, following + sectors))
    inner = np.column_stack((here, following + sectors, following))
    if surface.hole_radius_m == 0.0:
        inner = inner[sectors:]  # there are none at the vertex
    return SurfaceMesh(points_m, normals, np.concatenate((outer, inner)), sectors)


def _on_surface(surface: Surface, radii_m: Floats, azimuths_rad: Floats) -> Floats:
    """Points (n, 3) at polar coordinates about the rim's center, from +x toward −y."""
    x = (surface.rim_center_m[0] + radii_m * np.cos(azimuths_rad)).ravel()
    y = (surface.rim_center_m[1] - radii_m * np.sin(azimuths_rad)).ravel()
    return np.column_stack((x, y, heights_m(surface, np.hypot(x, y))))


def heights_m(surface: Surface, radii_m: Floats) -> Floats:
    """Heights (n,) of a surface at radii (n,) that may exceed its domain by rounding errors."""
    return surface.shape.sag_m(np.minimum(radii_m, surface.shape.domain_m))


def _ring_radii_m(surface: Surface, rim_m: float, rings: int, camera_m: Floats) -> Floats:
    """Radii (rings + 1,) of the rings, from the hole to the rim, see `RING_EXPONENT`.

    Rings are spaced as a camera on the axis sees them, like those of a central mirror. If the
    camera sees parts of the profile at a slant, length along the profile counts equally; if it does
    not see the whole profile, only that length counts. For a ball seen up to its limb, this halves
    the largest error.
    """
    height_m = -float(surface.points_from_system(camera_m[None])[0, 2])

    def seen(radii_m: Floats) -> Floats:
        return radii_m / (height_m + surface.shape.sag_m(radii_m))

    samples_m = np.linspace(0.0, rim_m, _SAMPLES)
    steps = np.diff(seen(samples_m))
    ends_m = np.array([surface.hole_radius_m, rim_m])
    if steps.min() * _MAX_SLANT > steps.max():  # false for NaN, too
        radii_m = _bisected(seen, _spaced(seen(ends_m), rings), rim_m)
    else:
        lengths_m = profile_lengths_m(surface.shape, samples_m)
        measure = lengths_m / lengths_m[-1]
        if steps.min() > 0.0:
            measure += seen(samples_m) / seen(ends_m)[-1]
        ring_measures = _spaced(np.interp(ends_m, samples_m, measure), rings)
        radii_m = np.interp(ring_measures, measure, samples_m)
    radii_m[[0, -1]] = ends_m  # without rounding errors
    return radii_m


def _spaced(ends: Floats, count: int) -> Floats:
    """Values (count + 1,) between two ends (2,), spaced by the ring exponent."""
    first, last = ends ** (1.0 / RING_EXPONENT)
    return (first + (last - first) * np.arange(count + 1) / count) ** RING_EXPONENT


def _bisected(function: Callable[[Floats], Floats], values: Floats, last: float) -> Floats:
    """Arguments (n,) in [0, last] at which an increasing function has values (n,)."""
    low, high = np.zeros_like(values), np.full_like(values, last)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        is_low = function(middle) < values
        low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
    return high
