"""What of a scene is wrapped around a point: parts that nobody could look out of."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.scene.model import AlphaMode, Scene

# A closed surface winds once around what is inside, and not at all around what is outside. Half of
# it is what a wall without end winds around a point in front of it.
ENCLOSED = 0.5


def enclosing_nodes(
    scene: Scene, point_m: ArrayLike, near_m: float = 0.0, ignored: tuple[str, ...] = ()
) -> tuple[str, ...]:
    """Names of the nodes that a point is inside of; all of them where only they together close.

    A node encloses the point when its surface winds around it, and still does without the triangles
    that are wholly nearer than `near_m`, which a camera there does not draw. Surfaces with gaps
    count by the share of the view that they take. What is blended does not count: it is glass.

    Args:
        scene: whose nodes are meant.
        point_m: (3,), world.
        near_m: what is nearer is not seen.
        ignored: nodes that do not count.
    """
    point = np.asarray(point_m, dtype=np.float64)
    windings: dict[str, NDArray[np.float64]] = {}
    for instance in scene.instances:
        if instance.name in ignored:
            continue
        mesh, matrix = scene.meshes[instance.mesh], instance.world_from_mesh
        if scene.materials[mesh.material].alpha_mode is AlphaMode.BLEND:
            continue
        ways = mesh.positions.astype(np.float64) @ matrix[:3, :3].T + (matrix[:3, 3] - point)
        around = _windings(ways[mesh.triangles])
        drawn = (np.linalg.norm(ways, axis=1) >= near_m)[mesh.triangles].any(axis=1)
        both = np.array((around.sum(), around[drawn].sum()))
        windings[instance.name] = windings.get(instance.name, 0.0) + both
    found = tuple(name for name, both in windings.items() if _encloses(both))
    if not found and windings and _encloses(np.sum(list(windings.values()), axis=0)):
        return tuple(windings)
    return found


def _encloses(both: NDArray[np.float64]) -> bool:
    return bool(np.all(np.abs(both) > ENCLOSED))  # turned inside out it is closed, too


def _windings(ways: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shares (n,) of the view that triangles (n, 3, xyz) take, seen from the origin.

    Negative where the front is seen; 0 for triangles without area.

    Source: van Oosterom and Strackee, "The Solid Angle of a Plane Triangle", IEEE Transactions on
    Biomedical Engineering 30 (1983).
    """
    a, b, c = ways[:, 0], ways[:, 1], ways[:, 2]
    la, lb, lc = np.linalg.norm(ways, axis=2).T
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", p, q) for p, q in ((a, b), (b, c), (c, a)))
    angles: NDArray[np.float64] = np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)
    return angles / (2.0 * math.pi)
