"""What stands still, ready to draw: in the world's axes, by look, in compact chunks.

The scene's draws are one instance each, with matrices of its own: hundreds of draws a face, each
culled as a whole. Here instances of one look are one piece of geometry, of which a face draws the
chunks that it sees, with one call: their indices are put together anew in every frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.culling.clusters import cut, ranges
from omnisim.gpu.scene.light_baking import Shading, bake_directional_light, shadings
from omnisim.gpu.scene.vertex_format import VERTEX, fill_vertices, vertex_array
from omnisim.scene.model import AlphaMode, Lighting, Material

if TYPE_CHECKING:
    from omnisim.gpu.scene.scene_buffers import DrawItem

# Each instance has its own copy here: what would take more triangles than this is drawn as it is,
# as are places so far away that a float32 does not resolve a tenth of a millimetre there.
MOST_TRIANGLES = 8_000_000
FARTHEST_M = 1500.0
# Of white: a third of a step of 255 in the dark, where these are finest, a hundredth at white.
_SAME_LIGHT = 1e-4
TRIANGLE = np.dtype([("vertices", "<u4", 3)])  # moved as a whole


class MaterialBatch(NamedTuple):
    """What chunks of one call have in common.

    Attributes:
        material, texture: how they look.
        shading: what is known of the light on their triangles.
        number: into `StaticGeometry.looks`.
    """

    material: Material
    texture: moderngl.Texture
    shading: Shading
    number: int


class StaticGeometry:
    """Instances of opaque and masked materials that do not move.

    Args:
        context: where.
        draws: all of the scene.
        lighting: of the scene.

    Attributes:
        looks: of the chunks.
        anchor_m: (3,) float64, origin of the positions, world.
        chunks: compact pieces, of one look each; boxes counted from the anchor.
        groups: of chunks that are near each other, and of such groups, see `Cut`.
        look_of_chunk: (n,).
        order: (m,) of the triangles, chunk by chunk; counted through all draws taken.
        taken: (draws,), which of the draws are in here.
        is_empty: nothing is: then it has no chunks.
    """

    def __init__(self, context: moderngl.Context, draws: Sequence[DrawItem], lighting: Lighting):
        self._context = context
        self.anchor_m = _middle(draws)
        self.taken = _taken(draws, self.anchor_m)
        draws = [draw for draw, taken in zip(draws, self.taken, strict=True) if taken]
        self.is_empty = not draws
        if self.is_empty:
            return
        vertices, triangles = _in_the_world(draws, self.anchor_m)
        corners = vertices["in_position"][triangles]
        shading, normals = shadings(vertices, triangles, lighting)
        shading[_either_side(draws)] = Shading.UNKNOWN.value
        known = shading == Shading.BAKED.value
        lights = bake_directional_light(normals[known], lighting)
        vertices, triangles[known] = _lit(vertices, triangles, known, lights)
        self.looks, look_of_triangle = _looks(draws, shading)
        self.order, self.chunks, self.groups = cut(corners, look_of_triangle)
        self.look_of_chunk = look_of_triangle[self.order[self.chunks.first]]
        self._vertices = context.buffer(vertices)
        self._triangles = triangles[self.order].astype("<u4").view(TRIANGLE)[:, 0]

    def vertex_array(
        self, program: moderngl.Program, indices: moderngl.Buffer
    ) -> moderngl.VertexArray:
        """The vertex array that feeds a program with what `indices` name; attributes it does not
        use are skipped."""  # fmt: skip
        return vertex_array(self._context, program, self._vertices, indices)

    def indices(self, chunks: NDArray[np.intp]) -> NDArray[np.void]:
        """Indices (n,) of `TRIANGLE` of the triangles of some chunks, in their order."""
        triangles = ranges(self.chunks.first[chunks], self.chunks.count[chunks])
        # clipping, which never happens, is quicker than to look whether one is out of range
        return np.take(self._triangles, triangles, mode="clip")


def _looks(
    draws: Sequence[DrawItem], shading: NDArray[np.int8]
) -> tuple[tuple[MaterialBatch, ...], NDArray[np.intp]]:
    """The looks that triangles of some draws have, and which one each of them (n,) has."""
    draw_of_triangle = np.repeat(np.arange(len(draws)), [draw.count // 3 for draw in draws])
    kinds = len(Shading) * draw_of_triangle + shading
    looks: dict[tuple[object, ...], MaterialBatch] = {}
    look_of_kind = np.zeros(len(Shading) * len(draws), dtype=np.intp)
    for kind in np.flatnonzero(np.bincount(kinds)).tolist():
        draw, known = draws[kind // len(Shading)], Shading(kind % len(Shading))
        look = MaterialBatch(draw.material, draw.texture, known, len(looks))
        look_of_kind[kind] = looks.setdefault((*_key(draw), known), look).number
    return tuple(looks.values()), look_of_kind[kinds]


def _key(draw: DrawItem) -> tuple[object, ...]:
    material = draw.material
    cutoff = material.alpha_cutoff if material.alpha_mode is AlphaMode.MASK else None
    return (
        draw.texture.glo, material.base_color, material.alpha_mode, cutoff,
        material.double_sided, material.unlit,
    )  # fmt: skip


def _middle(draws: Sequence[DrawItem]) -> NDArray[np.float64]:
    """Middle (3,) of what does not move, world."""
    still = [draw.centre_m for draw in draws if draw.object_index is None]
    if not still:
        return np.zeros(3)
    return 0.5 * (np.min(still, axis=0) + np.max(still, axis=0))


def _taken(draws: Sequence[DrawItem], anchor_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    taken = np.zeros(len(draws), dtype=np.bool_)
    triangles = 0
    for index, draw in enumerate(draws):
        if draw.object_index is not None or draw.material.alpha_mode is AlphaMode.BLEND:
            continue
        if not draw.count:  # a mesh without triangles has no chunk
            continue
        if np.linalg.norm(draw.centre_m - anchor_m) + draw.radius_m > FARTHEST_M:
            continue
        if triangles + draw.count // 3 <= MOST_TRIANGLES:
            triangles += draw.count // 3
            taken[index] = True
    return taken


def _in_the_world(
    draws: Sequence[DrawItem], anchor_m: NDArray[np.float64]
) -> tuple[NDArray[np.void], NDArray[np.uint32]]:
    """Vertices (n,) in the world's axes, origin at the anchor, and their triangles (m, 3), draw by
    draw, which turn the same way round in all."""  # fmt: skip
    vertices = np.zeros(sum(len(draw.mesh.positions) for draw in draws), dtype=VERTEX)
    triangles = []
    base = 0
    for draw in draws:
        mesh, matrix = draw.mesh, draw.object_from_mesh
        part = vertices[base : base + len(mesh.positions)]
        fill_vertices(part, mesh)
        part["in_position"] = mesh.positions @ matrix[:3, :3].T + (matrix[:3, 3] - anchor_m)
        if mesh.normals is not None:
            part["in_normal"] = mesh.normals @ draw.normal_from_mesh.T
        own = mesh.triangles[:, (0, 2, 1)] if draw.flips_winding else mesh.triangles
        triangles.append(own + np.uint32(base))
        base += len(part)
    return vertices, np.concatenate(triangles)


def _either_side(draws: Sequence[DrawItem]) -> NDArray[np.bool_]:
    """Which triangles (n,) show both sides, or no light: what is known of a front is of no use."""
    none = [draw.material.double_sided or draw.material.unlit for draw in draws]
    return np.repeat(none, [draw.count // 3 for draw in draws])


def _lit(
    vertices: NDArray[np.void],
    triangles: NDArray[np.uint32],
    known: NDArray[np.bool_],
    lights: NDArray[np.float32],
) -> tuple[NDArray[np.void], NDArray[np.uint32]]:
    """Vertices with light instead of normals for the `known` triangles, and those triangles.

    Args:
        vertices: (n,) of `VERTEX`.
        triangles: (m, 3), all.
        known: (m,), k of them.
        lights: (k, 3), linear RGB.

    Returns:
        The vertices, and copies of those that have two lights, or light and a normal; and (k, 3).
    """
    own = triangles[known].ravel()
    lights = np.repeat(lights, 3, axis=0)
    at_vertex = np.zeros((len(vertices), 3), dtype=np.float32)
    at_vertex[own] = lights  # of all that a vertex should have, one
    at_vertex[triangles[~known].ravel()] = np.inf  # it has to keep its normal
    fits = (np.abs(np.take(at_vertex, own, axis=0) - lights) < _SAME_LIGHT).all(axis=1)
    there = own[fits]
    vertices["in_normal"][there] = np.take(at_vertex, there, axis=0)
    if fits.all():
        return vertices, own.reshape(-1, 3)
    copies = vertices[own[~fits]]
    copies["in_normal"] = lights[~fits]
    own[~fits] = np.arange(len(vertices), len(vertices) + len(copies))
    return np.concatenate((vertices, copies)), own.reshape(-1, 3)
