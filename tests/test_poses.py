import math

import numpy as np
import pytest

from omnisim.poses import (
    is_rotation,
    nearest_rotation,
    quaternion_from_rotation,
    roll_pitch_yaw_from_rotation,
    rotation_angles,
    rotation_from_quaternion,
    rotation_from_roll_pitch_yaw,
    rotation_from_yaw,
    yaw_from_rotation,
)


def _quaternions():
    """Random ones, half turns about every axis, and the neighbourhood of both and of none."""
    rng = np.random.default_rng(0)
    random = rng.normal(size=(2000, 4))
    axes = np.concatenate((np.eye(3), rng.normal(size=(200, 3))))
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
    angles = (0.0, 1e-15, 1e-9, 1e-4, math.pi - 1e-4, math.pi - 1e-9, math.pi)
    special = [(*(math.sin(a / 2) * axis), math.cos(a / 2)) for a in angles for axis in axes]
    quaternions = np.concatenate((random, special))
    return quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True)


@pytest.mark.parametrize(
    ("quaternion", "image_of_x"),
    [
        ((0, 0, 0, 1), (1, 0, 0)),
        ((0, 0, 1, 1), (0, 1, 0)),  # a quarter turn to the left
        ((0, 1, 0, 1), (0, 0, -1)),  # a quarter turn about y: nose down
        ((1, 0, 0, 0), (1, 0, 0)),
        ((0, 0, 5, 0), (-1, 0, 0)),  # not of length 1
    ],
)
def test_quaternion_by_hand(quaternion, image_of_x):
    np.testing.assert_allclose(rotation_from_quaternion(quaternion)[:, 0], image_of_x, atol=1e-15)


def test_quaternion_there_and_back():
    quaternions = _quaternions()
    rotations = rotation_from_quaternion(quaternions)
    assert np.all(is_rotation(rotations, 1e-14))
    again = quaternion_from_rotation(rotations)
    assert np.all(again[:, 3] >= 0.0)
    np.testing.assert_allclose(np.linalg.norm(again, axis=-1), 1.0, atol=1e-15)
    apart = np.minimum(
        np.linalg.norm(again - quaternions, axis=-1), np.linalg.norm(again + quaternions, axis=-1)
    )
    assert np.max(apart) < 1e-14
    np.testing.assert_allclose(rotation_from_quaternion(again), rotations, atol=1e-14)


def test_angles_there_and_back():
    rng = np.random.default_rng(1)
    angles = rng.uniform(-1.0, 1.0, (2000, 3)) * (math.pi, math.pi / 2, math.pi)
    rotations = np.array([rotation_from_roll_pitch_yaw(*row) for row in angles])
    np.testing.assert_allclose(roll_pitch_yaw_from_rotation(rotations), angles, atol=1e-12)
    np.testing.assert_allclose(yaw_from_rotation(rotations), angles[:, 2], atol=1e-12)


@pytest.mark.parametrize("off", [0.0, 1e-16, 1e-12, 1e-8, 1e-4])
@pytest.mark.parametrize("up", [-1.0, 1.0])
def test_angles_where_roll_and_yaw_are_one(up, off):
    for roll, yaw in ((0.3, 0.2), (-2.0, 1.0), (3.0, -3.0)):
        rotation = rotation_from_roll_pitch_yaw(roll, up * (math.pi / 2 - off), yaw)
        angles = roll_pitch_yaw_from_rotation(rotation)
        np.testing.assert_allclose(rotation_from_roll_pitch_yaw(*angles), rotation, atol=1e-14)


def test_yaw_only():
    yaw = np.linspace(-7.0, 7.0, 29)
    expected = [rotation_from_roll_pitch_yaw(0.0, 0.0, angle) for angle in yaw]
    np.testing.assert_allclose(rotation_from_yaw(yaw), expected, atol=1e-15)


def test_rotation_angles():
    rng = np.random.default_rng(2)
    first = rotation_from_quaternion(rng.normal(size=(500, 4)))
    angles = np.concatenate((rng.uniform(-3.1, 3.1, 496), (1e-12, -1e-9, 0.0, 3.1415926)))
    second = first @ rotation_from_yaw(angles)
    np.testing.assert_allclose(rotation_angles(first, second), angles, atol=1e-14, rtol=1e-14)


def test_rounded_rotation_is_repaired():
    rotations = rotation_from_quaternion(np.random.default_rng(3).normal(size=(200, 4)))
    rounded = np.round(rotations, 4)
    assert not np.any(is_rotation(rounded, 1e-9))
    repaired = nearest_rotation(rounded)
    assert np.all(is_rotation(repaired, 1e-14))
    assert np.max(np.abs(repaired - rounded)) < 1.5e-4  # no farther than the rounding was


@pytest.mark.parametrize(
    "matrix", [2.0 * np.eye(3), np.diag([1.0, 1.0, -1.0]), np.zeros((3, 3)), np.ones((3, 3))]
)
def test_what_is_no_rotation(matrix):
    assert not is_rotation(matrix, 1e-3)
