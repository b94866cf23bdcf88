"""Enclosure test of a point by a scene's nodes, based on winding numbers."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.arrays import Floats
from omnisim.scene.model import Scene
from omnisim.scene.surface_kind import SurfaceKind, kind_of

# The winding number of a closed surface is 1 inside and 0 outside; that of an infinite wall is ½.
MIN_WINDING_NUMBER = 0.5


def enclosing_nodes(
    scene: Scene, point_m: ArrayLike, near_m: float = 0.0, ignored: tuple[str, ...] = ()
) -> tuple[str, ...]:
    """Names of the nodes that enclose a point; all of them if only their union does.

    A node encloses the point if its surface winds around it, with and without the triangles
    entirely nearer than `near_m`, which a camera at the point does not render. Surfaces with gaps
    count by their solid angle. Blended surfaces, such as glass, do not count.

    `point_m` (3,) is in the world frame; nodes with `ignored` names do not count.
    """
    point = np.asarray(point_m, dtype=np.float64)
    windings: dict[str, Floats] = {}  # for all triangles, and for the rendered ones
    for instance in scene.instances:
        if instance.name in ignored:
            continue
        mesh, matrix = scene.meshes[instance.mesh], instance.world_from_mesh
        if kind_of(scene.materials[mesh.material]) & SurfaceKind.BLENDED:
            continue
        offsets = mesh.positions.astype(np.float64) @ matrix[:3, :3].T + (matrix[:3, 3] - point)
        numbers = _winding_numbers(offsets[mesh.triangles])
        drawn = (np.linalg.norm(offsets, axis=1) >= near_m)[mesh.triangles].any(axis=1)
        both = np.array((numbers.sum(), numbers[drawn].sum()))
        windings[instance.name] = windings.get(instance.name, 0.0) + both
    enclosing = tuple(name for name, both in windings.items() if _encloses(both))
    if not enclosing and windings and _encloses(np.sum(list(windings.values()), axis=0)):
        return tuple(windings)
    return enclosing


def _encloses(windings: Floats) -> bool:
    return bool(np.all(np.abs(windings) > MIN_WINDING_NUMBER))  # an inverted surface counts, too


def _winding_numbers(triangles: Floats) -> Floats:
    """Signed solid angles (n,) of triangles (n, 3, xyz) at the origin, as fractions of the sphere.

    Negative if the front faces the origin; 0 for degenerate triangles.

    Source: van Oosterom and Strackee, "The Solid Angle of a Plane Triangle", IEEE Transactions on
    Biomedical Engineering 30 (1983).
    """
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    la, lb, lc = np.linalg.norm(triangles, axis=2).T
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", p, q) for p, q in ((a, b), (b, c), (c, a)))
    angles: Floats = np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)
    return angles / (2.0 * math.pi)
