"""Triangles that cover valid pixels, against the mask."""

import numpy as np
import pytest

from omnisim.rendering.opengl.capture.mesh_and_lens import STRIP_PX, covering_triangles


def _covered(triangles, shape):
    """Count of the triangles (n, 3, 2) that each pixel's center is in; none may lie on an edge."""
    x, y = np.meshgrid(np.arange(shape[1]) + 0.5003, np.arange(shape[0]) + 0.5001)
    count = np.zeros(shape, dtype=int)
    for corners in triangles:
        sides = []
        for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            sides.append((bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0.0)
        count += np.all(sides, axis=0) | ~np.any(sides, axis=0)
    return count


def _disc(height, width, radius):
    y, x = np.mgrid[:height, :width]
    return (x - width / 2) ** 2 + (y - height / 2) ** 2 < radius**2


NOISE = np.random.default_rng(2).random((37, 53)) < 0.004
MASKS = {
    "disc": _disc(60, 80, 25.0),
    "disc past the image": _disc(61, 43, 35.0),
    "everything": np.ones((19, 23), dtype=bool),
    "one corner": np.pad(np.ones((1, 1), dtype=bool), ((20, 0), (30, 0))),
    "noise": NOISE,
}


@pytest.mark.parametrize("valid", MASKS.values(), ids=MASKS.keys())
def test_every_valid_pixel_is_covered_once(valid):
    corners = covering_triangles(valid)
    assert corners.min() >= 0.0
    assert np.all(corners.max(axis=0) <= valid.shape[::-1])
    count = _covered(corners.reshape(-1, 3, 2), valid.shape)
    assert np.all(count[valid] == 1)
    assert count.max() == 1  # nothing is drawn twice
    # rows without anything are not covered, if there are enough of them
    for top in range(0, len(valid), STRIP_PX):
        if not valid[top : top + STRIP_PX].any():
            assert not count[top : top + STRIP_PX].any()


def test_a_disc_is_covered_closely():
    """A strip is as wide as the disc is in the widest of them."""
    valid = _disc(400, 500, 190.0)
    count = _covered(covering_triangles(valid).reshape(-1, 3, 2), valid.shape)
    # each of four quarters is a staircase with treads of a strip: half a strip at each side of it
    assert count.sum() <= valid.sum() + 4 * 190 * STRIP_PX


def test_nothing_valid_takes_nothing():
    assert covering_triangles(np.zeros((30, 20), dtype=bool)).shape == (0, 2)
