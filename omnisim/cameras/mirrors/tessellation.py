"""Tessellation of a mirror into polygons, as in the paper's Fig. 3."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras.mirrors.hyperbolic_mirror import HyperbolicMirror
from omnisim.cameras.mirrors.mirror_mesh import MirrorMesh
from omnisim.core.errors import OpticsError

PAPER_POLYGON_COUNTS = (16, 64, 256, 1024, 4096)
MIN_POLYGONS = 8
MAX_POLYGONS = 1 << 20
# A cell is as tall as wide for about four sectors per ring; up to this factor off is accepted.
MAX_STRETCH = 4.0
# Ring j of R stands at (j/R)^0.7 of the rim's radius in the image. Equal spacing (exponent 1)
# wastes rings near the center, where cells are narrow anyway. Swept from 0.5 to 1.3 over five mesh
# sizes for the paper's mirror: 0.7 has the smallest mean error and 8 to 14 % less maximum.
RING_EXPONENT = 0.7


def sectors_and_rings(polygons: int) -> tuple[int, int]:
    """Split a polygon count into sectors around the axis and rings, as close to 4 : 1 as possible.

    The number of sectors is a multiple of four, so all four quadrants are equal. For 2ⁿ polygons
    with even n, the split is the paper's 2^(n/2+1) × 2^(n/2−1).

    Raises:
        OpticsError: the count has no such split; the message names the nearest counts that have
            one.
    """
    if not MIN_POLYGONS <= polygons <= MAX_POLYGONS:
        limits = f"{MIN_POLYGONS} to {MAX_POLYGONS}"
        raise OpticsError(f"mirror: expected {limits} polygons, got {polygons}")
    split = _best_split(polygons)
    if split is None:
        below = next(n for n in range(polygons - 1, 0, -1) if _best_split(n))
        above = next(n for n in range(polygons + 1, 2 * polygons) if _best_split(n))
        raise OpticsError(
            "mirror: expected polygons that make rings of equal sectors in four equal quadrants, "
            f"the nearest {below} and {above}, got {polygons}"
        )
    return split


def tessellate(mirror: HyperbolicMirror, polygons: int) -> MirrorMesh:
    """Tessellate a mirror: every vertex is on the surface, the last ring on the rim.

    Raises:
        OpticsError: see `sectors_and_rings`.
    """
    sectors, rings = sectors_and_rings(polygons)
    theta = _ring_angles_rad(mirror, rings)
    azimuth = np.arange(sectors) * (2.0 * math.pi / sectors)
    apex = np.array([[0.0, 0.0, mirror.vertex_height_m]])
    circles = mirror.surface_points(theta[:, None], azimuth[None, :]).positions_m
    vertices = np.concatenate((apex, circles.reshape(-1, 3)))
    return MirrorMesh(
        vertices_m=vertices,
        normals=mirror.normals(vertices),
        triangles=_triangles(sectors, rings),
        polygons=polygons,
        sectors=sectors,
        rings=rings,
    )


def sector_triangles_m(mirror: HyperbolicMirror, sectors: int, rings: int) -> NDArray[np.float64]:
    """Corners (2 rings − 1, 3, 3) of the triangles in the mesh's first sector, mirror frame.

    All sectors are equal up to a rotation about the axis.
    """
    theta = np.concatenate(([0.0], _ring_angles_rad(mirror, rings)))
    azimuth = np.array([0.0, 2.0 * math.pi / sectors])
    points = mirror.surface_points(theta[:, None], azimuth).positions_m
    inner, outer = points[:-1], points[1:]
    lower = np.stack((inner[:, 0], outer[:, 0], outer[:, 1]), axis=1)
    upper = np.stack((inner[:, 0], outer[:, 1], inner[:, 1]), axis=1)
    return np.concatenate((lower, upper[1:]))  # the cell at the vertex has no upper triangle


def _ring_angles_rad(mirror: HyperbolicMirror, rings: int) -> NDArray[np.float64]:
    """Angles of incidence (rings,) of the rings; the last one is the rim's."""
    share = (np.arange(1, rings + 1) / rings) ** RING_EXPONENT
    theta = mirror.theta_from_tangent(share * mirror.tangent_from_theta(mirror.theta_max_rad))
    theta[-1] = mirror.theta_max_rad  # without rounding errors
    return theta


def _best_split(polygons: int) -> tuple[int, int] | None:
    splits = [
        (sectors, polygons // sectors)
        for rings in range(1, math.isqrt(4 * polygons) + 1)
        if polygons % rings == 0
        and (sectors := polygons // rings) % 4 == 0
        and sectors >= 8
        and 1.0 / MAX_STRETCH <= sectors / (4.0 * rings) <= MAX_STRETCH
    ]
    return min(splits, key=lambda split: abs(math.log(split[0] / (4.0 * split[1]))), default=None)


def _triangles(sectors: int, rings: int) -> NDArray[np.int64]:
    """Triangles (m, 3) over vertex 0 on the axis and `rings` circles of `sectors` vertices."""
    here = np.arange(sectors, dtype=np.int64)
    following = (here + 1) % sectors
    fan = np.stack((np.zeros_like(here), 1 + here, 1 + following), axis=-1)
    inner = 1 + sectors * np.arange(rings - 1, dtype=np.int64)[:, None]
    outer = inner + sectors
    lower = np.stack((inner + here, outer + here, outer + following), axis=-1)
    upper = np.stack((inner + here, outer + following, inner + following), axis=-1)
    cells = np.stack((lower, upper), axis=2)  # the two triangles of a cell stay together
    return np.concatenate((fan, cells.reshape(-1, 3)))
