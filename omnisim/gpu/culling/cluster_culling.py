"""Culling of clusters on the GPU, for all views at once: frusta, normal cones, size, occlusion.

The outcome is a list of draw commands for each bucket of the geometry, near clusters first, and
how many there are. Nothing of it comes back to the CPU.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.culling.cluster_buffers import ClusterBuffers
from omnisim.gpu.culling.views import Views
from omnisim.gpu.gl_functions import COMMAND_BYTES, bind_storage_buffers
from omnisim.gpu.memory import gpu_allocation

# Where an edge lies, a GPU rounds to a sixteenth of a texel at worst.
EDGE_PX = 0.125
COMMANDS_BINDING = 7
_INSTANCE_BYTES = 128
_GROUP_SIZE = 64  # local_size_x of the shaders
_SETTINGS = np.dtype(  # as in shaders/culling/views.glsl
    [
        ("counts", "<u4", 4),
        ("atlas_px", "<f4", 2),
        ("depths_m", "<f4", 2),
        ("buckets", "<u4"),
        ("both_sides", "<u4"),
        ("radius_px", "<f4"),
        ("unused", "<u4"),
    ]
)


class CommandRange(NamedTuple):
    """Draw commands of one bucket.

    Attributes:
        first: in the buffer of commands.
        most: as many as there can be.
    """

    first: int
    most: int


class ClusterCuller:
    """Culls clusters for the views of cameras, and makes draw commands of those that are left.

    Args:
        context: where.
        buffers: the clusters.
        views: of all cameras.
        atlas_px: size of the atlas.
        depths_m: of the near and the far plane.
        samples: of a texel.
        both_sides: all clusters are seen from behind, too.

    Attributes:
        ranges: of each bucket's commands.
        commands: buffer of them; base instances are entries of `instances`.
        counts: buffer of the number of commands of each bucket.
        instances: buffer of an object in a view each: `vertex_format.INSTANCE`.
    """

    def __init__(
        self,
        context: moderngl.Context,
        buffers: ClusterBuffers,
        views: Views,
        atlas_px: tuple[int, int],
        depths_m: tuple[float, float],
        samples: int = 1,
        both_sides: bool = False,
    ):
        self._context, self._buffers, self._views = context, buffers, views
        most = [views.count * clusters for clusters in buffers.clusters_of_bucket]
        first = np.cumsum([0, *most]).tolist()
        self.ranges = [CommandRange(*pair) for pair in zip(first, most, strict=False)]
        groups = buffers.group_count
        with gpu_allocation(
            f"draw commands of {views.count} views of {buffers.cluster_count} clusters",
            "make the scene smaller, or the cameras fewer",
        ):
            self.commands = context.buffer(reserve=COMMAND_BYTES * first[-1])
            self.counts = context.buffer(reserve=4 * len(most))
            self.instances = context.buffer(reserve=_INSTANCE_BYTES * views.count * views.objects)
            masks = context.buffer(reserve=4 * groups * views.count)
        buckets = np.zeros((len(most), 4), dtype=np.uint32)
        buckets[:, 1] = buffers.clusters_of_bucket
        buckets[:, 0] = np.cumsum(buckets[:, 1]) - buckets[:, 1]
        buckets[:, 2] = first[:-1]
        settings = np.zeros((), dtype=_SETTINGS)
        settings["counts"] = views.cameras, views.tiles, groups, views.objects
        settings["atlas_px"], settings["depths_m"] = atlas_px, (depths_m[0], min(depths_m[1], 3e38))
        settings["buckets"], settings["both_sides"] = len(most), both_sides
        settings["radius_px"] = EDGE_PX if samples <= 1 else 0.5 + EDGE_PX
        self._settings = context.buffer(settings.tobytes())
        self._shown = context.buffer(buffers.all_shown)
        self._bound = [
            views.poses, views.clips_from_rig, views.rectangles_px, self.instances,
            buffers.groups, buffers.clusters, masks, self.commands, self.counts,
            context.buffer(buckets), self._shown,
        ]  # fmt: skip
        self._groups = math.ceil(groups / _GROUP_SIZE)
        self._instance_groups = math.ceil(
            max(views.count * views.objects, len(most)) / _GROUP_SIZE
        )
        self._shaders = buffers.shaders

    def show(self, shown: NDArray[np.bool_]) -> None:
        """Show some clusters (clusters,), and no others."""
        self._shown.write(self._buffers.masks_of_groups(shown))

    def run(self) -> None:
        """Make the commands of a frame, by the poses that were written."""
        context, shaders = self._context, self._shaders
        barrier = context.SHADER_STORAGE_BARRIER_BIT
        self._settings.bind_to_uniform_block(0)
        bind_storage_buffers([one.glo for one in self._bound])
        shaders.instances.run(self._instance_groups)
        context.memory_barrier(barrier)
        shaders.cull.run(self._groups, self._views.count)
        context.memory_barrier(barrier)
        shaders.commands.run(len(self.ranges), self._views.cameras)
        context.memory_barrier(
            barrier | context.COMMAND_BARRIER_BIT | context.VERTEX_ATTRIB_ARRAY_BARRIER_BIT
        )
