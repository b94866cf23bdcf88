"""Occlusion tests, beside brute force over every texel."""

import numpy as np
import pytest
from omnisim.gpu.culling.frustum_culling import ScreenBounds
from omnisim.gpu.culling.hi_z import MAX_SIDE, MIN_CELL_PX, HiZ


def _depth(generator, height, width):
    """Smooth hills of depth, with a few holes to infinity and near posts."""
    y, x = np.mgrid[:height, :width] / 16.0
    depth = 0.3 + 0.1 * np.sin(x + generator.uniform(0.0, 6.0)) * np.cos(y)
    depth[generator.random(depth.shape) < 1e-3] = 0.0
    depth[generator.random(depth.shape) < 1e-2] = 0.9
    return depth.astype(np.float32)


def _boxes(generator, height, width, count):
    size = np.array([width, height])
    first = generator.integers(0, size, (count, 2))
    # from a texel to the whole picture, small ones mostly
    reach = (size * generator.random((count, 2)) ** 4).astype(int)
    last = np.minimum(first + reach, size - 1)
    return _bounds(first, last, generator.uniform(0.0, 0.5, count))


def _bounds(first, last, nearest):
    """Bounds of corners (n, 2)."""
    first, last = np.asarray(first, dtype=np.int32).T, np.asarray(last, dtype=np.int32).T
    return ScreenBounds(first, last, np.asarray(nearest, dtype=np.float32))


def _hi_z(depth):
    hi_z = HiZ(*depth.shape[::-1])
    # what was there before counts for nothing
    hi_z.update(np.ones_like(depth))
    hi_z.update(depth)
    return hi_z


@pytest.mark.parametrize(
    "shape", [(64, 96), (61, 83), (130, 7), (5, 200), (3, 3), (1, 1), (600, 700)]
)
def test_nothing_is_hidden_where_a_texel_is_farther(shape):
    generator = np.random.default_rng(shape)
    occluded_of, truth_of = [], []
    for _ in range(3):
        depth = _depth(generator, *shape)
        boxes = _boxes(generator, *shape, 400)
        occluded_of.append(_hi_z(depth).occludes(boxes))
        truth_of.append(
            [
                depth[top : bottom + 1, left : right + 1].min() > nearest
                for left, top, right, bottom, nearest in zip(
                    *boxes.first, *boxes.last, boxes.nearest, strict=True
                )
            ]
        )
    hidden, truth = np.concatenate(occluded_of), np.concatenate(truth_of)
    assert not np.any(hidden & ~truth)
    if min(shape) >= 60:
        # large cells reach past a box's edges, and holes are everywhere
        assert hidden.sum() > 0.5 * truth.sum()


def test_boxes_in_front_or_at_the_near_plane_are_not_occluded():
    hi_z = _hi_z(np.full((40, 40), 0.25, dtype=np.float32))
    first, last = np.tile([[4, 4]], (4, 1)), np.tile([[20, 30]], (4, 1))
    boxes = _bounds(first, last, [0.2, 0.25, 0.3, np.inf])
    assert hi_z.occludes(boxes).tolist() == [True, False, False, False]


def test_only_very_large_boxes_count_as_visible():
    """Boxes of any shape less than twice as large as the largest rectangle."""
    most = (2 * MAX_SIDE - 1) * MIN_CELL_PX
    sizes = np.array([(1, 1), (most, 1), (3, most), (most, most), (17, 5), (most + 1, 1)])
    hi_z = _hi_z(np.full((150, 4 * MAX_SIDE * MIN_CELL_PX), 0.25, dtype=np.float32))
    assert hi_z._cell_px == MIN_CELL_PX
    sizes = np.minimum(sizes, (9999, 150))
    boxes = _bounds(np.zeros(sizes.shape), sizes - 1, np.full(len(sizes), 0.2))
    assert hi_z.occludes(boxes).tolist() == [True] * 5 + [False]


def test_cells_of_a_large_atlas_are_not_many():
    small, large = HiZ(960, 350), HiZ(7680, 2800)
    assert large._farthest.nbytes < 2 * small._farthest.nbytes
