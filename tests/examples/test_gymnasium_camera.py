"""The example of a camera on Gymnasium's ant runs, and sees the ant move."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from omnisim.core.files.image_files import read_image

pytest.importorskip("gymnasium.envs.mujoco", reason="gymnasium[mujoco] is not installed")
PATH = Path(__file__).resolve().parents[2] / "examples" / "gymnasium_camera.py"


@pytest.mark.slow
@pytest.mark.usefixtures("needs_opengl")
def test_the_ant_moves_its_legs_in_the_images(tmp_path):
    runpy.run_path(str(PATH))["main"](tmp_path)
    images = [read_image(tmp_path / f"{number}.png")[0].astype(int) for number in range(3)]
    red, green, blue = np.moveaxis(images[0][..., :3], -1, 0)
    is_ant = (red > green + 30) & (green > blue + 20)
    assert 0.05 < is_ant.mean() < 0.3
    assert all((images[0] != image).mean() > 0.1 for image in images[1:])
