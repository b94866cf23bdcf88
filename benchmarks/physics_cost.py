"""Processor time of physics within a drive, images included.

Run `python -m benchmarks.physics_cost [SCENE ROBOT PATH]`; default: the Pioneer's lap of the soccer
field. Processor time is used because other programs hardly change it.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from unittest.mock import patch

from omnisim import load_scene
from omnisim.robots import load_robot
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.physics.simulation import STEP_S, SimulatedWorld
from omnisim.runs.route import Route


def main(scene: str, robot: str, path: str) -> None:
    """Print the times of the physics steps, of the plan that contains them, and of the drive."""
    advance, spent_s = SimulatedWorld.advance, 0.0

    def timed(
        world: SimulatedWorld, time_s: float, rates_radps: Sequence[tuple[float, float]]
    ) -> None:
        nonlocal spent_s
        begun_s = time.process_time()
        advance(world, time_s, rates_radps)
        spent_s += time.process_time() - begun_s

    loaded = load_robot(robot)
    drive = Drive(
        load_scene(scene), Vehicle.from_robot(loaded), Route(path), physics=loaded.chassis
    )
    start_s = time.process_time()
    with patch.object(SimulatedWorld, "advance", timed):
        plan = drive.plan()
    planned_s = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        steps = len(list(plan.record(Path(folder) / "run"))) - 1
    total_s = time.process_time() - start_s
    count = plan.truth.duration_s / STEP_S
    print(
        f"{count:.0f} steps of {1e3 * STEP_S:g} ms: {spent_s:.2f} s, "
        f"{1e6 * spent_s / count:.0f} µs each, {spent_s / total_s:.1%} of the drive; "
        f"planning {planned_s - start_s:.2f} s; "
        f"{steps} images and scans, {total_s:.2f} s in all"
    )


if __name__ == "__main__":
    main(*(sys.argv[1:] or ("soccer", "p2at", "lap")))
