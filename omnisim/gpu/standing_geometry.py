"""What stands still, ready to draw: in the world's axes, by look, in compact chunks.

The scene's draws are one instance each, with matrices of its own: hundreds of draws a face, each
culled as a whole. Here instances of one look are one piece of geometry, of which a face draws the
chunks that it sees, with one call: their indices are put together anew in every frame. (Indirect
draws, one for each chunk, cost a software renderer 3 µs each, as much as a hundred triangles.)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.chunks import chunks_of, compact_order
from omnisim.gpu.vertex_format import VERTEX, fill_vertices, vertex_array
from omnisim.scene.model import AlphaMode, Material

if TYPE_CHECKING:
    from omnisim.gpu.scene_buffers import Draw

# Each instance has its own copy here: what would take more triangles than this is drawn as it is,
# as are places so far away that a float32 does not resolve a tenth of a millimetre there.
MOST_TRIANGLES = 8_000_000
FARTHEST_M = 1500.0


TRIANGLE = np.dtype([("vertices", "<u4", 3)])  # moved as a whole


class Look(NamedTuple):
    """What chunks of one call have in common."""

    material: Material
    texture: moderngl.Texture


class StandingGeometry:
    """Instances of opaque and masked materials that do not move.

    Args:
        context: where.
        draws: all of the scene.

    Attributes:
        looks: of the chunks.
        anchor_m: (3,) float64, origin of the positions, world.
        chunks: compact pieces, look by look; boxes counted from the anchor.
        look_of_chunk: (n,).
        taken: (draws,), which of the draws are in here.
        is_empty: nothing is: then it has no chunks.
    """

    def __init__(self, context: moderngl.Context, draws: Sequence[Draw]):
        self._context = context
        self.anchor_m = _middle(draws)
        self.taken = _taken(draws, self.anchor_m)
        groups: dict[tuple[object, ...], list[Draw]] = {}
        for draw, taken in zip(draws, self.taken, strict=True):
            if taken:
                groups.setdefault(_key(draw), []).append(draw)
        self.looks = tuple(Look(group[0].material, group[0].texture) for group in groups.values())
        vertices, triangles, firsts, looks = [], [], [], []
        vertex = triangle = 0
        for look, group in enumerate(groups.values()):
            for draw in group:
                some_vertices, some_triangles = _in_the_world(draw, self.anchor_m)
                order, cuts = compact_order(some_vertices["in_position"][some_triangles])
                vertices.append(some_vertices)
                triangles.append(some_triangles[order] + np.uint32(vertex))
                firsts.append(triangle + cuts)
                looks.append(np.full(len(cuts), look))
                vertex += len(some_vertices)
                triangle += len(some_triangles)
        self.is_empty = not groups
        if self.is_empty:
            return
        all_vertices, all_triangles = np.concatenate(vertices), np.concatenate(triangles)
        corners = all_vertices["in_position"][all_triangles]
        self.chunks = chunks_of(corners, np.concatenate(firsts))
        self.look_of_chunk = np.concatenate(looks)
        self._vertices = context.buffer(all_vertices)
        self._triangles = all_triangles.astype("<u4").view(TRIANGLE)[:, 0]

    def vertex_array(
        self, program: moderngl.Program, indices: moderngl.Buffer
    ) -> moderngl.VertexArray:
        """The vertex array that feeds a program with what `indices` name; attributes it does not
        use are skipped."""  # fmt: skip
        return vertex_array(self._context, program, self._vertices, indices)

    def indices(self, chunks: NDArray[np.intp]) -> NDArray[np.void]:
        """Indices (n,) of `TRIANGLE` of the triangles of some chunks, in their order."""
        first, count = self.chunks.first[chunks], self.chunks.count[chunks]
        before = np.cumsum(count) - count
        triangles = np.repeat(first - before, count)
        triangles += np.arange(len(triangles))
        return np.take(
            self._triangles, triangles, mode="clip"
        )  # none is out of range: it is quicker


def _key(draw: Draw) -> tuple[object, ...]:
    material = draw.material
    cutoff = material.alpha_cutoff if material.alpha_mode is AlphaMode.MASK else None
    return (
        draw.texture.glo, material.base_color, material.alpha_mode, cutoff,
        material.double_sided, material.unlit,
    )  # fmt: skip


def _middle(draws: Sequence[Draw]) -> NDArray[np.float64]:
    """Middle (3,) of what does not move, world."""
    still = [draw.centre_m for draw in draws if draw.mover is None]
    if not still:
        return np.zeros(3)
    return 0.5 * (np.min(still, axis=0) + np.max(still, axis=0))


def _taken(draws: Sequence[Draw], anchor_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    taken = np.zeros(len(draws), dtype=np.bool_)
    triangles = 0
    for index, draw in enumerate(draws):
        if draw.mover is not None or draw.material.alpha_mode is AlphaMode.BLEND or not draw.count:
            continue
        if np.linalg.norm(draw.centre_m - anchor_m) + draw.radius_m > FARTHEST_M:
            continue
        if triangles + draw.count // 3 <= MOST_TRIANGLES:
            triangles += draw.count // 3
            taken[index] = True
    return taken


def _in_the_world(
    draw: Draw, anchor_m: NDArray[np.float64]
) -> tuple[NDArray[np.void], NDArray[np.uint32]]:
    """Vertices (n,) in the world's axes, origin at the anchor, and triangles (m, 3) of them, which
    turn the same way round in all draws."""  # fmt: skip
    vertices = np.zeros(len(draw.mesh.positions), dtype=VERTEX)
    fill_vertices(vertices, draw.mesh)
    matrix = draw.own_from_mesh
    vertices["in_position"] = draw.mesh.positions @ matrix[:3, :3].T + (matrix[:3, 3] - anchor_m)
    if draw.mesh.normals is not None:
        vertices["in_normal"] = draw.mesh.normals @ draw.normal_from_mesh.T
    triangles = draw.mesh.triangles
    return vertices, triangles[:, (0, 2, 1)] if draw.mirrored else triangles
