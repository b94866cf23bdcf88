"""Polygons of masks: pycocotools draws the masks again."""

import numpy as np
import pytest

from omnisim.ground_truth.boxes import mask_from_runs, polygons_of_mask

pytestmark = pytest.mark.filterwarnings("ignore:__array__:DeprecationWarning")  # of its masks


def _drawn(polygons, height, width):
    mask = pytest.importorskip("pycocotools.mask", reason="pycocotools is not installed")
    return mask.decode(mask.merge(mask.frPyObjects(polygons, height, width))).astype(bool)


MASKS = {
    "pixel": ["....", ".#..", "...."],
    "corners that touch": ["#..", ".#.", "#.."],
    "hole": ["#####", "#...#", "#.#.#", "#...#", "#####"],
    "two holes": ["#######", "#.##..#", "###.###", "#######"],
    "hole at a corner": ["####", "#.##", "##.#", "####"],
    "whole": ["##", "##"],
}
NOISE = np.random.default_rng(3).random((40, 50))


@pytest.mark.parametrize(
    "mask",
    [*(np.array([[*row] for row in rows]) == "#" for rows in MASKS.values()),
     *(share > NOISE for share in (0.3, 0.6, 0.9))],
)  # fmt: skip
def test_polygons_are_the_mask(mask):
    np.testing.assert_array_equal(_drawn(polygons_of_mask(mask), *mask.shape), mask)


def test_corners_are_those_of_pixels():
    mask = np.zeros((4, 5), dtype=bool)
    mask[1:3, 2:5] = True
    assert polygons_of_mask(mask) == [[2.0, 1.0, 5.0, 1.0, 5.0, 3.0, 2.0, 3.0]]


def test_runs_are_columns():
    np.testing.assert_array_equal(
        mask_from_runs(2, 3, [1, 2, 3]), [[False, True, False], [True, False, False]]
    )
