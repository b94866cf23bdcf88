"""Readout measured from frames that the renderer's own rolling shutter exposes row by row."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from omnisim.cameras import KannalaBrandtCamera
from omnisim.measurement.geometry import Chessboard
from omnisim.measurement.geometry.board_detection import find_board
from omnisim.measurement.timing import measure_readout
from omnisim.rendering.camera.degradations import Degradation, Shutter
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.validation.plain_scenes import PATTERN, SQUARE_M, board_scene

LENS = KannalaBrandtCamera(
    320, 240, (210.0, 210.4), (160.8, 118.5), (0.012, -0.008, 0.002, -0.0005), np.radians(44.0)
)
READOUT_S, EXPOSURE_S, FRAME_RATE_HZ, FRAMES = 0.021, 0.002, 30.0, 8
SUB_FRAMES = 23  # of 1 ms: each row averages two of them


def base_pose(time_s):
    """Pose (4, 4) of the camera before the board, which turns about its axis, unevenly."""
    turn = np.radians(300.0) * time_s + 0.06 * np.sin(9.0 * time_s)
    optical_from_board = np.eye(4)
    optical_from_board[:3, :3] = Rotation.from_euler("zyx", (turn, 0.25, -0.2)).as_matrix()
    optical_from_board[:3, 3] = 0.02 + 0.1 * time_s, 0.03, 0.85
    rig_from_board = np.eye(4)
    rig_from_board[:3] = LENS.rig_from_optical @ optical_from_board[:3]
    return np.linalg.inv(rig_from_board)


def rendered_views(shutter):
    sensor = OmniCamera(LENS, degradation=Degradation(shutter=shutter))
    views = []
    with open_sensor(board_scene(), sensor, unlit=True) as renderer:
        for number in range(FRAMES):
            time_s = number / FRAME_RATE_HZ
            frame = renderer.render(
                base_pose(time_s), motion=lambda later_s, now_s=time_s: base_pose(now_s + later_s)
            )
            image = np.ascontiguousarray(frame.rgba[..., 1])
            views.append(find_board(image, Chessboard(*PATTERN, SQUARE_M), f"{number}.png"))
    return views


@pytest.mark.slow
def test_the_readout_of_rendered_frames_is_right_to_a_percent():
    pytest.importorskip("cv2")
    shutter = Shutter(exposure_s=EXPOSURE_S, readout_s=READOUT_S, sub_frames=SUB_FRAMES)
    measured = measure_readout(LENS, rendered_views(shutter), range(FRAMES), FRAME_RATE_HZ)
    assert measured.lines == "rows"
    assert measured.readout_s == pytest.approx(READOUT_S, rel=0.01)
    assert "readout_direction" not in {one.name for one in measured.unobservable}
