"""Mesh of a surface of an optical system: the paper's Fig. 3 for any shape."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras.mirrors.mirror_mesh import UnfoldedMirrorMesh
from omnisim.cameras.mirrors.tessellation import RING_EXPONENT, sectors_and_rings
from omnisim.cameras.optics.profile_file import profile_lengths_m
from omnisim.cameras.optics.shapes.shape import Floats
from omnisim.cameras.optics.surface import Surface
from omnisim.core.coordinate_frames import MIRROR_FROM_OPTICAL
from omnisim.core.errors import OpticsError

_TURN = np.diag(MIRROR_FROM_OPTICAL)
_SAMPLES = 4097  # of a profile
_MAX_SLANT = 2.0  # between parts of a profile, by how narrow they are seen
_BISECTIONS = 64
_SHARE_OF_TIP = 1e-8  # of the rim's radius: so near to the axis a tip has its normal


class SurfaceMesh(NamedTuple):
    """Triangles whose vertices are on a surface, in its own frame; counter-clockwise from z < 0.

    The vertices are those of rings from the axis to the rim, `sectors` each. Without a hole the
    first ring is the vertex of the surface, once for each sector.
    """

    vertices_m: Floats  # (n, 3)
    normals: Floats  # (n, 3), unit, z ≤ 0; a tip has that of its sector's middle
    triangles: NDArray[np.int64]  # (m, 3)
    sectors: int

    @property
    def connectivity(self) -> NDArray[np.int64]:
        """Triangles (m, 3) by vertices that are the same where their positions are."""
        is_point = bool(np.ptp(self.vertices_m[: self.sectors], axis=0).max() == 0.0)
        return np.maximum(self.triangles, self.sectors - 1) if is_point else self.triangles

    def as_seen(self, rim_center_m: tuple[float, float], rim_m: float) -> UnfoldedMirrorMesh:
        """Mesh with z towards the camera; texture coordinates are x and y of it, the rim's bounding
        square from 0 to 1."""  # fmt: skip
        texture = 0.5 + 0.5 * (self.vertices_m[:, :2] - rim_center_m) / rim_m
        return UnfoldedMirrorMesh(
            self.vertices_m * _TURN, self.normals * _TURN, texture, self.triangles
        )


def rim_of_mesh(surface: Surface) -> float:
    """Radius of the rim of a surface, or of its shape.

    Raises:
        OpticsError: none, or a hole beside the rim's middle.
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
        surface: with a rim, and a hole only about the rim's middle.
        polygons: see `sectors_and_rings`.
        camera_m: (3,) of the pinhole, system frame: rings are narrow where it sees them narrow.

    Raises:
        OpticsError: no rim, a hole beside the rim's middle, or a count that makes no mesh.
    """
    sectors, rings = sectors_and_rings(polygons)
    radii = _ring_radii_m(surface, rim_of_mesh(surface), rings, camera_m)[:, None]
    azimuths = np.tile(np.arange(sectors) * (2.0 * math.pi / sectors), (rings + 1, 1))
    points_m = _on_surface(surface, radii, azimuths)
    # an apex has its normal from the middle of the sector whose triangle it is a corner of
    azimuths[0] += math.pi / sectors if radii[0] == 0.0 else 0.0
    radii[0] = max(float(radii[0, 0]), _SHARE_OF_TIP * float(radii[-1, 0]))
    gradients = surface.shape.level(_on_surface(surface, radii, azimuths)).gradients
    normals = gradients / np.linalg.norm(gradients, axis=1, keepdims=True)
    normals *= -np.where(normals[:, 2:] > 0.0, 1.0, -1.0)
    here = (np.arange(rings)[:, None] * sectors + np.arange(sectors)).ravel()
    there = here - here % sectors + (here + 1) % sectors
    outer = np.column_stack((here, here + sectors, there + sectors))
    inner = np.column_stack((here, there + sectors, there))
    if surface.hole_radius_m == 0.0:
        inner = inner[sectors:]  # at the vertex there is none
    return SurfaceMesh(points_m, normals, np.concatenate((outer, inner)), sectors)


def _on_surface(surface: Surface, radii_m: Floats, azimuths_rad: Floats) -> Floats:
    """Points (n, 3) at polar coordinates about the rim's middle, +x to −y."""
    x = (surface.rim_center_m[0] + radii_m * np.cos(azimuths_rad)).ravel()
    y = (surface.rim_center_m[1] - radii_m * np.sin(azimuths_rad)).ravel()
    return np.column_stack((x, y, heights_m(surface, np.hypot(x, y))))


def heights_m(surface: Surface, radii_m: Floats) -> Floats:
    """Heights (n,) of a surface at radii (n,) that rounding may have put beyond its domain."""
    return surface.shape.sag_m(np.minimum(radii_m, surface.shape.domain_m))


def _ring_radii_m(surface: Surface, rim_m: float, rings: int, camera_m: Floats) -> Floats:
    """Radii (rings + 1,) of the rings, from the hole to the rim, see `RING_EXPONENT`.

    They are spaced as a camera on the axis sees them, as those of a central mirror. Where it sees
    parts of the profile from the side, the length along it counts as much; where it does not see
    all of it, only that does. Of a ball seen up to its limb that halves the largest error.
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
        wanted = _spaced(np.interp(ends_m, samples_m, measure), rings)
        radii_m = np.interp(wanted, measure, samples_m)
    radii_m[[0, -1]] = ends_m  # free of rounding
    return radii_m


def _spaced(ends: Floats, count: int) -> Floats:
    """Values (count + 1,) between two (2,), by the exponent of rings."""
    first, last = ends ** (1.0 / RING_EXPONENT)
    values: Floats = (first + (last - first) * np.arange(count + 1) / count) ** RING_EXPONENT
    return values


def _bisected(function: Callable[[Floats], Floats], values: Floats, last: float) -> Floats:
    """Arguments (n,) from 0 to the last of a growing function's values (n,)."""
    low, high = np.zeros_like(values), np.full_like(values, last)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        is_low = function(middle) < values
        low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
    return high
