"""The grid of probes is all over a scene, or around the cameras' places in a large one."""

import dataclasses

import numpy as np
import pytest

from omnisim.rendering.baking.bake import PROBE_BUDGET, probe_grid
from omnisim.scene.model import StartPose
from tests.scenes import scene_of, square


def _ends_m(grid):
    reach = 0.5 * grid.spacing_m
    last = grid.origin_m + (np.array(grid.shape) - 1) * grid.spacing_m
    return grid.origin_m - reach, last + reach


@pytest.mark.parametrize("half_m", [4.0, 30.0])
def test_grid_is_in_the_bounds_of_a_flat_scene(half_m):
    grid = probe_grid(scene_of([square(half_m)]))
    assert grid.size <= PROBE_BUDGET
    low, high = scene_of([square(half_m)]).bounds_m()
    np.testing.assert_allclose(_ends_m(grid)[0], low, atol=1e-6)
    np.testing.assert_allclose(_ends_m(grid)[1], np.maximum(high, low + 1e-3), atol=1e-6)


@pytest.mark.parametrize("half_m", [400.0, 1e8])  # 1e8: the numbers of probes exceed int64
def test_grid_of_a_large_scene_is_around_the_start(half_m):
    scene = scene_of([square(half_m), square(half_m, z_m=half_m)])
    scene = dataclasses.replace(scene, start=StartPose((30.0, 10.0, 1.0), 0.0))
    grid = probe_grid(scene)
    low, high = _ends_m(grid)
    np.testing.assert_allclose(low, (22.0, 2.0, 0.0), atol=1e-6)
    np.testing.assert_allclose(high, (38.0, 18.0, 5.0), atol=1e-6)
    assert grid.spacing_m.max() < 0.6
