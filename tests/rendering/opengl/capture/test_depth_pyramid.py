"""Bounds of the inverse depth, bit for bit as NumPy finds them."""

import math

import numpy as np
import pytest

from omnisim.rendering.atlas.tile_plan import TilePlan
from omnisim.rendering.opengl.capture.parallax_pass import DepthPyramid
from tests.rendering.opengl.depths import drawn_depth

BLOCK, BLOCKS_PER_GROUP = 8, 8
NEAR_M, LONGEST_M = 0.05, 0.17


def _largest(values, side):
    """Maximum of each square of `side` × `side` values, smaller at the far edges."""
    rows = np.maximum.reduceat(values, range(0, values.shape[0], side), axis=0)
    return np.maximum.reduceat(rows, range(0, values.shape[1], side), axis=1)


def _dilated(blocks):
    """Maximum over each value and its eight neighbors."""
    height, width = blocks.shape
    padded = np.pad(blocks, 1, mode="edge")
    parts = [padded[y : y + height, x : x + width] for y in range(3) for x in range(3)]
    return np.max(parts, axis=0)


def _expected(depth, far_m):
    """Bounds (rows, columns, 2) of blocks and of their groups, and the largest nearness."""
    share = NEAR_M / (far_m - NEAR_M)
    scale = 1.0 / (NEAR_M * (1.0 + share))
    blocks = _largest(depth, BLOCK)
    inverse_z = np.float32(scale) * blocks + np.float32(share * scale)
    inverse_z[blocks == 0.0] = 0.0
    groups = _dilated(_largest(inverse_z, BLOCKS_PER_GROUP))
    height, width = inverse_z.shape
    of_group = groups.repeat(BLOCKS_PER_GROUP, axis=0).repeat(BLOCKS_PER_GROUP, axis=1)
    nearest = float(inverse_z.max())
    if nearest > 0.0:
        nearest = 1.0 / max(1.0 / nearest - LONGEST_M, NEAR_M)
    bounds = np.stack((_dilated(inverse_z), of_group[:height, :width]), axis=-1)
    return bounds, np.float32(nearest)


@pytest.mark.parametrize("far_m", [math.inf, 20.0])
@pytest.mark.parametrize("shape", [(64, 128), (61, 83), (130, 7), (3, 3), (200, 300)])
def test_bounds_are_those_of_numpy(context, shape, far_m):
    plan = TilePlan((), 0, 0.0, shape[1], shape[0])
    pyramid = DepthPyramid(context, plan, NEAR_M, far_m, LONGEST_M)
    generator = np.random.default_rng(shape)
    far_away = np.zeros(shape, dtype=np.float32)
    far_away[-1, -1] = 0.01
    surfaces = generator.uniform(0.0, 0.6, shape).astype(np.float32) ** 4
    surfaces[generator.random(shape) < 0.5] = 0.0
    # the nearest surfaces of an image do not count in the next one
    for depth in (surfaces, far_away, np.zeros_like(surfaces)):
        pyramid.update(drawn_depth(context, depth))
        bounds, nearest = _expected(depth, far_m)
        values = np.frombuffer(pyramid._bounds.read(), dtype="<f4")
        values = values.reshape(bounds.shape[0] + 1, -1, 2)
        np.testing.assert_array_equal(values[:-1], bounds)
        assert values[-1, 0, 0] == nearest
