"""The two robots of the paper's section 3.2.

The Pioneer's speed and turn rate and the Scout's counters are the makers'. The Scout's speed and
turn rate, the accelerations and all errors of the odometry are our assumptions. The latter are
chosen so that dead reckoning ends about 5 % of the path away from the truth after the paper's lap
and diagonal (24.5 m), whose figures show errors of more than a metre.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from omnisim.robot.kinematics import Kinematics
from omnisim.robot.odometry import OdometryErrors


@dataclass(frozen=True)
class Robot:
    """How a robot drives and what its wheels report.

    Attributes:
        name: of the model.
        kinematics: its limits.
        odometry: the errors of its wheels.
    """

    name: str
    kinematics: Kinematics
    odometry: OdometryErrors


SUPER_SCOUT = Robot(
    "Nomad Super Scout II",
    Kinematics(
        "differential",
        max_speed_mps=1.0,
        max_turn_rate_radps=math.radians(90.0),
        max_acceleration_mps2=0.5,
        max_turn_acceleration_radps2=math.radians(90.0),
    ),
    OdometryErrors(
        distance_scale=1.02,
        drift_radpm=math.radians(0.8),
        distance_noise_m_per_sqrt_m=0.02,
        turn_noise_rad_per_sqrt_m=math.radians(2.5),
        turn_noise_rad_per_sqrt_rad=math.radians(2.5),
        distance_tick_m=2.54e-3,
        turn_tick_rad=math.radians(0.1),
    ),
)
PIONEER_2_AT = Robot(
    "Pioneer 2 AT",
    Kinematics(
        "skid_steer",
        max_speed_mps=1.2,
        max_turn_rate_radps=math.radians(300.0),
        max_acceleration_mps2=0.5,
        max_turn_acceleration_radps2=math.radians(300.0),
    ),
    OdometryErrors(
        distance_scale=1.02,
        turn_scale=1.02,
        drift_radpm=math.radians(0.4),
        distance_noise_m_per_sqrt_m=0.02,
        turn_noise_rad_per_sqrt_m=math.radians(3.0),
        turn_noise_rad_per_sqrt_rad=math.radians(3.0),
    ),
)
