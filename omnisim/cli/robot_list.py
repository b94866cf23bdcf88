"""`omnisim robot list`."""

from __future__ import annotations

import math

from rich.console import Console

from omnisim.robot import Kinematics, builtin_robots, load_robot


def run(out: Console) -> None:
    """Print a line for each built-in robot.

    Raises:
        RobotFileError: a robot file that is damaged.
    """
    robots = [load_robot(name) for name in builtin_robots()]
    width = max((len(robot.name) for robot in robots), default=0)
    for robot in robots:
        sensors = ", ".join(mount.name for mount in robot.mounts) or "no sensors"
        out.print(
            f"{robot.name:<{width}}  {robot.title}: {drive_words(robot.kinematics)}; {sensors}",
            markup=False,
        )


def drive_words(kinematics: Kinematics | None) -> str:
    """How a robot drives, in words."""
    if kinematics is None:
        return "no kinematics"
    drive = {"differential": "differential drive", "skid_steer": "skid steering"}[kinematics.drive]
    turn_dps = math.degrees(kinematics.max_turn_rate_radps)
    return f"{drive}, {kinematics.max_speed_mps:g} m/s, {turn_dps:g} °/s"
