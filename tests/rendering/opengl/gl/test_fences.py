"""Passes by llvmpipe, whose threads are late: its memory stays sound."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).with_name("late_broadcast.c")
DRAWING = """
import numpy as np
import omnisim
from omnisim.core.poses import pose
from omnisim.rendering import OmniCamera, open_sensor
from omnisim.sensors import SpinningLidar

def motion(time_s):
    return pose((time_s, 0.0, 0.8), yaw_deg=20.0 * time_s)

scene = omnisim.load_scene("soccer")
with open_sensor(scene, SpinningLidar()) as lidar:
    for revolution in range(20):
        lidar.scan(motion, 0.1 * revolution, revolution)
camera = OmniCamera().resized(96)
poses = np.stack([camera.base_pose((0.1 * number, 0.0, 0.0)) for number in range(8)])
with open_sensor(scene, camera) as renderer:
    for one in poses:
        renderer.render(one)
    renderer.render_batch(poses)
"""


@pytest.mark.slow
@pytest.mark.usefixtures("needs_opengl")
def test_memory_is_sound_where_threads_are_late(tmp_path):
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("there is no C compiler")
    library = tmp_path / "late_broadcast.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, SOURCE, "-ldl"], check=True)
    environment = {**os.environ, "LD_PRELOAD": str(library), "LP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", DRAWING], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
