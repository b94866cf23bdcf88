"""Bounds of groups and blocks, as culling reads them."""

import numpy as np

from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.scene.model import AlphaMode, Material
from tests.rendering.opengl.sheets import sheet
from tests.scenes import scene_of

MATERIALS = [Material(), Material(alpha_mode=AlphaMode.MASK)]


def test_blocks_bound_consecutive_groups_of_one_object_and_bucket(context):
    large = [sheet(f"sheet {number}", number, side=80, size_m=9.0) for number in range(2)]
    moving = [scene_of([sheet("moving", 0, seed=seed)], MATERIALS) for seed in range(3)]
    geometry = SceneBuffers(context, scene_of(large, MATERIALS), moving).clustered_geometry
    buffers = geometry.buffers
    entries = np.frombuffer(buffers.bounds.read(), dtype="<u4").reshape(-1, 4)
    start = 3 * (buffers.group_count + buffers.cluster_count)
    groups = entries[: 3 * buffers.group_count].reshape(-1, 12)
    blocks = entries[start : start + 2 * buffers.block_count].reshape(-1, 8)
    first, count = blocks[:, 3], blocks[:, 7]
    np.testing.assert_array_equal(first, np.cumsum(count) - count)
    assert count.sum() == buffers.group_count
    assert 1 < count.max() <= 8
    buckets = np.repeat(np.arange(len(geometry.buckets)), buffers.groups_of_bucket)
    assert len(np.unique(buckets)) > 1
    assert len(np.unique(groups[:, 7])) == 4
    widths = np.maximum.reduceat(geometry.clusters.widths, groups[:, 3].astype(np.intp))
    np.testing.assert_array_equal(groups[:, 8].view("<f4"), widths)
    for block in blocks:
        own = slice(block[3], block[3] + block[7])
        assert len(np.unique(groups[own, 7])) == len(np.unique(buckets[own])) == 1
        low, high = groups[own, :3].view("<f4"), groups[own, 4:7].view("<f4")
        np.testing.assert_array_equal(block[:3].view("<f4"), low.min(axis=0))
        np.testing.assert_array_equal(block[4:7].view("<f4"), high.max(axis=0))
