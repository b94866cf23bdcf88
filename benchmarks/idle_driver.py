"""Processor time of a frame without the GPU's work, from a driver that draws nothing.

Mesa's `GALLIUM_NOOP=1` discards every draw, as if the GPU were infinitely fast. The switch holds
for a whole process, so this measurement has its own:

    GALLIUM_NOOP=1 GALLIUM_THREAD=0 python -m benchmarks.idle_driver ROUNDS WARM_UP DEVICE SCENE ...

It prints rows as JSON; DEVICE "none" is the first device.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.errors import BenchmarkError
from benchmarks.options import Options
from benchmarks.settings import at_setting
from benchmarks.timer import time_interleaved
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl.gl.context import open_context
from omnisim.rendering.renderer import Renderer
from omnisim.rendering.stage import Stage
from omnisim.report.machine import ROOT
from omnisim.scene import Scene, load_scene

SETTING, FRAME_PX = "fast", 360
BATCH, BATCH_PX = 64, 84  # images, and their side
POSES = 8
# The second switch avoids the driver's own thread, in which Mesa 22 crashes.
ENVIRONMENT = {"GALLIUM_NOOP": "1", "GALLIUM_THREAD": "0"}
_RENDERER = "NOOP"  # the driver's name then
_FIRST = "none"


def idle_driver_rows(scenes: Sequence[str], options: Options) -> list[dict[str, Any]]:
    """Rows of a report, one per scene, measured in a separate process.

    Only Mesa's drivers have the switch; others yield no rows.

    Args:
        scenes: names or files.
        options: rounds and device.

    Raises:
        BenchmarkError: the process fails.
    """
    paths = [str(Path(scene).resolve()) if Path(scene).is_file() else scene for scene in scenes]
    numbers = [str(options.rounds), str(options.warm_up)]
    device = _FIRST if options.device is None else str(options.device)
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.idle_driver", *numbers, device, *paths], cwd=ROOT,
        env={**os.environ, **ENVIRONMENT}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
        raise BenchmarkError(f"limit: the process without drawing failed: {last}")
    rows: list[dict[str, Any]] = json.loads(done.stdout)
    return rows


def main(rounds: str, warm_up: str, device: str, *scenes: str) -> list[dict[str, Any]]:
    """Measure in this process and return the rows; no rows if its driver draws."""
    number = None if device == _FIRST else int(device)
    with open_context(number) as context:
        if context.info["GL_RENDERER"] != _RENDERER:
            return []
    options = Options(int(rounds), int(warm_up), number)
    return [_row(scene, options) for scene in scenes]


def _row(scene: str, options: Options) -> dict[str, Any]:
    """Processor time of single frames and batches of a scene, without waiting for a GPU."""
    loaded = load_scene(scene)
    camera = at_setting(OmniCamera(), SETTING)
    with (
        Stage(loaded, device=options.device) as stage,
        stage.open(camera.resized(FRAME_PX)) as large,
        stage.open(camera.resized(BATCH_PX)) as small,
    ):
        poses, many = _poses(loaded, POSES), _poses(loaded, BATCH)
        images = small.render_batch(many)
        timings = time_interleaved(
            {
                "frame": partial(_render_each, large, poses),
                "small_frame": partial(_render_each, small, poses),
                "batched": lambda: small.render_batch(many, out=images),
            },
            options.rounds,
            options.warm_up,
        )
    return {
        "kind": "idle driver", "scene": Path(scene).stem, "setting": SETTING,
        "frame_px": FRAME_PX, "batch_px": BATCH_PX, "batch": BATCH,
        **{
            f"{what}_ms": 1e3 * float(np.median(timings.processor_seconds[what])) / count
            for what, count in (("frame", POSES), ("small_frame", POSES), ("batched", BATCH))
        },
    }  # fmt: skip


def _render_each(renderer: Renderer, poses: NDArray[np.float64]) -> None:
    for pose in poses:
        renderer.render(pose)


def _poses(scene: Scene, count: int) -> NDArray[np.float64]:
    """Poses (count, 4, 4) that turn at a scene's start, and move slightly."""
    start, camera = scene.start, OmniCamera()
    x, y, z = start.position_m
    poses = [
        camera.base_pose((x + 0.01 * number, y, z), yaw_deg=start.yaw_deg + 360.0 * number / count)
        for number in range(count)
    ]
    return np.stack(poses)


if __name__ == "__main__":
    print(json.dumps(main(*sys.argv[1:])))
