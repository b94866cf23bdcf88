"""GPU culling of clusters for all views at once: frustum, normal cone, size, occlusion.

The result is a list of draw commands per batch of buckets, near clusters first, and its length.
Nothing returns to the CPU. If there may be more commands than a buffer holds, clusters are drawn
slice by slice, which bounds the memory for any scene.
"""

from __future__ import annotations

import math
from itertools import chain

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.culling.cluster_buffers import BOUNDS_UNIT, DEPTH_UNIT, ClusterBuffers
from omnisim.rendering.opengl.culling.cluster_views import Views
from omnisim.rendering.opengl.culling.command_slices import BANDS, command_slices
from omnisim.rendering.opengl.gl.buffers import gpu_buffer, written_buffer
from omnisim.rendering.opengl.gl.functions import COMMAND_BYTES, StorageBindings
from omnisim.rendering.opengl.gl.memory import gpu_allocation
from omnisim.rendering.opengl.gl.state import GlState

# A GPU rounds the position of an edge to a sixteenth of a texel at worst.
EDGE_PX = 0.125
_INSTANCE_BYTES = 144
_LIST_BYTES, _CANDIDATE_BYTES = 16, 12  # in shaders/culling/views.glsl
_MAX_PASSES = 4
MAX_COMMAND_BYTES = 128 * 2**20  # per slice, on a GPU that allows as many
_GROUP_SIZE = 64  # local_size_x of the shaders
_CELL_PX, _CELL_LEVELS = 64, 5  # of the last level, in shaders/culling/hi_z.glsl
# Minimum number of triangles for which two passes pay, three, and four.
MIN_TRIANGLES_OF_PASSES = (40_000, 200_000, 2_000_000)
# Clusters with triangles that look wider occlude others: they are drawn before the last pass.
OCCLUDERS_RAD = ((), (0.05,), (0.025, 0.007), (0.02, 0.005, 0.0015))
SETTINGS = np.dtype(  # as in shaders/culling/views.glsl
    [
        ("counts", "<u4", 4),
        ("atlas_px", "<f4", 2),
        ("depths_m", "<f4", 2),
        ("depth", "<f4", 2),
        ("ranges", "<u4"),
        ("both_sides", "<u4"),
        ("radius_px", "<f4"),
        ("clusters", "<u4"),
        ("pass_index", "<u4"),
        ("occluder_rad", "<f4"),
        ("first_range", "<u4"),
        ("blocks", "<u4"),
        ("unused", "<u4", 2),
    ]
)


class ClusterCuller:
    """Culls clusters for the views of cameras, and writes draw commands for the visible ones.

    Args:
        context: OpenGL context.
        buffers: cluster buffers.
        groups_of_batch: (batches,) number of groups per draw call, in order.
        views: views of all cameras.
        depth: atlas depth for occlusion tests between passes, one layer per camera if there may be
            several; None: a single pass.
        passes: number of passes if depth can be read.
        atlas_px: width and height of the atlas.
        depths_m: distances of the near and the far plane.
        samples: samples per texel.
        both_sides: keep clusters seen from behind, too.
        blended_items: number of blended items with commands of their own in all views.

    Attributes:
        views: see the arguments.
        passes: number of passes.
        slices: command ranges of each slice. Each pass rewrites them: the previous pass is drawn
            before its depth is read.
        ranges: number of ranges in all slices.
        commands: buffer with one slice's commands, then, from `first_blended` on, those of blended
            items; base instances index `instances`.
        counts: buffer with the number of commands per range, pass by pass, band by band, then, at
            `blended_count`, that of blended items.
        instances: buffer with one `vertex_format.INSTANCE` per object and view.
    """

    def __init__(
        self,
        context: moderngl.Context,
        buffers: ClusterBuffers,
        groups_of_batch: NDArray[np.integer],
        views: Views,
        depth: moderngl.Texture | moderngl.TextureArray | None,
        passes: int,
        atlas_px: tuple[int, int],
        depths_m: tuple[float, float],
        samples: int = 1,
        both_sides: bool = False,
        blended_items: int = 0,
    ):
        self._context, self._buffers, self.views = context, buffers, views
        self._state = GlState()
        self.passes, self._depth = (1 if depth is None else passes), depth
        limit = min(MAX_COMMAND_BYTES, int(context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"]))
        blended = blended_items * views.count
        self.slices, table, self.first_blended = command_slices(
            buffers.clusters_of_group, groups_of_batch, views.count,
            max(0, limit // COMMAND_BYTES - blended),
        )  # fmt: skip
        self.ranges = len(table)
        self.blended_count = _MAX_PASSES * BANDS * self.ranges
        words = buffers.group_count * views.count
        self._cells = [math.ceil(side / _CELL_PX) for side in atlas_px]
        with gpu_allocation(
            f"draw commands of {views.count} views of {buffers.cluster_count} clusters",
            "make the scene smaller, or the cameras fewer",
        ):
            self.commands = gpu_buffer(context, COMMAND_BYTES * (self.first_blended + blended))
            self.counts = gpu_buffer(context, 4 * (self.blended_count + 1))
            instances_bytes = _INSTANCE_BYTES * views.count * views.objects
            self.instances = written_buffer(context, instances_bytes)  # shadow maps' parts are
            words_of_cluster = views.cameras * math.ceil(views.tiles / 32)
            visible = np.zeros(buffers.cluster_count * words_of_cluster, dtype=np.uint32)
            visible_tiles = gpu_buffer(context, visible)
            groups_visible = np.zeros(views.cameras * buffers.group_count, dtype=np.uint32)
            visible_of_group = gpu_buffer(context, groups_visible)
            bins = gpu_buffer(context, 4 * views.cameras * buffers.cluster_count)
            halves = min(self.passes, 2)  # each pass reads one and writes the other
            self._lists = gpu_buffer(
                context, (_MAX_PASSES + 1) * _LIST_BYTES + halves * _CANDIDATE_BYTES * words
            )
            cells = sum(4**level for level in range(_CELL_LEVELS)) * math.prod(self._cells)
            hi_z = gpu_buffer(context, 4 * views.cameras * cells if depth else 0)
        near_m, far_m = depths_m
        slope = 0.0 if math.isinf(far_m) else -near_m / (far_m - near_m)
        settings = np.zeros((self.passes, len(self.slices)), dtype=SETTINGS)
        settings["counts"] = views.cameras, views.tiles, buffers.group_count, views.objects
        settings["atlas_px"], settings["depths_m"] = atlas_px, (near_m, min(far_m, 3e38))
        settings["depth"] = slope, near_m * (1.0 - slope)
        settings["ranges"], settings["both_sides"] = self.ranges, both_sides
        settings["clusters"], settings["blocks"] = buffers.cluster_count, buffers.block_count
        settings["radius_px"] = EDGE_PX if samples <= 1 else 0.5 + EDGE_PX
        settings["pass_index"] = np.arange(self.passes)[:, None]
        settings["occluder_rad"].T[:, :-1] = OCCLUDERS_RAD[self.passes - 1]
        settings["first_range"] = [ranges[0].number for ranges in self.slices]
        self._settings = [
            [written_buffer(context, one.tobytes()) for one in row] for row in settings
        ]
        self._written = views.cameras, views.tiles
        self._shown = written_buffer(context, buffers.all_shown)
        self._bound = StorageBindings([
            views.poses, views.clips_from_rig, views.rectangles_px, self.instances,
            self._lists, buffers.index_ranges, visible_tiles, self.commands, self.counts,
            gpu_buffer(context, table), self._shown, hi_z, bins, visible_of_group,
        ])  # fmt: skip
        self._blocks = math.ceil(buffers.block_count / _GROUP_SIZE)
        self._shaders = buffers.shaders
        self._is_layered = isinstance(depth, moderngl.TextureArray)

    @property
    def memory_bytes(self) -> int:
        """Size of the buffers for all cameras, bytes."""
        return self._bound.size

    def show(self, shown: NDArray[np.bool_]) -> None:
        """Show only the selected clusters (clusters,)."""
        self._shown.write(self._buffers.masks_of_groups(shown))

    def bind(self, pass_index: int = 0, slice_index: int = 0) -> None:
        """Bind the buffers of shaders/culling/views.glsl."""
        if (counts := (self.views.cameras, self.views.tiles)) != self._written:
            self._written = counts
            for settings in chain.from_iterable(self._settings):
                settings.write(np.array(counts, dtype=np.uint32))
        self._settings[pass_index][slice_index].bind_to_uniform_block(0)
        if pass_index == 0 and slice_index == 0:  # drawing does not rebind these
            self._bound.bind()
            self._state.bind_texture(BOUNDS_UNIT, self._buffers.bounds.glo)

    def run(self, pass_index: int, target: moderngl.Framebuffer | None = None) -> None:
        """Write the commands of a pass's first slice, for the current poses.

        Args:
            pass_index: number of the pass.
            target: bound target, whose depth is that of all previous passes; None: first pass.
        """
        context, shaders, views = self._context, self._shaders, self.views
        barrier = context.SHADER_STORAGE_BARRIER_BIT
        self.bind(pass_index)
        if pass_index == 0:
            context.memory_barrier(barrier)  # the last frame's draws may still read these buffers
            entries = max(views.count * views.objects, self.blended_count)
            shaders.instances.run(math.ceil(entries / _GROUP_SIZE))
            context.memory_barrier(barrier)
            shaders.groups.run(self._blocks, views.count)
        elif self._depth is not None and target is not None:
            columns, rows = self._cells
            fine, coarse = shaders.layered_hi_z if self._is_layered else shaders.hi_z
            with self._state.sampling(DEPTH_UNIT, self._depth, target):
                fine.run(columns, rows, views.cameras)  # 8 × 8 cells of level 1 per last-level cell
            context.memory_barrier(barrier)
            coarse.run(math.ceil(columns / 8), math.ceil(rows / 8), views.cameras)
        context.memory_barrier(barrier | context.COMMAND_BARRIER_BIT)
        cull = shaders.cull(0 if self.passes == 1 else 1 + min(pass_index, 1))
        cull.run_indirect(self._lists, pass_index * _LIST_BYTES)
        context.memory_barrier(barrier)
        self._make_commands(0)

    def next_slice(self, pass_index: int, slice_index: int) -> None:
        """Build the next slice's draw commands once the previous slice is drawn."""
        context = self._context
        self.bind(pass_index, slice_index)
        context.memory_barrier(context.SHADER_STORAGE_BARRIER_BIT | context.COMMAND_BARRIER_BIT)
        self._make_commands(slice_index)

    def _make_commands(self, slice_index: int) -> None:
        context = self._context
        self._shaders.commands.run(len(self.slices[slice_index]), self.views.cameras)
        context.memory_barrier(
            context.SHADER_STORAGE_BARRIER_BIT
            | context.COMMAND_BARRIER_BIT
            | context.VERTEX_ATTRIB_ARRAY_BARRIER_BIT
        )
