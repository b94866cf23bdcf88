"""Draw commands of the last frame, and cullers that leave everything, or nothing to occlusion."""

from types import SimpleNamespace

import numpy as np

from omnisim.rendering.opengl.culling.cluster_culling import BANDS
from omnisim.rendering.opengl.gl.buffers import gpu_buffer, read_buffer


def submitted_commands(culler, pass_index=0):
    """Commands (n, 5) of a pass of a culler, whose context is current, as they are drawn."""
    (ranges,) = culler.slices
    counts = np.frombuffer(read_buffer(culler.counts), "<u4")[: culler.blended_count]
    counts = counts.reshape(-1, BANDS, len(ranges))
    commands = np.frombuffer(read_buffer(culler.commands), "<u4").reshape(-1, 5)
    return np.concatenate(
        [
            commands[one.first + band * one.max_count :][:count]
            for band in range(BANDS)
            for one, count in zip(ranges, counts[pass_index, band], strict=True)
        ]
    )


def count_triangles(culler):
    """Count the triangles that a culler submits, pass by pass, into a list that is returned."""
    submitted, run = [], culler.run

    def counted(pass_index, target=None):
        run(pass_index, target)
        submitted.append(int(submitted_commands(culler, pass_index)[:, 0].sum()) // 3)

    culler.run = counted
    return submitted


def _fill(buffer, content):
    buffer.ctx.copy_buffer(buffer, gpu_buffer(buffer.ctx, content))


class _ShowAll:
    """Shader that culls, and then shows all clusters in all of up to 32 tiles."""

    def __init__(self, shader, culler):
        self._shader, bound = shader, culler._bound.buffers
        self._visible, self._of_group = bound[6], bound[13]
        self._shown = culler._buffers.all_shown
        self._tiles = np.uint32((1 << culler.views.tiles) - 1)

    def run_indirect(self, *place):
        self._shader.run_indirect(*place)
        _fill(self._visible, np.full(self._visible.size // 4, self._tiles))
        _fill(self._of_group, self._shown)


class _NoDepth:
    """A shader that leaves infinite depth."""

    def run(self, *groups):
        pass


def _replace(culler, name, make):
    """Let a culler use what `make` makes of its shaders of a file."""
    find = culler._shaders.find

    def found(other, *defines):
        shader = find(other, *defines)
        return make(shader) if other == name else shader

    culler._shaders = SimpleNamespace(find=found)


def show_all(culler):
    """Let a culler leave everything."""
    _replace(culler, "cull", lambda shader: _ShowAll(shader, culler))


def show_occluded(culler):
    """Let a culler draw in two passes, but leave what is occluded."""
    with culler._context:
        depth = culler._bound.buffers[11]
        _fill(depth, bytes(depth.size))
    _replace(culler, "hi_z", lambda shader: _NoDepth())
