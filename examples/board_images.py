"""Images of a chessboard by a simulated fisheye camera, to try `omnisim measure geometry` with.

python examples/board_images.py FOLDER
"""

import sys
from pathlib import Path

import numpy as np

import omnisim
from omnisim.cameras import KannalaBrandtCamera
from omnisim.rendering.camera.degradations import Degradation, Noise, Vignetting
from omnisim.validation.plain_scenes import board_poses_in_front, board_scene

LENS = KannalaBrandtCamera(
    640, 480, (205.0, 205.4), (322.5, 237.0), (0.012, -0.008, 0.002, -0.0005), np.radians(95.0)
)
DEGRADATION = Degradation(vignetting=Vignetting((-0.25, 0.05, -0.01)), noise=Noise())
IMAGES = 12
WIDEST_RAD = np.radians(55.0)  # of the board's middle, from the axis


def main(folder: Path) -> None:
    """Write images of the board all over the field."""
    folder.mkdir(parents=True, exist_ok=True)
    sensor = omnisim.OmniCamera(LENS, degradation=DEGRADATION)
    with omnisim.open_sensor(board_scene(), sensor, unlit=True) as renderer:
        for number, optical_from_board in enumerate(board_poses_in_front(IMAGES, WIDEST_RAD)):
            rig_from_board = np.eye(4)
            rig_from_board[:3] = LENS.rig_from_optical @ optical_from_board[:3]
            frame = renderer.render(np.linalg.inv(rig_from_board), frame_number=number)
            frame.save(folder / f"{number:02}.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
