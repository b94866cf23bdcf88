"""Parts that robots have in common: sonars, buttons, antennas, bolts.

Round parts are made about z, standing on z = 0.
"""

from __future__ import annotations

import numpy as np

from scenes.modeling.geometry import Patch, join, lathe, pose, tube
from scenes.modeling.palette import Palette
from scenes.modeling.pbr_materials import Color

COLORS: dict[str, Color] = {  # sRGB
    "rubber": (0.145, 0.145, 0.15),
    "sonar_gold": (0.80, 0.68, 0.40),
    "sonar_rim": (0.36, 0.36, 0.37),
    "button_red": (0.85, 0.06, 0.04),
    "yellow": (0.95, 0.77, 0.10),
    "green": (0.15, 0.75, 0.25),
}


def cylinder(radius: float, height: float, segments: int = 16) -> Patch:
    """Closed cylinder."""
    return lathe([(0.0, 0.0), (radius, 0.0), (radius, height), (0.0, height)], segments)


def sonar(palette: Palette, radius: float = 0.019) -> Patch:
    """Round ultrasonic transducer in its rim."""
    rim = [(0.0, 0.0), (radius, 0.0), (radius, 0.003), (0.86 * radius, 0.004)]
    rim.append((0.82 * radius, 0.0015))
    disc = [rim[-1], (0.0, 0.0026)]
    return join(
        [
            palette.paint("sonar_rim", lathe(rim, 12)),
            palette.paint("sonar_gold", lathe(disc, 12)),
        ]
    )


def emergency_stop(palette: Palette) -> Patch:
    """Red mushroom on a yellow collar."""
    collar = cylinder(0.024, 0.010, 16)
    stem = cylinder(0.011, 0.022, 12)
    mushroom = [(0.0, 0.0), (0.019, 0.0), (0.020, 0.006), (0.016, 0.011), (0.0, 0.013)]
    return join(
        [
            palette.paint("yellow", collar),
            palette.paint("rubber", stem),
            palette.paint("button_red", lathe(mushroom, 16).shifted(z=0.020)),
        ]
    )


def antenna(palette: Palette, height: float) -> Patch:
    """Rubber rod of a radio link."""
    profile = [(0.0, 0.0), (0.009, 0.0), (0.009, 0.014), (0.0055, 0.018)]
    profile += [(0.004, height - 0.003), (0.0, height)]
    return palette.paint("rubber", lathe(profile, 12))


def handle(span: float, height: float, radius: float = 0.005) -> Patch:
    """Bow along x to carry something by."""
    bend = 0.6 * height
    path = [
        (-span / 2, 0, -0.002),
        (-span / 2, 0, height - bend),
        (-span / 2 + 0.3 * bend, 0, height - 0.3 * bend),
        (-span / 2 + bend, 0, height),
        (span / 2 - bend, 0, height),
        (span / 2 - 0.3 * bend, 0, height - 0.3 * bend),
        (span / 2, 0, height - bend),
        (span / 2, 0, -0.002),
    ]
    return tube(path, radius, 6)


def facing(yaw_deg: float) -> np.ndarray:
    """Rotation that turns a part made about z outwards, level, to a heading."""
    return pose(yaw_deg=yaw_deg) @ pose(pitch_deg=90)
