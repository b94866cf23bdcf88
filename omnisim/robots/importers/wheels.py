"""Wheels on joints, and the drive that they form."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

ACROSS_COSINE = 0.9  # minimum cosine between a wheel's axis and y
GROUND_SHARE = 0.25  # maximum height of a wheel's lowest point above the ground, in radii


class Wheel(NamedTuple):
    """Wheel of a model in its rest pose.

    Attributes:
        name: name of the wheel's joint.
        middle_m: (3,) center of the tire, in the file's frame.
        radius_m: radius of the tire.
        speed_radps: maximum speed that the joint states; 0: unstated.
    """

    name: str
    middle_m: NDArray[np.float64]
    radius_m: float
    speed_radps: float = 0.0

    @property
    def lowest_m(self) -> float:
        """Height of the wheel's lowest point."""
        return float(self.middle_m[2]) - self.radius_m


class WheelDrive(NamedTuple):
    """Drive of a robot whose wheels turn in pairs.

    Attributes:
        base_m: (3,) point on the ground, centered between the wheels, in the file's frame.
        table: keys of `[kinematics]` without the limits.
        speed_mps: maximum speed from the joints' limits; 0: unstated.
    """

    base_m: NDArray[np.float64]
    table: dict[str, Any]
    speed_mps: float


def is_across(axis: NDArray[np.float64]) -> bool:
    """True if an axis (3,) points left or right."""
    return bool(abs(axis[1]) > ACROSS_COSINE * np.linalg.norm(axis))


def drive_of(wheels: Sequence[Wheel], notices: list[str]) -> WheelDrive | None:
    """Drive of the wheels on the ground; None, with a notice, if they do not form pairs."""
    ground_m = min((one.lowest_m for one in wheels), default=0.0)
    standing = [one for one in wheels if one.lowest_m - ground_m < GROUND_SHARE * one.radius_m]
    middles = np.array([one.middle_m for one in standing]).reshape(-1, 3)
    middle_m = 0.5 * (middles.min(axis=0) + middles.max(axis=0)) if standing else np.zeros(3)
    is_left = middles[:, 1] > middle_m[1]
    if not standing or np.ptp(middles[:, 1]) < 1e-3 or 2 * is_left.sum() != len(standing):
        names = ", ".join(one.name for one in standing) or "none"
        notices.append(
            "kinematics: left out: expected wheels in pairs, left and right, on joints about y "
            f"without limits, got {names}"
        )
        return None
    wheelbase_m = float(np.ptp(middles[:, 0]))
    if len(standing) > 4:
        notices.append(f"drives on four wheels: the outermost of its {len(standing)}")
    radius_m = float(np.mean([one.radius_m for one in standing]))
    track_m = float(middles[is_left, 1].mean() - middles[~is_left, 1].mean())
    table = {
        "type": "differential" if len(standing) == 2 else "skid_steer",
        "track_m": round(track_m, 6),
        **({"wheelbase_m": round(wheelbase_m, 6)} if len(standing) > 2 else {}),
        "wheel_diameter_m": round(2.0 * radius_m, 6),
    }
    base_m = np.array((middle_m[0], middle_m[1], ground_m))
    return WheelDrive(base_m, table, min(one.speed_radps for one in standing) * radius_m)
