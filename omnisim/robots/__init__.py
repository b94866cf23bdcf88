"""Robots: robot files, their importers, motion planning and wheel odometry.

Poses are world_from_base (`omnisim.core.coordinate_frames`). Turns and headings are positive
counter-clockwise as seen from above. This package depends on neither images nor the GPU.
"""

from omnisim.core.trajectories.odometry import (
    Odometry,
    OdometryErrors,
    read_odometry,
    simulate_odometry,
    with_errors,
    write_odometry,
)
from omnisim.robots.kinematics import Kinematics, check_drivable, find_violation
from omnisim.robots.motion_profile import plan_in_steps, plan_with_period, time_poses
from omnisim.robots.robot_file import (
    Chassis,
    Footprint,
    Robot,
    builtin_robots,
    find_robot,
    load_robot,
    parse_robot,
    read_robot,
)

__all__ = [
    "Chassis",
    "Footprint",
    "Kinematics",
    "Odometry",
    "OdometryErrors",
    "Robot",
    "builtin_robots",
    "check_drivable",
    "find_robot",
    "find_violation",
    "load_robot",
    "parse_robot",
    "plan_in_steps",
    "plan_with_period",
    "read_odometry",
    "read_robot",
    "simulate_odometry",
    "time_poses",
    "with_errors",
    "write_odometry",
]
