"""Draws the visible clusters of all views with one call per batch of buckets."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import compress, groupby, product
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Bools, Floats, Indices
from omnisim.rendering.opengl.culling.cluster_culling import BANDS, ClusterCuller, CommandRange
from omnisim.rendering.opengl.gl.buffers import gpu_buffer
from omnisim.rendering.opengl.gl.functions import IndirectDraws, StorageBindings, constant_call
from omnisim.rendering.opengl.gl.shader_files import build_compute_shader
from omnisim.rendering.opengl.gl.state import GlState
from omnisim.rendering.opengl.surfaces.scene_drawer import map_units
from omnisim.rendering.opengl.world.clustered_geometry import (
    Bucket,
    ClusteredGeometry,
    item_light_coordinates,
    object_triangles,
)
from omnisim.rendering.opengl.world.draw_item import DrawItem
from omnisim.rendering.opengl.world.scene_textures import TextureArray
from omnisim.rendering.opengl.world.vertex_format import (
    PALETTE_UNIT,
    VertexPalette,
    cluster_vertex_array,
)


class BucketProgram(NamedTuple):
    """Program that draws a bucket."""

    program: moderngl.Program  # program for vertices of type `CLUSTER_VERTEX`
    # sampler of its textures; None: the textures' own settings
    sampler: moderngl.Sampler | None = None
    # uniform for the index of the first command; None: not used
    first_command: moderngl.Uniform | None = None


class DrawState(NamedTuple):
    """State of a draw call."""

    shader: BucketProgram  # program shared by all of its buckets
    shows_back: bool  # draw back faces, too
    textures: tuple[tuple[int, int], ...]  # names of the textures that the program reads, by unit


class DrawBatches:
    """Batches of a geometry's buckets: consecutive buckets with equal state.

    Args:
        find_program: function from a bucket to its program.
        both_sides: draw back faces, too.

    Attributes:
        states: state of each batch.
        groups: (batches,) number of cluster groups.
        has_ids: the programs number triangles by their places, and draw clusters whole.
    """

    def __init__(
        self,
        geometry: ClusteredGeometry,
        find_program: Callable[[Bucket], BucketProgram],
        both_sides: bool,
    ):
        palette = geometry.palette.glo
        states = [
            _state(bucket, find_program(bucket), both_sides, palette) for bucket in geometry.buckets
        ]
        runs = [(state, len(list(run))) for state, run in groupby(states)]
        self.states = [state for state, _ in runs]
        self.has_ids = any(state.shader.first_command is not None for state in self.states)
        ends = np.cumsum([length for _, length in runs])
        groups = np.concatenate(([0], np.cumsum(geometry.buffers.groups_of_bucket)[ends - 1]))
        self.groups: Indices = np.diff(groups)


def _state(bucket: Bucket, shader: BucketProgram, both_sides: bool, palette: int) -> DrawState:
    units = [(0, "u_textures"), *map_units()]
    arrays = zip(units, (bucket.array, *(bucket.maps or ())), strict=False)
    textures = [(*unit, array.array.glo) for unit, array in arrays if array is not None]
    textures.append((PALETTE_UNIT, "u_palette", palette))
    return DrawState(
        shader,
        bucket.double_sided or both_sides,
        tuple((unit, texture) for unit, name, texture in textures if name in shader.program),
    )


class ClusterDrawer:
    """Draws visible clusters with the programs of one pass."""

    def __init__(
        self,
        context: moderngl.Context,
        geometry: ClusteredGeometry,
        culler: ClusterCuller,
        batches: DrawBatches,
    ):
        self.culler, self._states = culler, batches.states
        self._draws = IndirectDraws()
        self._array = cluster_vertex_array(
            context,
            batches.states[0].shader.program,
            geometry.vertices,
            geometry.indices,
            culler.instances,
            geometry.normals,
            geometry.light_coordinates,
        )
        # equal in all frames
        self._calls: list[list[list[Callable[[], object]]]] = []
        set_state = _StateCalls()
        for pass_index in range(culler.passes):
            self._calls.append(
                [self._calls_of(pass_index, ranges, set_state) for ranges in culler.slices]
            )

    def draw(self, pass_index: int) -> None:
        """Draw the commands of a pass, with the state of `GlState.drawing`.

        All previous passes of the frame must have been drawn, and nothing else since.
        """
        if pass_index == 0:
            self._draws.bind(self.culler.commands.glo, self.culler.counts.glo, self._array.glo)
        for number, calls in enumerate(self._calls[pass_index]):
            if number:
                self.culler.next_slice(pass_index, number)
            for call in calls:
                call()

    def _calls_of(
        self, pass_index: int, ranges: Sequence[CommandRange], set_state: _StateCalls
    ) -> list[Callable[[], object]]:
        """Calls that draw a slice, band by band."""
        calls: list[Callable[[], object]] = []
        set_state.forget_program()  # the culling program is still bound
        for band, commands in product(range(BANDS), ranges):
            state, first = self._states[commands.batch], commands.first + band * commands.max_count
            calls += set_state.to(state)
            if state.shader.first_command is not None:
                calls.append(partial(setattr, state.shader.first_command, "value", first))
            count = (BANDS * pass_index + band) * self.culler.ranges + commands.number
            calls.append(self._draws.drawing(first, count, commands.max_count))
        return calls


class _StateCalls:
    """Calls that change only the state that differs from the previous draw's."""

    def __init__(self) -> None:
        self._gl, self._draws = GlState(), IndirectDraws()
        self._program: moderngl.Program | None = None
        self._sampler: moderngl.Sampler | None = None
        self._shows_back = False
        self._textures: dict[int, int] = {}

    def forget_program(self) -> None:
        """Bind the next program in any case."""
        self._program = None

    def to(self, state: DrawState) -> Iterator[Callable[[], object]]:
        """Calls that change the previous state to `state`."""
        shader = state.shader
        if shader.program is not self._program:
            self._program = shader.program
            yield constant_call(self._draws.use_program, shader.program.glo)
        if state.shows_back is not self._shows_back:
            self._shows_back = state.shows_back
            yield partial(self._gl.set_culling, not state.shows_back)
        for unit, texture in state.textures:
            if self._textures.get(unit) != texture:
                self._textures[unit] = texture
                yield constant_call(self._gl.bind_texture, unit, texture)
        if shader.sampler is not None and shader.sampler is not self._sampler:
            self._sampler = shader.sampler
            yield partial(shader.sampler.use, 0)


# Draws blended items back to front, sorted on the GPU, in all views with one call.
#
# One program has all of their materials, since distance alone sets the order.

# Limits of one program, and of a sort that compares all pairs.
MAX_ARRAYS, MAX_TRIANGLES_OF_ITEM, MAX_ITEMS = 4, 1024, 1024
# Material kind in shaders/scene/material.glsl: number of the texture array, and flags.
_NO_ARRAY, _UNLIT, _DOUBLE_SIDED = 7, 8, 16
_ITEMS_BINDING = 9  # after the culler's commands and counts
_ITEM = np.dtype(  # as in shaders/culling/blended.comp
    [
        ("center", "<f4", 3),
        ("radius", "<f4"),
        ("first_triangle", "<u4"),
        ("triangles", "<u4"),
        ("object", "<u4"),
        ("unused", "<u4"),
    ]
)


def arrays_of(items: Sequence[DrawItem]) -> list[TextureArray]:
    """Texture arrays that the items use."""
    arrays = {id(item.texture_layer.array): item.texture_layer.array for item in items}
    return [array for array in arrays.values() if array is not None]


def can_sort(items: Sequence[DrawItem], geometry: ClusteredGeometry | None) -> Bools:
    """Mask (n,) of blended items to sort and draw at once: matte, rigid, small and near ones."""
    fits = [
        geometry is not None
        and item.texture_layer.reflectance is None
        and item.mesh.deformation is None
        and 0 < item.triangles <= MAX_TRIANGLES_OF_ITEM
        and item.is_near(geometry.anchor_m)
        for item in items
    ]
    few = sum(fits) <= MAX_ITEMS and len(arrays_of([*compress(items, fits)])) <= MAX_ARRAYS
    return np.array(fits, dtype=np.bool_) & few


class BlendedDrawer:
    """Sorts and draws a scene's blended items.

    Args:
        geometry: clusters of the scene; their objects carry the items.
        culler: culler of the clusters, with room for the items' commands; its matrices place them.
        items: items that can be sorted, see `can_sort`.
        program: program for `CLUSTER_VERTEX` and all texture arrays of the items.
    """

    def __init__(
        self,
        context: moderngl.Context,
        geometry: ClusteredGeometry,
        culler: ClusterCuller,
        items: Sequence[DrawItem],
        program: moderngl.Program,
    ):
        self._context, self._culler, self._program = context, culler, program
        self._arrays = arrays_of(items)
        palette = VertexPalette()
        kinds = [self._kind(item) for item in items]
        vertices, normals, triangles = object_triangles(items, geometry.anchor_m, palette, kinds)
        self._palette = palette.texture(context)
        views, total = culler.views, len(triangles)
        centers = np.zeros((total, 4), dtype=np.float32)
        centers[:, :3] = vertices["in_position"][triangles].mean(axis=1, dtype=np.float64)
        self._items = len(items)
        self._indices = indices = gpu_buffer(context, 12 * total * views.cameras)
        self._vertices = cluster_vertex_array(
            context,
            program,
            gpu_buffer(context, vertices),
            indices,
            culler.instances,
            gpu_buffer(context, normals),
            item_light_coordinates(context, items),
        )
        self._shader = build_compute_shader(context, "culling/blended.comp")
        self._shader["u_items"], self._shader["u_triangles"] = len(items), total
        self._shader["u_first_command"] = culler.first_blended
        self._shader["u_count_index"] = culler.blended_count
        bound = [
            gpu_buffer(context, _packed(items, geometry.anchor_m)), gpu_buffer(context, centers),
            gpu_buffer(context, triangles.astype("<u4")), indices,
        ]  # fmt: skip
        self._bound = StorageBindings(bound, _ITEMS_BINDING)
        self._draws, self._state = IndirectDraws(), GlState()
        self._draw_items = self._draws.drawing(
            culler.first_blended, culler.blended_count, views.count * len(items)
        )

    @property
    def memory_bytes(self) -> int:
        """Size of the sorted indices for all cameras, bytes."""
        return self._indices.size

    def draw(self) -> None:
        """Sort and draw after the culler's last run; needs blending, and `GlState.drawing`."""
        context, draws, culler = self._context, self._draws, self._culler
        self._bound.bind()
        self._shader.run(self._items, culler.views.cameras)
        context.memory_barrier(context.COMMAND_BARRIER_BIT | context.ELEMENT_ARRAY_BARRIER_BIT)
        self._state.set_culling(False)
        for unit, array in enumerate(self._arrays):
            self._state.bind_texture(unit, array.array.glo)
        self._state.bind_texture(PALETTE_UNIT, self._palette.glo)
        draws.bind(culler.commands.glo, culler.counts.glo, self._vertices.glo)
        draws.use_program(self._program.glo)
        self._draw_items()

    def _kind(self, item: DrawItem) -> int:
        array = item.texture_layer.array
        number = _NO_ARRAY if array is None else self._arrays.index(array)
        return number + _UNLIT * item.material.unlit + _DOUBLE_SIDED * item.material.double_sided


def _packed(items: Sequence[DrawItem], anchor_m: Floats) -> NDArray[np.void]:
    """Items (n,) as the shader reads them."""
    packed = np.zeros(len(items), dtype=_ITEM)
    packed["triangles"] = [item.triangles for item in items]
    packed["first_triangle"] = np.cumsum(packed["triangles"]) - packed["triangles"]
    for row, item in zip(packed, items, strict=True):
        is_static = item.object_index is None
        row["center"] = item.center_m - (anchor_m if is_static else 0.0)
        row["object"] = 0 if item.object_index is None else 1 + item.object_index
        # matrices are floats
        row["radius"] = item.radius_m * (1.0 + 1e-5) + 1e-5 * np.abs(row["center"]).sum()
    return packed
