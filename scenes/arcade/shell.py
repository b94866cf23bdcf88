"""Shell of the passage, between the shops, the ground and the sky."""

from __future__ import annotations

import itertools

import numpy as np

from scenes.arcade.display import Display
from scenes.arcade.plan import (
    BAY,
    BAYS,
    BORDER,
    EAVES,
    FASCIA,
    GLAZED,
    HALF,
    LENGTH,
    PILASTER,
    PILASTER_DEPTH,
    RIDGE,
)
from scenes.modeling.geometry import Patch, bar, box, join, lathe, polygon, pose
from scenes.modeling.picture_atlas import Atlas
from scenes.modeling.stage import Model

_DIAMOND = (1.5, 1.25)  # half its length and width
_SLOPE = float(np.hypot(GLAZED, RIDGE - EAVES))


def build_shell(show: Display) -> None:
    """Floor, walls, ceiling, roof, columns."""
    for bay in range(BAYS):
        _lay_floor(show, bay)
        for side in (-1, 1):
            _raise_wall(show, bay, side)
        _roof(show, bay)
    _columns(show)
    for number, x in enumerate((0.0, LENGTH), start=1):
        _gable(show, number, x)


def _flat(corners: list[tuple[float, float]], z: float = 0.0) -> Patch:
    return polygon([(x, y, z) for x, y in corners])


def _lay_floor(show: Display, bay: int) -> None:
    """Light terrazzo with a dark border and a diamond."""
    x0, middle, y = BAY * bay, BAY * (bay + 0.5), BORDER
    a, b = _DIAMOND
    light = []
    for sx, sy in itertools.product((-1, 1), (-1, 1)):
        corners = [(-BAY / 2, -y), (0.0, -y), (0.0, -b), (-a, 0.0), (-BAY / 2, 0.0)]
        corners = [(middle - sx * cx, -sy * cy) for cx, cy in corners]
        light.append(_flat(corners if sx * sy > 0 else corners[::-1]))
    show.lay(f"floor_light_{bay + 1:02}", "terrazzo_light", join(light))
    ring = [(a, 0.0), (0.0, b), (-a, 0.0), (0.0, -b)]
    dark = []
    for (ax, ay), (bx, by) in itertools.pairwise([*ring, ring[0]]):
        corners = [(ax, ay), (bx, by), (0.8 * bx, 0.8 * by), (0.8 * ax, 0.8 * ay)]
        dark.append(_flat([(middle + cx, cy) for cx, cy in corners]))
    for low, high in ((-HALF, -y), (y, HALF)):
        dark.append(_flat([(x0, low), (x0 + BAY, low), (x0 + BAY, high), (x0, high)]))
    show.lay(f"floor_dark_{bay + 1:02}", "terrazzo_dark", join(dark))
    red = _flat([(middle + 0.8 * cx, 0.8 * cy) for cx, cy in ring])
    show.lay(f"floor_red_{bay + 1:02}", "terrazzo_red", red)


def _raise_wall(show: Display, bay: int, side: int) -> None:
    """Upper floor above a front, the pilaster at its start, mouldings and the ceiling's strip."""
    number = f"{bay + 1:02}_{'left' if side > 0 else 'right'}"
    at = pose(BAY * (bay + 0.5), side * HALF, 0.0, 0.0 if side > 0 else 180.0)
    half = BAY / 2
    corners = [(-half, 0, FASCIA), (half, 0, FASCIA), (half, 0, EAVES), (-half, 0, EAVES)]
    show.lay(f"wall_{number}", "ashlar", polygon(corners), at)
    window = show.made(_upper_window)
    for x in (-1.15, 1.15):
        show.put("shutters", window, at @ pose(x, -0.012, FASCIA + 0.14))
    show.put("moulding", show.made(_mouldings), at)
    strip = [(-half, GLAZED - HALF, EAVES), (-half, 0, EAVES), (half, 0, EAVES)]
    show.lay(f"ceiling_{number}", "plaster", polygon([*strip, (half, GLAZED - HALF, EAVES)]), at)
    for x in (-half, half) if bay == BAYS - 1 else ((-half,) if side > 0 else (half,)):
        if bay == BAYS - 1 or x * side < 0:
            show.put("pilaster", show.made(_pilaster), at @ pose(x))


def _upper_window(a: Atlas) -> Model:
    return Model("shutters", "props", a.picture("upper_window", 1.5, 1.2))


def _mouldings(a: Atlas) -> Model:
    """Cornices above the front and below the ceiling, along one bay."""
    parts = [
        a.block("moulding", (BAY, 0.14, 0.07), (0, -0.07, FASCIA + 0.035), "-x+x+y"),
        a.block("moulding", (BAY, 0.18, 0.06), (0, -0.09, EAVES - 0.12), "-x+x+y"),
        a.block("moulding", (BAY, 0.10, 0.09), (0, -0.05, EAVES - 0.045), "-x+x+y+z"),
    ]
    return Model("mouldings", "props", join(parts))


def _pilaster(a: Atlas) -> Model:
    """Pier between two fronts, with base and capital."""
    deep = PILASTER_DEPTH
    parts = [
        a.block("ivory", (PILASTER, deep, FASCIA), (0, -deep / 2, FASCIA / 2), "-z+y+z"),
        a.block("moulding", (PILASTER + 0.06, 0.05, 0.34), (0, -deep - 0.025, 0.17), "-z+y"),
        a.block("moulding", (PILASTER + 0.08, 0.05, 0.10), (0, -deep - 0.025, FASCIA - 0.2), "+y"),
        a.block("moulding", (PILASTER + 0.12, 0.07, 0.10), (0, -deep - 0.035, FASCIA - 0.1), "+y"),
    ]
    return Model("pilaster", "props", join(parts))


def _roof(show: Display, bay: int) -> None:
    """Two slopes of glass between iron ribs."""
    x0, x1 = BAY * bay, BAY * (bay + 1)
    for side in (-1, 1):
        corners = [(x0, side * GLAZED, EAVES), (x1, side * GLAZED, EAVES), (x1, 0.0, RIDGE)]
        corners.append((x0, 0.0, RIDGE))
        name = f"roof_glass_{bay + 1:02}_{'left' if side > 0 else 'right'}"
        show.lay(name, "roof_glass", polygon(corners if side < 0 else corners[::-1]))
    for x in np.linspace(x0, x1, 4)[: 4 if bay == BAYS - 1 else 3]:
        show.put("rib", show.made(_rib), pose(float(x)))
    show.put("purlin", show.made(_purlins), pose(x0))


def _rib(a: Atlas) -> Model:
    """Rafters of both slopes, and a tie."""
    parts = []
    for side in (-1, 1):
        beam = box((0.05, _SLOPE, 0.09), without="-y+y").moved(
            pose(0, 0, 0, roll_deg=-side * float(np.degrees(np.arctan2(RIDGE - EAVES, GLAZED))))
        )
        parts.append(
            a.in_material("iron", beam.shifted(0, side * GLAZED / 2, (EAVES + RIDGE) / 2 - 0.07))
        )
    parts.append(
        a.in_material("iron", bar((0, -GLAZED, EAVES + 0.02), (0, GLAZED, EAVES + 0.02), 0.014, 5))
    )
    parts.append(a.in_material("iron", bar((0, 0, EAVES + 0.02), (0, 0, RIDGE - 0.1), 0.012, 5)))
    return Model("rib", "props", join(parts))


def _purlins(a: Atlas) -> Model:
    """Ridge, eaves and bars between them, along one bay."""
    parts = [a.block("iron", (BAY, 0.07, 0.10), (BAY / 2, 0, RIDGE - 0.07), "-x+x")]
    for side in (-1, 1):
        for share in (0.0, 0.36, 0.68):
            y, z = side * GLAZED * (1 - share), EAVES + (RIDGE - EAVES) * share
            parts.append(a.block("iron", (BAY, 0.035, 0.05), (BAY / 2, y, z - 0.04), "-x+x"))
    return Model("purlins", "props", join(parts))


def _columns(show: Display) -> None:
    """Slender columns of brushed steel before every second pier."""
    for x in (BAY, 3 * BAY, 5 * BAY):
        for side in (-1, 1):
            show.put("column", show.made(_column), pose(x, side * (HALF - 0.42)))
            show.put("column_capital", show.made(_capital), pose(x, side * (HALF - 0.42)))


def _column(a: Atlas) -> Model:
    profile = [(0.0, 0.0), (0.13, 0.0), (0.13, 0.09), (0.085, 0.12), (0.085, 3.05)]
    return Model("column", "brushed_steel", lathe(profile, 18, 30))


def _capital(a: Atlas) -> Model:
    profile = [(0.085, 3.05), (0.10, 3.10), (0.10, 3.14), (0.17, 3.26), (0.17, 3.34), (0.0, 3.34)]
    return Model("capital", "brass", lathe(profile, 18, 30))


def _gable(show: Display, number: int, x: float) -> None:
    """Wall under the roof at one end, down to the eaves' moulding."""
    low = EAVES - 1.2
    corners = [(x, -HALF, low), (x, HALF, low), (x, HALF, EAVES), (x, GLAZED, EAVES)]
    corners += [(x, 0.0, RIDGE), (x, -GLAZED, EAVES), (x, -HALF, EAVES)]
    patch = polygon(corners[::-1] if x > 0 else corners)
    show.lay(f"wall_gable_{number}", "ashlar", patch)
    if x > 0:
        clock = show.made(_clock)
        show.put("clock", clock, pose(x - 0.02, 0.0, EAVES - 0.75, -90))


def _clock(a: Atlas) -> Model:
    """Dial of 0.9 m in a frame."""
    face = a.picture("clock", 0.9, 0.9, -0.04)
    return Model(
        "clock",
        "props",
        join([a.block("lacquer", (1.0, 0.06, 1.0), (0, -0.01, 0.45), "-y+y"), face]),
    )
