"""The example of a fisheye in MuJoCo runs, and sees the ball fall."""

import re
import runpy
from pathlib import Path

import pytest

from omnisim.core.files.image_files import read_image

pytest.importorskip("mujoco")
PATH = Path(__file__).resolve().parents[2] / "examples" / "mujoco_fisheye.py"


@pytest.mark.slow
@pytest.mark.usefixtures("needs_opengl")
def test_the_ball_falls_in_front_of_the_robot(tmp_path, capsys):
    runpy.run_path(str(PATH))["main"](tmp_path)
    counts = [int(count) for count in re.findall(r"has (\d+) pixels", capsys.readouterr().out)]
    assert len(counts) == 4
    assert min(counts) > 100
    rows = []
    for number in range(4):
        pixels, _ = read_image(tmp_path / f"{number}.png")
        red, green, blue = pixels[..., :3].transpose(2, 0, 1)
        is_ball = (red > 120) & (green < 80) & (blue < 80)
        rows.append(is_ball.nonzero()[0].mean())
    assert rows[0] < rows[1] < rows[2]
