import numpy as np
import pytest

from omnisim.core.coordinate_frames import MIRROR_FROM_OPTICAL, RIG_FROM_OPTICAL_LOOKING_UP
from omnisim.core.cube import FACE_FROM_RIG, FACE_NAMES, face_index, face_tangents


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
