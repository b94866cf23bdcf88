import numpy as np
import pytest

from omnisim.cube import FACE_FROM_RIG, FACE_NAMES, face_index, face_tangents
from omnisim.errors import OmnisimError
from omnisim.frames import MIRROR_FROM_OPTICAL, RIG_FROM_OPTICAL_LOOKING_UP
from omnisim.poses import check_pose, pose


def test_signs_of_roll_pitch_yaw_are_rep_103s():
    left_turn, nose_down, left_side_up = pose(yaw_deg=90), pose(pitch_deg=90), pose(roll_deg=90)
    np.testing.assert_allclose(left_turn[:3, :3] @ (1, 0, 0), (0, 1, 0), atol=1e-15)
    np.testing.assert_allclose(nose_down[:3, :3] @ (1, 0, 0), (0, 0, -1), atol=1e-15)
    np.testing.assert_allclose(left_side_up[:3, :3] @ (0, 1, 0), (0, 0, 1), atol=1e-15)


def test_roll_comes_before_pitch_before_yaw():
    together = pose((1, 2, 3), roll_deg=10, pitch_deg=20, yaw_deg=30)
    one_by_one = pose((1, 2, 3)) @ pose(yaw_deg=30) @ pose(pitch_deg=20) @ pose(roll_deg=10)
    np.testing.assert_allclose(together, one_by_one, atol=1e-15)


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
    """Positions of the rig's directions (x forward, y left, z up) in a face's picture."""
    index = FACE_NAMES.index(name)
    assert face_index(forward) == index
    np.testing.assert_allclose(face_tangents(forward, index), (0, 0))
    for direction, expected in ((right, (0.5, 0)), (down, (0, 0.5))):
        seen = np.array(forward) + 0.5 * np.array(direction)
        np.testing.assert_allclose(face_tangents(seen, index), expected)


@pytest.mark.parametrize("scale", [1.0 + 5e-6, 1.0 - 5e-6])
def test_a_scaled_rotation_is_no_pose(scale):
    with pytest.raises(OmnisimError, match="no scale"):
        check_pose(np.diag([scale, scale, scale, 1.0]))


@pytest.mark.parametrize("position", [(0, 0), (0, 0, np.nan), (1e39, 0, 0)])
def test_impossible_positions(position):
    with pytest.raises(OmnisimError, match="three finite numbers"):
        pose(position)
