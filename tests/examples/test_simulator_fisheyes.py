"""The examples of fisheyes in PyBullet and SAPIEN run, and see what their robots push away."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

from omnisim.core.files.image_files import read_image

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("needs_opengl")]


def images_of(folder):
    return [read_image(folder / f"{number}.png")[0].astype(float) for number in range(4)]


def test_the_husky_drives_up_to_the_ball(tmp_path, capfd):
    pytest.importorskip("pybullet")
    runpy.run_path(str(EXAMPLES / "pybullet_fisheye.py"))["main"](tmp_path)
    counts = [int(count) for count in re.findall(r"has (\d+) pixels", capfd.readouterr().out)]
    assert len(counts) == 4
    assert 1000 < counts[0] < counts[1]
    images = images_of(tmp_path)
    assert np.abs(images[0] - images[3]).mean() > 5.0


def test_the_arm_sweeps_over_the_tower(tmp_path, capfd):
    pytest.importorskip("sapien")
    runpy.run_path(str(EXAMPLES / "sapien_fisheye.py"))["main"](tmp_path)
    lines = capfd.readouterr().out.splitlines()
    assert len(lines) == 4
    assert all("articulation/arm" in line for line in lines)
    assert "box4" in lines[0]
    images = images_of(tmp_path)
    assert np.abs(images[0] - images[3]).mean() > 2.0
