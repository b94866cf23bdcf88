"""The SICK LMS200 about its scan's origin: x forward, z up."""

from __future__ import annotations

from scenes.modeling.geometry import Patch, join, lathe
from scenes.modeling.palette import Label, Palette
from scenes.modeling.pbr_materials import Color
from scenes.modeling.prisms import block, prism, rounded_front
from scenes.modeling.robot_parts import cylinder, facing

DEPTH, WIDTH, HEIGHT = 0.155, 0.155, 0.210
SCAN_HEIGHT = 0.116  # of the scan above the underside: an assumption
COLORS: dict[str, Color] = {  # sRGB
    "lms_blue": (0.24, 0.42, 0.70),
    "lms_window": (0.07, 0.035, 0.05),
}
LABELS = {"sick": Label("SICK", 2.6, (0.96, 0.96, 0.96), COLORS["lms_blue"], 0.75)}
WINDOW_TOP, WINDOW_BOTTOM = 0.030, -0.034


def laser_scanner(palette: Palette) -> Patch:
    """Base and hood, round in front, with the dark window between them, and a spine behind it."""
    back, front, side = -DEPTH / 2, DEPTH / 2, WIDTH / 2
    bottom, top = -SCAN_HEIGHT, HEIGHT - SCAN_HEIGHT
    outline = rounded_front(back, front, side, 0.048)
    base = [(bottom, 0.003), (bottom + 0.003, 0.0)]
    base += [(WINDOW_BOTTOM - 0.008, 0.0), (WINDOW_BOTTOM, 0.008)]
    hood = [(WINDOW_TOP, 0.010), (WINDOW_TOP + 0.006, 0.0), (top - 0.012, 0.0), (top, 0.016)]
    spine = block((0.050, WIDTH - 0.004, 0.086), (back + 0.027, 0, -0.002))
    window = lathe(
        [
            (0.0, WINDOW_BOTTOM - 0.004),
            (0.056, WINDOW_BOTTOM - 0.004),
            (0.063, WINDOW_TOP + 0.004),
            (0.0, WINDOW_TOP + 0.004),
        ],
        36,
    )
    lamps = [
        palette.paint(
            color, cylinder(0.003, 0.003, 10).moved(facing(0)).shifted(front - 0.0025, y, -0.060)
        )
        for y, color in ((-0.014, "button_red"), (0.0, "yellow"), (0.014, "green"))
    ]
    sign = block((0.003, 0.030, 0.018), (front - 0.001, 0.0, -0.088), 0.0005)
    return join(
        [
            palette.paint("lms_blue", prism(outline, base), prism(outline, hood), spine),
            palette.paint("lms_window", window),
            palette.label("sick", 0.022, "lms_blue").shifted(front + 0.0003, 0, 0.060),
            palette.paint("yellow", sign),
            *lamps,
        ]
    )
