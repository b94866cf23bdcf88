"""Rate and memory of `omnisim export`, for a run of 500 images of 720 × 720 px with ranges.

Run `python -m benchmarks.export_speed [FORMAT [STEPS]]`; defaults: ros2-mcap, 500. Eight images of
courtyard are rendered, and linked repeatedly to fill all steps. The rate counts the bytes written,
per second of wall-clock time and of processor time, which other programs slow less. Memory is the
maximum resident size of the process, libraries included.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.errors import BenchmarkError
from omnisim import load_scene, pose
from omnisim.cameras import EquidistantCamera
from omnisim.core.trajectories import Trajectory, write_trajectory
from omnisim.core.trajectories.odometry import OdometryErrors
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.sensor import Mount
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.runs.run_folder import GROUND_TRUTH, MANIFEST

RENDERED, SIZE_PX, STEPS = 8, 720, 500
CAMERA = "camera"


def _record(folder: Path, steps: int) -> None:
    """Record a run of a few images, and link them repeatedly to fill all steps."""
    lens = EquidistantCamera(SIZE_PX, SIZE_PX, 240.0, (359.5, 359.5), 1.5)
    camera = Mount(OmniCamera(lens).with_quality("fast"), CAMERA, "omnicamera")
    vehicle = Vehicle("rig", "rig", None, None, OdometryErrors(), None, (camera,))
    drive = Drive(load_scene("courtyard"), vehicle, Route("line"), channels=("range",))
    list(drive.along(_line(RENDERED)).record(folder))
    (folder / GROUND_TRUTH).unlink()
    write_trajectory(folder / GROUND_TRUTH, _line(steps))
    manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    manifest["steps"] = steps
    (folder / MANIFEST).write_text(json.dumps(manifest), encoding="utf-8")
    for step in range(RENDERED, steps):
        for suffix in (".png", ".channels.exr"):
            source = folder / CAMERA / f"{step % RENDERED:06d}{suffix}"
            os.link(source, folder / CAMERA / f"{step:06d}{suffix}")


def _line(steps: int) -> Trajectory:
    x_m = np.linspace(-2.0, 2.0, steps)
    times_s = np.arange(steps, dtype=np.float64) / 10.0
    return Trajectory(times_s, np.array([pose((x, -0.5, 1.3)) for x in x_m]))


def main(name: str, steps: int = STEPS) -> None:
    """Export the run, and print rate and memory."""
    with tempfile.TemporaryDirectory() as folder:
        run, output = Path(folder) / "run", Path(folder) / "export"
        # in another process: memory of this one would count for its children
        recorder = multiprocessing.get_context("spawn").Process(target=_record, args=(run, steps))
        recorder.start()
        recorder.join()
        command = [sys.executable, "-m", "omnisim", "export", str(run), "--to", name]
        start_s = time.perf_counter()
        export = subprocess.Popen([*command, "-o", str(output)])
        _, status, used = os.wait4(export.pid, 0)
        wall_s = time.perf_counter() - start_s
        if status:
            raise BenchmarkError(f"omnisim export --to {name}: ended with status {status}")
        processor_s = used.ru_utime + used.ru_stime
        size_mb = sum(file.stat().st_size for file in output.rglob("*") if file.is_file()) / 1e6
    print(
        f"{name}: {size_mb:.0f} MB of {steps} steps: {size_mb / wall_s:.0f} MB/s, "
        f"{size_mb / processor_s:.0f} MB a second of processor, {used.ru_maxrss / 1e3:.0f} MB of "
        "memory"
    )


if __name__ == "__main__":
    main(
        sys.argv[1] if len(sys.argv) > 1 else "ros2-mcap",
        int(sys.argv[2]) if len(sys.argv) > 2 else STEPS,
    )
