import math

import numpy as np
import pytest

from omnisim.core import poses
from omnisim.core.errors import OmnisimError
from omnisim.core.poses import is_rotation, pose, rotation_from_quaternion


def _quaternions():
    """Random ones, half turns about every axis, and the neighborhood of both and of none."""
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
    again = poses.quaternion_from_rotation(rotations)
    assert np.all(again[:, 3] >= 0.0)
    np.testing.assert_allclose(np.linalg.norm(again, axis=-1), 1.0, atol=1e-15)
    apart = np.minimum(
        np.linalg.norm(again - quaternions, axis=-1), np.linalg.norm(again + quaternions, axis=-1)
    )
    assert np.max(apart) < 1e-14
    np.testing.assert_allclose(rotation_from_quaternion(again), rotations, atol=1e-14)


def test_angles_there_and_back():
    rng = np.random.default_rng(1)
    angles = rng.uniform(-1.0, 1.0, (500, 3)) * (math.pi, math.pi / 2, math.pi)
    rotations = np.array([poses.rotation_from_roll_pitch_yaw(*row) for row in angles])
    np.testing.assert_allclose(poses.roll_pitch_yaw_from_rotation(rotations), angles, atol=1e-12)
    np.testing.assert_allclose(poses.yaw_from_rotation(rotations), angles[:, 2], atol=1e-12)
    yaw = np.linspace(-7.0, 7.0, 29)
    expected = [poses.rotation_from_roll_pitch_yaw(0.0, 0.0, angle) for angle in yaw]
    np.testing.assert_allclose(poses.rotation_from_yaw(yaw), expected, atol=1e-15)


@pytest.mark.parametrize("off", [0.0, 1e-16, 1e-12, 1e-8, 1e-4])
@pytest.mark.parametrize("up", [-1.0, 1.0])
def test_angles_where_roll_and_yaw_are_one(up, off):
    for roll, yaw in ((0.3, 0.2), (-2.0, 1.0), (3.0, -3.0)):
        rotation = poses.rotation_from_roll_pitch_yaw(roll, up * (math.pi / 2 - off), yaw)
        angles = poses.roll_pitch_yaw_from_rotation(rotation)
        again = poses.rotation_from_roll_pitch_yaw(*angles)
        np.testing.assert_allclose(again, rotation, atol=1e-14)


def test_rotation_angles():
    rng = np.random.default_rng(2)
    first = rotation_from_quaternion(rng.normal(size=(500, 4)))
    angles = np.concatenate((rng.uniform(-3.1, 3.1, 496), (1e-12, -1e-9, 0.0, 3.1415926)))
    found = poses.rotation_angles(first, first @ poses.rotation_from_yaw(angles))
    np.testing.assert_allclose(found, angles, atol=1e-14, rtol=1e-14)


def test_rounded_rotation_is_repaired():
    rotations = rotation_from_quaternion(np.random.default_rng(3).normal(size=(200, 4)))
    rounded = np.round(rotations, 4)
    assert not np.any(is_rotation(rounded, 1e-9))
    repaired = poses.nearest_rotation(rounded)
    assert np.all(is_rotation(repaired, 1e-14))
    assert np.max(np.abs(repaired - rounded)) < 1.5e-4  # no farther than the rounding was


@pytest.mark.parametrize(
    "matrix", [2.0 * np.eye(3), np.diag([1.0, 1.0, -1.0]), np.zeros((3, 3)), np.ones((3, 3))]
)
def test_what_is_no_rotation(matrix):
    assert not is_rotation(matrix, 1e-3)


def test_signs_of_roll_pitch_yaw_are_rep_103s():
    left_turn, nose_down, left_side_up = pose(yaw_deg=90), pose(pitch_deg=90), pose(roll_deg=90)
    np.testing.assert_allclose(left_turn[:3, :3] @ (1, 0, 0), (0, 1, 0), atol=1e-15)
    np.testing.assert_allclose(nose_down[:3, :3] @ (1, 0, 0), (0, 0, -1), atol=1e-15)
    np.testing.assert_allclose(left_side_up[:3, :3] @ (0, 1, 0), (0, 0, 1), atol=1e-15)


def test_roll_comes_before_pitch_before_yaw():
    together = pose((1, 2, 3), roll_deg=10, pitch_deg=20, yaw_deg=30)
    one_by_one = pose((1, 2, 3)) @ pose(yaw_deg=30) @ pose(pitch_deg=20) @ pose(roll_deg=10)
    np.testing.assert_allclose(together, one_by_one, atol=1e-15)


def test_inverse_poses():
    generator = np.random.default_rng(4)
    rotations = rotation_from_quaternion(generator.normal(size=(50, 4)))
    many = poses.pose_from_rotation(rotations, generator.normal(size=(50, 3)))
    np.testing.assert_allclose(poses.inverse(many) @ many, [np.eye(4)] * 50, atol=1e-14)
    np.testing.assert_array_equal(poses.inverse(many[0]), poses.inverse(many)[0])


def test_interpolated_pose_moves_and_turns_evenly():
    first, second = pose((1, 2, 3), yaw_deg=10), pose((3, 2, 1), yaw_deg=50)
    found = poses.interpolate_pose(first, second, 0.25)
    np.testing.assert_allclose(found, pose((1.5, 2, 2.5), yaw_deg=20), atol=1e-15)


def test_wrapped_angles():
    angles = np.array([0.0, 3.0, -3.0, 4.0, -4.0, 20.0])
    wrapped = poses.wrap_angles(angles)
    np.testing.assert_allclose(wrapped, [poses.wrap_angle(angle) for angle in angles], atol=1e-14)
    np.testing.assert_allclose(np.exp(1j * wrapped), np.exp(1j * angles), atol=1e-14)
    assert np.all(np.abs(wrapped) <= math.pi)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ((0.0, 0.0, 1.0), r", as omnisim\.pose makes one, got an array of shape \(3,\)"),
        (np.eye(3), r", as .* got an array of shape \(3, 3\)"),
        (1.0, r", as .* got an array of shape \(\)"),
        ("here", ", got str"),
        ([[1.0], [2.0, 3.0]], ", got list"),
        (np.full((4, 4), np.nan), ""),
    ],
)
def test_what_is_no_pose_says_what_was_expected(given, words):
    with pytest.raises(OmnisimError, match=rf"^pose: expected a finite 4 × 4 matrix{words}$"):
        poses.check_pose(given)


def test_scaled_rotations_and_impossible_positions():
    for scale in (1.0 + 5e-6, 1.0 - 5e-6):
        with pytest.raises(OmnisimError, match="no scale"):
            poses.check_pose(np.diag([scale, scale, scale, 1.0]))
    for position in ((0, 0), (0, 0, np.nan), (1e39, 0, 0)):
        with pytest.raises(OmnisimError, match="three finite numbers"):
            pose(position)
