"""Corners of triangles in steps within the boxes of their clusters."""

import numpy as np

from omnisim.rendering.opengl.culling.clusters import build_clusters
from omnisim.rendering.opengl.culling.triangle_culling import STEPS, packed_corners


def test_corners_are_within_half_a_step():
    generator = np.random.default_rng(5)
    corners = generator.uniform(-3.0, 3.0, (500, 1, 3)) + generator.uniform(-0.2, 0.2, (500, 3, 3))
    corners[:100, :, 2] = 0.25  # clusters without height
    corners = corners.astype(np.float32)
    keys = np.repeat([0, 1], [100, 400])
    hierarchy = build_clusters(corners, keys, keys)
    words = packed_corners(corners, hierarchy).astype(np.int64)
    first = words[:, :3]
    low = np.stack([words[:, 3] >> shift & 1023 for shift in (0, 10, 20)], axis=-1)
    steps = np.stack((first & 16383, first >> 14 & 16383, first >> 28 << 10 | low), axis=-1)
    clusters = hierarchy.clusters
    cluster = np.repeat(np.arange(len(clusters.first)), clusters.triangles)
    extent = (clusters.aabb_max - clusters.aabb_min)[cluster, None]
    found = clusters.aabb_min[cluster, None] + steps * extent / STEPS
    off = np.abs(found - corners[hierarchy.order])
    assert np.all(off <= 0.5 * extent / STEPS + 1e-6)
    assert steps.min() == 0
    assert steps.max() == STEPS
