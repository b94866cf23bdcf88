"""GPU culling of clusters for all views at once: frustum, normal cone, size, occlusion.

The result is a list of draw commands per batch of buckets, near clusters first, and its length.
Nothing returns to the CPU. If there may be more commands than a buffer holds, clusters are drawn
slice by slice, which bounds the memory for any scene.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Bools, Floats, Indices, Uints32
from omnisim.rendering.contract import ScenePoses
from omnisim.rendering.opengl.culling.clusters import ClusterHierarchy
from omnisim.rendering.opengl.culling.triangle_culling import CullableTriangles
from omnisim.rendering.opengl.gl.buffers import gpu_allocation, gpu_buffer, written_buffer
from omnisim.rendering.opengl.gl.functions import COMMAND_BYTES, StorageBindings
from omnisim.rendering.opengl.gl.gpu_textures import texture_2d
from omnisim.rendering.opengl.gl.shader_files import (
    build_compute_shader,
    columns_first,
    set_uniforms,
)
from omnisim.rendering.opengl.gl.state import GlState

# A GPU rounds the position of an edge to a sixteenth of a texel at worst.
EDGE_PX = 0.125
_INSTANCE_BYTES = 144
_LIST_BYTES, _CANDIDATE_BYTES = 16, 12  # in shaders/culling/views.glsl
_MAX_PASSES = 8
_PAIRS, _TESTED, _LISTS = (kind * (_MAX_PASSES + 1) for kind in (1, 2, 3))
MAX_COMMAND_BYTES = 128 * 2**20  # per slice, on a GPU that allows as many
_GROUP_SIZE = 64  # local_size_x of the shaders
_CELL_PX, _CELL_LEVELS = 64, 6  # of the last level, in shaders/culling/hi_z.glsl
# Minimum number of triangles for which each further plan of passes pays. Clusters with triangles
# that look wider than a plan's angles occlude others: they are drawn in the passes before the last.
MIN_TRIANGLES_OF_PASSES = (40_000, 80_000, 200_000, 2_000_000)
OCCLUDERS_RAD = ((), (0.05,), (0.05, 0.015), (0.025, 0.007), (0.02, 0.005, 0.0015))
MIN_CULLED_TRIANGLES = 80_000  # for which it pays to cull triangles one by one
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
        ("room_first", "<u4"),
        ("room", "<u4"),
    ]
)


class ClusterCuller:
    """Culls clusters for the views of cameras, and writes draw commands for the visible ones.

    Args:
        groups_of_batch: (batches,) number of groups per draw call, in order.
        depth: atlas depth for occlusion tests between passes, one layer per camera if there may be
            several; None: a single pass.
        occluders_rad: angles of the passes before the last, one of `OCCLUDERS_RAD`, if depth can
            be read.
        atlas_px: width and height of the atlas.
        depths_m: distances of the near and the far plane.
        both_sides: keep clusters seen from behind, too.
        blended_items: number of blended items with commands of their own in all views.
        triangles: triangles to cull one by one; None: clusters are drawn whole.

    Attributes:
        slices: command ranges of each slice. Each pass rewrites them: the previous pass is drawn
            before its depth is read.
        ranges: number of ranges in all slices.
        commands: buffer with one slice's commands, then, from `first_blended` on, those of blended
            items; base instances index `instances`.
        counts: buffer with the number of commands per range, pass by pass, band by band, then, at
            `blended_count`, that of blended items.
        instances: buffer with one `vertex_format.INSTANCE` per object and view.
    """

    _defines: tuple[str, ...] = ()

    def __init__(
        self,
        context: moderngl.Context,
        buffers: ClusterBuffers,
        groups_of_batch: NDArray[np.integer],
        views: Views,
        depth: moderngl.Texture | moderngl.TextureArray | None,
        occluders_rad: Sequence[float],
        atlas_px: tuple[int, int],
        depths_m: tuple[float, float],
        samples: int = 1,
        both_sides: bool = False,
        blended_items: int = 0,
        triangles: CullableTriangles | None = None,
    ):
        self._context, self._buffers, self.views = context, buffers, views
        self._state = GlState()
        occluders_rad = () if depth is None else occluders_rad
        self.passes, self._depth = 1 + len(occluders_rad), depth
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
            parts = min(self.passes, 3)
            self._lists = gpu_buffer(
                context, _LISTS * _LIST_BYTES + parts * _CANDIDATE_BYTES * words
            )
            cells = sum(4**level for level in range(_CELL_LEVELS)) * math.prod(self._cells)
            hi_z = gpu_buffer(context, 4 * views.cameras * cells if depth else 0)
            self._corners = None if triangles is None else triangles.corners
            if triangles is not None and self._corners is not None:
                pairs = gpu_buffer(context, 2 * 4 * views.count * buffers.cluster_count)
                self._pairs = StorageBindings([pairs, triangles.indices])
                self._defines = ("TRIANGLES",)
        near_m, far_m = depths_m
        slope = 0.0 if math.isinf(far_m) else -near_m / (far_m - near_m)
        settings = np.zeros((self.passes, len(self.slices)), dtype=SETTINGS)
        settings["counts"] = views.cameras, views.tiles, buffers.group_count, views.objects
        settings["atlas_px"], settings["depths_m"] = atlas_px, (near_m, min(far_m, 3e38))
        settings["depth"] = slope, near_m * (1.0 - slope)
        settings["ranges"], settings["both_sides"] = self.ranges, both_sides
        settings["clusters"], settings["blocks"] = buffers.cluster_count, buffers.block_count
        settings["radius_px"] = EDGE_PX if samples <= 1 else 0.5 + EDGE_PX
        if triangles is not None:
            settings["room_first"], settings["room"] = triangles.count, triangles.room
        settings["pass_index"] = np.arange(self.passes)[:, None]
        settings["occluder_rad"].T[:, :-1] = occluders_rad
        settings["first_range"] = [ranges[0].number for ranges in self.slices]
        self._settings = [
            [written_buffer(context, table.tobytes()) for table in row] for row in settings
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

    @property
    def memory_bytes(self) -> int:
        """Size of the buffers for all cameras, bytes."""
        return self._bound.size + (0 if self._corners is None else self._pairs.buffers[0].size)

    def show(self, shown: Bools) -> None:
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
            target: bound target, whose depth is that of all previous passes; None: first pass.
        """
        context, shaders, views = self._context, self._shaders, self.views
        barrier = context.SHADER_STORAGE_BARRIER_BIT
        self.bind(pass_index)
        if pass_index == 0:
            context.memory_barrier(barrier)  # the last frame's draws may still read these buffers
            entries = max(views.count * views.objects, self.blended_count, _LISTS)
            shaders.find("instances").run(math.ceil(entries / _GROUP_SIZE))
            context.memory_barrier(barrier)
            shaders.find("groups", "PASS 0").run(self._blocks, views.count)
            if self._corners is not None:
                self._pairs.bind()  # in place of the poses
                self._state.bind_texture(CORNERS_UNIT, self._corners.glo)
        elif self._depth is not None and target is not None:
            columns, rows = self._cells
            layered = ("LAYERED",) if isinstance(self._depth, moderngl.TextureArray) else ()
            fine, coarse = shaders.find("hi_z", *layered), shaders.find("hi_z", "COARSE", *layered)
            with self._state.sampling(DEPTH_UNIT, self._depth, target):
                fine.run(columns, rows, views.cameras)  # 8 × 8 cells of level 1 per last-level cell
            context.memory_barrier(barrier)
            coarse.run(math.ceil(columns / 8), math.ceil(rows / 8), views.cameras)
            context.memory_barrier(barrier | context.COMMAND_BARRIER_BIT)
            shaders.find("groups", "PASS 2").run_indirect(self._lists, pass_index * _LIST_BYTES)
        context.memory_barrier(barrier | context.COMMAND_BARRIER_BIT)
        # the only pass is 0, else 1 is the first one, and 2 any later one
        defines = f"PASS {0 if self.passes == 1 else 1 + min(pass_index, 1)}", *self._defines
        cull = shaders.find("cull", *defines)
        cull.run_indirect(self._lists, (_TESTED + pass_index) * _LIST_BYTES)
        if self._corners is not None:
            context.memory_barrier(barrier | context.COMMAND_BARRIER_BIT)
            place = (_PAIRS + pass_index) * _LIST_BYTES
            shaders.find("triangles", *defines).run_indirect(self._lists, place)
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
        self._shaders.find("commands", *self._defines).run(
            len(self.slices[slice_index]), self.views.cameras
        )
        context.memory_barrier(
            context.SHADER_STORAGE_BARRIER_BIT
            | context.COMMAND_BARRIER_BIT
            | context.VERTEX_ATTRIB_ARRAY_BARRIER_BIT
            | context.ELEMENT_ARRAY_BARRIER_BIT
        )


# GPU buffers of clusters and their groups, laid out as in shaders/culling/views.glsl.


# Texture of bounds: entries of four words, see shaders/culling/bounds.glsl.
_GROUP = np.dtype(
    [
        ("aabb_min", "<f4", 3),
        ("first_cluster", "<u4"),
        ("aabb_max", "<f4", 3),
        ("object", "<u4"),
        ("width", "<f4"),
        ("unused", "<u4", 3),
    ]
)
_CLUSTER = np.dtype(
    [
        ("aabb_min", "<f4", 3),
        ("width", "<f4"),
        ("aabb_max", "<f4", 3),
        ("object", "<u4"),
        ("cone_axis", "<f4", 3),
        ("cone_sine", "<f4"),
    ]
)
_BLOCK = np.dtype(
    [("aabb_min", "<f4", 3), ("first_group", "<u4"), ("aabb_max", "<f4", 3), ("groups", "<u4")]
)
_BOTH_SIDES = np.float32(3.0)  # "sine" of the cones of double-sided clusters
_MAX_GROUPS = 8  # per block: software drivers test eight blocks at once
_ENTRY, _ROW = np.dtype("<u4, <u4, <u4, <u4"), 1 << 12  # entries per row
# Texture units that no drawing program uses: its own textures stay bound during culling.
DEPTH_UNIT, BOUNDS_UNIT, CORNERS_UNIT = 16, 17, 20


class CullingShaders:
    """Compute shaders of culling, each compiled when it is first needed."""

    def __init__(self, context: moderngl.Context):
        self._context = context
        self._compiled: dict[tuple[str, ...], moderngl.ComputeShader] = {}

    def find(self, name: str, *defines: str) -> moderngl.ComputeShader:
        """Shader of a file in shaders/culling, with names to #define."""
        key = name, *defines
        if key not in self._compiled:
            shader = build_compute_shader(self._context, f"culling/{name}.comp", defines)
            units = {
                "u_bounds": BOUNDS_UNIT, "u_atlas_depth": DEPTH_UNIT, "u_corners": CORNERS_UNIT
            }  # fmt: skip
            set_uniforms(shader, units)
            self._compiled[key] = shader
        return self._compiled[key]


class ClusterBuffers:
    """Cluster buffers that all cameras share.

    Args:
        double_sided: (clusters,) draw back faces, too.
        objects: (groups,) index of each group's object.
        buckets: (groups,) bucket of each group, ascending.

    Attributes:
        index_ranges: buffer with the first index of each cluster and its number of indices.
        bounds: texture of the groups' bounds, then the clusters', then the blocks'.
        clusters_of_group: (groups,) number of clusters per group.
        groups_of_bucket: (buckets,) number of groups per bucket.
        cluster_count, group_count, block_count: total numbers.
        shaders: shaders of all cullers.
    """

    def __init__(
        self,
        context: moderngl.Context,
        hierarchy: ClusterHierarchy,
        double_sided: Bools,
        objects: Indices,
        buckets: Indices,
    ):
        clusters, groups = hierarchy.clusters, hierarchy.groups
        self.cluster_count, self.group_count = len(clusters.first), len(groups.first)
        self._first = groups.first
        group = np.repeat(np.arange(self.group_count), groups.children)
        self._bits = np.uint32(1) << (np.arange(self.cluster_count) - groups.first[group]).astype(
            np.uint32
        )
        index_ranges = np.stack((3 * clusters.first, 3 * clusters.triangles), axis=1)
        self.index_ranges = gpu_buffer(context, index_ranges.astype("<u4"))
        of_groups = np.zeros(self.group_count, dtype=_GROUP)
        of_groups["first_cluster"], of_groups["object"] = groups.first, objects
        of_clusters = np.zeros(self.cluster_count, dtype=_CLUSTER)
        for name in ("aabb_min", "aabb_max"):
            of_groups[name], of_clusters[name] = getattr(groups, name), getattr(clusters, name)
        of_clusters["width"], of_clusters["cone_axis"] = clusters.widths, clusters.cone_axes
        of_clusters["cone_sine"] = np.where(double_sided, _BOTH_SIDES, clusters.cone_sines)
        of_clusters["object"] = objects[group]
        of_groups["width"] = np.maximum.reduceat(clusters.widths, groups.first)
        of_blocks = _blocks(of_groups, buckets)
        self.block_count = len(of_blocks)
        entries = [table.view(_ENTRY) for table in (of_groups, of_clusters, of_blocks)]
        rows = -(-sum(map(len, entries)) // _ROW)
        table = np.resize(np.concatenate(entries), rows * _ROW)  # what fills the last row is unused
        self.bounds = texture_2d(context, (_ROW, rows), 4, table, dtype="u4")
        self.clusters_of_group, self.groups_of_bucket = groups.children, np.bincount(buckets)
        self.all_shown = self.masks_of_groups(np.ones(self.cluster_count, dtype=np.bool_))
        self.shaders = CullingShaders(context)

    def masks_of_groups(self, clusters: Bools) -> Uints32:
        """Bit mask per group (groups,) of the selected clusters (clusters,)."""
        bits = np.where(clusters, self._bits, np.uint32(0))
        return np.bitwise_or.reduceat(bits, self._first).astype("<u4")


def _blocks(groups: NDArray[np.void], buckets: Indices) -> NDArray[np.void]:
    """Blocks of consecutive groups of one object and bucket, which mostly are neighbors."""
    numbers = np.arange(len(groups))
    keys = np.stack((groups["object"], buckets))
    starts_run = np.append(True, (keys[:, 1:] != keys[:, :-1]).any(axis=0))
    start_of_run = np.maximum.accumulate(np.where(starts_run, numbers, 0))
    first = np.flatnonzero((numbers - start_of_run) % _MAX_GROUPS == 0)
    blocks = np.zeros(len(first), dtype=_BLOCK)
    blocks["first_group"], blocks["groups"] = first, np.diff(first, append=len(groups))
    blocks["aabb_min"] = np.minimum.reduceat(groups["aabb_min"], first)
    blocks["aabb_max"] = np.maximum.reduceat(groups["aabb_max"], first)
    return blocks


# Partition of the clusters into slices whose draw commands fit into one buffer.
BANDS = 2  # distance bands, in shaders/culling/views.glsl
RANGE = np.dtype(  # as in shaders/culling/commands.comp
    [("first_group", "<u4"), ("groups", "<u4"), ("first_command", "<u4"), ("max_count", "<u4")]
)


class CommandRange(NamedTuple):
    """Draw commands of one batch in a slice, near band and far band."""

    number: int  # index over all slices
    batch: int  # batch of buckets that one draw call draws
    # offset of the near band in the command buffer; the far band begins `max_count` later
    first: int
    max_count: int  # maximum number of commands per band


class CommandSlices(NamedTuple):
    """Slices that use the same command buffer in turn."""

    slices: tuple[tuple[CommandRange, ...], ...]  # ranges of each slice, batch by batch
    table: NDArray[np.void]  # (ranges,) rows of type `RANGE`
    max_commands: int  # maximum number per slice


def command_slices(
    clusters_of_group: NDArray[np.integer],
    groups_of_batch: NDArray[np.integer],
    views: int,
    max_commands: int,
) -> CommandSlices:
    """Split the groups into as few slices as possible; each group stays whole.

    Args:
        clusters_of_group: (groups,) number of clusters, batch by batch.
        groups_of_batch: (batches,) number of groups.
        views: number of views; each may show every cluster, in either band.
        max_commands: maximum number per slice; a single group may exceed it.
    """
    clusters = np.append(0, np.cumsum(clusters_of_group))
    of_batch = np.append(0, np.cumsum(groups_of_batch))
    max_clusters = max_commands // (BANDS * views)
    slices, rows, most_used = [], list[tuple[int, int, int, int]](), 0
    start = 0
    while start < len(clusters) - 1:
        end = int(np.searchsorted(clusters, clusters[start] + max_clusters, side="right")) - 1
        end, used, of_slice = max(end, start + 1), 0, list[CommandRange]()
        while start < end:
            batch = int(np.searchsorted(of_batch, start, side="right")) - 1
            last = min(end, int(of_batch[batch + 1]))
            max_count = views * int(clusters[last] - clusters[start])
            of_slice.append(CommandRange(len(rows), batch, used, max_count))
            rows.append((start, last - start, used, max_count))
            used += BANDS * max_count
            start = last
        slices.append(tuple(of_slice))
        most_used = max(most_used, used)
    return CommandSlices(tuple(slices), np.array(rows, dtype=RANGE), most_used)


# Views of cameras for culling: one per atlas tile, with the objects in their frames.
#
# Per frame the CPU writes the poses of cameras and objects; the GPU computes a matrix per object
# and view. A view is one tile of one camera, numbered camera by camera. Object 0 is the static
# geometry, relative to its anchor; the dynamic objects follow.


class Views:
    """Poses on the GPU: cameras that share a tile plan, and the objects.

    Args:
        clips_from_rig: (tiles, 4, 4) per tile of a camera, see `tile_plan.clips_from_rig`.
        rectangles_px: (tiles, 4) left, top, width and height of each tile in the atlas.
        anchor_m: (3,) origin of the static geometry, world.
        objects: number of objects, static geometry included.
        cameras: maximum number of cameras.

    Attributes:
        cameras: number of cameras in the current poses.
        tiles, objects: number of tiles per camera, and of objects.
        poses: buffer, float32 (cameras, 1 + objects, 3, 4): rows of rig_from_viewpoint, then of
            viewpoint_from_object per object.
        clips_from_rig: buffer, (tiles, 4, 4), column-major.
        rectangles_px: buffer, (views, 4): left, top, width and height in the atlas.
    """

    def __init__(
        self,
        context: moderngl.Context,
        clips_from_rig: Floats,
        rectangles_px: Floats,
        anchor_m: Floats,
        objects: int,
        cameras: int = 1,
    ):
        self.cameras, self.tiles, self.objects = cameras, len(clips_from_rig), objects
        self._anchor_m = anchor_m
        self._poses = np.zeros((self.cameras, 1 + objects, 3, 4), dtype=np.float32)
        self._poses[:, 1, :, :3] = np.eye(3)
        self.poses = written_buffer(context, self._poses)
        self.clips_from_rig = written_buffer(context, columns_first(clips_from_rig))
        rectangles = np.tile(rectangles_px, (cameras, 1)).astype(np.float32)
        self.rectangles_px = written_buffer(context, rectangles)

    def use_tiles(self, clips_from_rig: Floats, rectangles_px: Floats) -> None:
        """Replace the tiles of a single camera by others, at most as many as at first."""
        self.tiles = len(clips_from_rig)
        self.clips_from_rig.write(columns_first(clips_from_rig))
        self.rectangles_px.write(rectangles_px.astype(np.float32))

    @property
    def count(self) -> int:
        """Number of views."""
        return self.cameras * self.tiles

    def write(self, shots: Sequence[ScenePoses]) -> None:
        """Write the poses of one frame, a camera per shot."""
        rigs = np.array([shot.world_from_rig for shot in shots])
        self.cameras = len(rigs)
        poses = self._poses[: self.cameras]
        viewpoints_m = rigs[:, :3, 3]
        poses[:, 0, :, :3] = rigs[:, :3, :3].transpose(0, 2, 1)
        # in float64, which keeps precision far from the origin
        poses[:, 1, :, 3] = self._anchor_m - viewpoints_m
        if self.objects > 1:
            objects = np.array([shot.world_from_objects for shot in shots])[..., :3, :]
            poses[:, 2:, :, :3] = objects[..., :3]
            poses[:, 2:, :, 3] = objects[..., 3] - viewpoints_m[:, None]
        self.poses.write(poses)
