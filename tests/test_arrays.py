"""Small parts of the core: bilinear interpolation, bounds, and coordinate frames."""

import numpy as np
import pytest

from omnisim.core.arrays import bounds_of, triangle_bounds
from omnisim.core.bilinear import corner_and_weights, sample
from omnisim.core.coordinate_frames import MIRROR_FROM_OPTICAL, RIG_FROM_OPTICAL_LOOKING_UP
from omnisim.core.cube import FACE_FROM_RIG, FACE_NAMES, face_index, face_tangents

POINTS = np.random.default_rng(0).normal(size=(60, 3))


def test_a_plane_is_interpolated_exactly():
    u, v = np.meshgrid(np.arange(7.0), np.arange(5.0))
    positions = np.random.default_rng(0).uniform((0.0, 0.0), (6.0, 4.0), (50, 2))
    expected = 2.0 * positions[:, 0] - 3.0 * positions[:, 1]
    # weights are float32
    np.testing.assert_allclose(sample(2.0 * u - 3.0 * v, positions), expected, atol=1e-5)


def test_the_border_of_an_image_is_clamped_and_masked():
    image = np.arange(6.0).reshape(2, 3)
    positions = np.array([[-1.0, 0.0], [2.0, 1.0], [2.5, 1.0]])
    np.testing.assert_array_equal(sample(image, positions), [0.0, 5.0, 5.0])
    _, weights, inside = corner_and_weights(positions, image.shape)
    np.testing.assert_array_equal(inside, [False, True, False])
    np.testing.assert_allclose(weights.sum(axis=0), 1.0)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_bounds_are_the_smallest_and_largest_of_each_axis(dtype):
    points = POINTS.astype(dtype)
    bounds = bounds_of(points)
    assert bounds.dtype == dtype
    np.testing.assert_array_equal(bounds, [points.min(axis=0), points.max(axis=0)])
    corners = points.reshape(20, 3, 3)
    low, high = triangle_bounds(corners)
    np.testing.assert_array_equal(low, corners.min(axis=1))
    np.testing.assert_array_equal(high, corners.max(axis=1))


def test_no_frame_is_mirrored():
    for rotation in (RIG_FROM_OPTICAL_LOOKING_UP, MIRROR_FROM_OPTICAL, *FACE_FROM_RIG):
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3))
        assert np.linalg.det(rotation) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("name", "right", "down", "forward"),
    [
        ("front", (0, -1, 0), (0, 0, -1), (1, 0, 0)),
        ("left", (1, 0, 0), (0, 0, -1), (0, 1, 0)),
        ("back", (0, 1, 0), (0, 0, -1), (-1, 0, 0)),
        ("right", (-1, 0, 0), (0, 0, -1), (0, -1, 0)),
        ("down", (0, -1, 0), (-1, 0, 0), (0, 0, -1)),  # the rig's front at its top
        ("up", (0, -1, 0), (1, 0, 0), (0, 0, 1)),  # the rig's front at its bottom
    ],
)
def test_faces_look_as_their_names_say(name, right, down, forward):
    """Positions of the rig's directions (x forward, y left, z up) in a face's image."""
    index = FACE_NAMES.index(name)
    assert face_index(forward) == index
    np.testing.assert_allclose(face_tangents(forward, index), (0, 0))
    for direction, expected in ((right, (0.5, 0)), (down, (0, 0.5))):
        seen = np.array(forward) + 0.5 * np.array(direction)
        np.testing.assert_allclose(face_tangents(seen, index), expected)
