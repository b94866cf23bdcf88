"""Parts of the cloister: arcade, roofs, walls, windows, doors.

Parts of the arcade are modeled for the north side: x along the wall to the right as seen from
the court, y outward, y = 0 the arcade's middle plane.  The other sides are turned copies.
"""

from __future__ import annotations

import numpy as np

from scenes.courtyard.materials import in_material
from scenes.modeling.geometry import Patch, bar, box, join, lathe, polygon, pose, ring, sheet, tile
from scenes.modeling.stage import Model

BAY = 2.2
WALK = 2.2  # from the arcade's middle plane to the wall behind it
KERB = 0.35  # half width of the kerb the columns stand on
STEP = 0.12
SPRING = 1.75
EAVE = 3.1
ARCH_RADIUS = 0.85
WALL_HALF = 0.18
VOUSSOIRS = 13  # as many as the arch picture shows
EAVE_EDGE = -0.48  # the roof overhangs the arcade towards the court
ROOF_FOOT = 3.2
EAVE_LIP = 0.06  # how far the tile edge hangs below the roof plane
ROOF_TOP = 4.45
WINDOW = (0.84, 1.30)
ROOF_PICTURE = (2.0, 2.4)  # meters shown by the roof tile texture: 8 columns, 6 rows


def column() -> Model:
    """Round column with base, capital and abacus."""
    shaft = [
        (0.19, 0.22),
        (0.205, 0.25),
        (0.160, 0.31),
        (0.150, 0.80),
        (0.135, 1.42),
        (0.158, 1.44),
        (0.135, 1.47),
        (0.22, 1.63),
    ]
    parts = [
        in_material("limestone", box((0.44, 0.44, 0.10), (0, 0, STEP + 0.05), without="-z")),
        in_material("marble", lathe(shaft, 10, crease_deg=70)),
        in_material("limestone", box((0.52, 0.52, 0.12), (0, 0, SPRING - 0.06), without="")),
    ]
    return Model("column", "props", join(parts))


def corner_pier() -> Model:
    """Square pier where two arcades meet, from the kerb to the eave."""
    parts = [
        box((0.66, 0.66, 0.20), (0, 0, STEP + 0.10), "-z", courses=True),
        box((0.52, 0.52, EAVE - STEP - 0.2), (0, 0, (EAVE + STEP + 0.2) / 2), "-z+z", courses=True),
        box((0.62, 0.62, 0.14), (0, 0, SPRING - 0.07), courses=True),
        box((0.62, 0.62, 0.16), (0, 0, EAVE - 0.08), "+z", courses=True),
    ]
    return Model("corner_pier", "ashlar", tile(join(parts), 1.6))


def arch(side: str) -> Model:
    """One bay of the arcade above the capitals, voussoirs raised towards the court."""
    angles = np.linspace(np.pi, 0, VOUSSOIRS + 1)
    arc_x, arc_z = ARCH_RADIUS * np.cos(angles), SPRING + ARCH_RADIUS * np.sin(angles)
    low = np.column_stack([[-BAY / 2, *arc_x, BAY / 2], [SPRING, *arc_z, SPRING]])
    high = np.column_stack([low[:, 0], np.full(len(low), EAVE)])
    front = _upright_sheet(low, high, -WALL_HALF)
    raised = WALL_HALF + 0.03
    outer = 1.075 / ARCH_RADIUS
    rim = np.column_stack([arc_x * outer, SPRING + (arc_z - SPRING) * outer])
    relief = _upright_sheet(np.column_stack([arc_x, arc_z]), rim, -raised)
    rim_edge = _across_sheet(rim, -raised, -WALL_HALF, _arch_uv(rim * [0.99, 1]), inward=False)
    inner = np.column_stack([arc_x, arc_z])
    soffit_uv = _arch_uv(np.column_stack([arc_x * 1.13, SPRING + (arc_z - SPRING) * 1.13]))
    soffit = _across_sheet(inner, -raised, WALL_HALF, soffit_uv, inward=True)
    back = front.moved(pose(yaw_deg=180))
    return Model(f"{side}_arch", f"{side}_arch", join([front, relief, rim_edge, back, soffit]))


def niche_wall(side: str) -> Model:
    """Wall that closes the middle bay of a side behind its banner."""
    low = np.array([[-BAY / 2, STEP], [BAY / 2, STEP]])
    high = np.array([[-BAY / 2, 2.9], [BAY / 2, 2.9]])
    front = _upright_sheet(low, high, -0.06)
    front = Patch(
        front.positions, front.normals, (front.positions[:, [0, 2]] - [0, STEP]) / 3.0, front.faces
    )
    return Model(
        f"{side}_niche_wall", f"{side}_wall", join([front, front.moved(pose(yaw_deg=180))])
    )


def banner(side: str) -> Model:
    """Hanging cloth with soft folds, letters towards the court."""
    x, t = np.meshgrid(np.linspace(-0.75, 0.75, 13), np.linspace(0, 1, 9), indexing="ij")
    z = 2.86 - 1.95 * t
    fold = 0.018 * np.sin(x * 9.0 + 2.0 * t) * t
    uvs = np.stack([x / 1.5 + 0.5, 1 - t], axis=-1)
    points = np.stack([x, -0.27 + fold, z], axis=-1)[:, ::-1]
    front = sheet(points, uvs[:, ::-1])
    swell = np.zeros((*x.shape, 3))
    swell[1:-1, 1:-1, 1] = 0.012  # front and back meet at the hems
    back = sheet(points[::-1] + swell, uvs[::-1, ::-1] * [0.02, 0.02] + [0.0, 0.97])
    return Model(f"{side}_banner", f"{side}_banner", join([front, back]))


def banner_rod() -> Model:
    """Iron rod with two brackets that carries a banner."""
    parts = [bar((-0.86, -0.265, 2.87), (0.86, -0.265, 2.87), 0.018)]
    parts += [bar((x, -0.265, 2.87), (x, -0.19, 2.87), 0.014) for x in (-0.8, 0.8)]
    return Model("banner_rod", "props", in_material("iron", join(parts)))


def kerb(side: str, half: float) -> Model:
    """Limestone step along one side, mitered at the corners."""
    top = _mitered_floor(half, -KERB, KERB, STEP)
    riser = _riser(half - KERB, -KERB, -0.05, STEP)
    return Model(f"{side}_kerb", "ashlar", tile(join([top, riser]), 1.6))


def walk(side: str, half: float, end: float = WALK) -> Model:
    """Clay-tiled floor of the covered walk; an open side gets a riser at its outer edge."""
    parts = [_mitered_floor(half, KERB, end, STEP)]
    if end > WALK:
        parts.append(_riser(half + end, -end, -0.2, STEP).moved(pose(yaw_deg=180)))
    return Model(f"{side}_walk", "terracotta_floor", tile(join(parts), 1.6))


def ceiling(side: str, half: float) -> Model:
    """Board ceiling of the walk and the board under the eave, mitered at the corners."""
    inner, edge = EAVE_EDGE, half + EAVE_EDGE
    corners = [
        (-edge, inner, EAVE),
        (-half - WALK, WALK, EAVE),
        (half + WALK, WALK, EAVE),
        (edge, inner, EAVE),
    ]
    below = polygon(corners)
    fascia = polygon(
        [
            (-edge, inner, EAVE),
            (edge, inner, EAVE),
            (edge, inner, ROOF_FOOT - EAVE_LIP),
            (-edge, inner, ROOF_FOOT - EAVE_LIP),
        ]
    )
    return Model(f"{side}_ceiling", "ceiling_planks", tile(join([below, fascia]), 1.2))


def beam() -> Model:
    """Timber across the walk under the ceiling."""
    size = (0.14, WALK - 0.1, 0.16)
    patch = box(size, (0, (WALK + 0.1) / 2, EAVE - 0.08), without="+z+y-y")
    return Model("ceiling_beam", "props", in_material("dark_oak", patch))


def tiled_slope(
    name: str,
    half: float,
    foot: tuple[float, float],
    head: tuple[float, float],
    flare: float,
    facets: int = 4,
) -> Model:
    """Corrugated roof slope from its foot (y, z) to its head (y, z), rising outwards.

    `flare` 1 miters the ends along 45 degree valleys, 0 cuts them square.  `facets` is how
    many flat strips make one round tile; 0 leaves the slope flat.
    """
    (y0, z0), (y1, z1) = foot, head
    reach = half + max(flare * y1, flare * y0)
    count = max(facets * round(2 * reach * 8 / ROOF_PICTURE[0]), 1)
    x = np.linspace(-reach, reach, count + 1)
    hump = 0.06 * np.sin(np.pi * (np.arange(count + 1) % max(facets, 1)) / max(facets, 1))
    start = np.maximum(y0, (np.abs(x) - half) / flare) if flare else np.full_like(x, y0)
    y = np.stack([start, np.full_like(x, y1)], axis=1)
    rise = (z1 - z0) / (y1 - y0)
    z = z0 + (y - y0) * rise + hump[:, None]
    points = np.stack([np.broadcast_to(x[:, None], y.shape), y, z], axis=-1)
    slope_length = (y - y0) * np.hypot(1, rise)
    uvs = np.stack([points[..., 0] / ROOF_PICTURE[0], slope_length / ROOF_PICTURE[1]], axis=-1)
    at_eave = start <= y0 + 1e-9
    eave_top = points[at_eave, 0][:, [0, 2]]
    eave_low = np.column_stack([eave_top[:, 0], np.full(len(eave_top), z0 - EAVE_LIP)])
    eave = _upright_sheet(eave_low, eave_top, y0)
    eave = tile(
        Patch(eave.positions, eave.normals, eave.positions[:, [0, 2]], eave.faces), ROOF_PICTURE
    )
    parts = [sheet(points, uvs), eave]
    if not flare:
        drop = EAVE_LIP
        under = polygon(
            [
                (-reach, y0, z0 - drop),
                (-reach, y1, z1 - drop),
                (reach, y1, z1 - drop),
                (reach, y0, z0 - drop),
            ]
        )
        parts.append(tile(under, ROOF_PICTURE))
        for end in (-reach, reach):
            side = [(end, y0, z0 - drop), (end, y1, z1 - drop), (end, y1, z1), (end, y0, z0)]
            parts.append(tile(polygon(side if end > 0 else side[::-1]), ROOF_PICTURE))
    return Model(name, "roof_tiles", join(parts))


def valley_gutter() -> Model:
    """Lead gutter under the miter of two lean-to slopes; modeled for the north-east corner."""
    foot, head = EAVE_EDGE, WALK
    wide, low = 0.22, 0.012
    a, b = np.array([foot, foot, ROOF_FOOT - low]), np.array([head, head, ROOF_TOP - low])
    # Each wing of the gutter lies in the plane of the slope above it.
    north = [a, b, b - [wide, 0, 0], a - [wide, 0, 0]]
    east = [a, a - [0, wide, 0], b - [0, wide, 0], b]
    return Model(
        "valley_gutter", "props", in_material("iron", join([polygon(north), polygon(east)]))
    )


def window(shutters: str) -> Model:
    """Casement window with open shutters on a wall at y = 0, sill at z = 0."""
    wide, tall = WINDOW
    stone = [
        box((wide + 0.28, 0.12, 0.14), (0, -0.06, tall + 0.07), without="+y"),
        box((wide + 0.36, 0.18, 0.09), (0, -0.09, -0.045), without="+y"),
        box((0.12, 0.10, tall), (-wide / 2 - 0.06, -0.05, tall / 2), without="+y-z+z"),
        box((0.12, 0.10, tall), (wide / 2 + 0.06, -0.05, tall / 2), without="+y-z+z"),
    ]
    wood = [
        box((0.05, 0.05, tall), (0, -0.04, tall / 2), without="-z+z"),
        box((wide, 0.04, 0.04), (0, -0.04, tall * 0.66), without="-x+x"),
        box((wide, 0.04, 0.04), (0, -0.04, tall * 0.33), without="-x+x"),
    ]
    room = polygon(
        [
            (-wide / 2, -0.01, 0),
            (wide / 2, -0.01, 0),
            (wide / 2, -0.01, tall),
            (-wide / 2, -0.01, tall),
        ]
    )
    parts = [
        *(in_material("limestone", part) for part in stone),
        *(in_material("oak", part) for part in wood),
        in_material("dim_room", room),
    ]
    for x in (-1, 1):
        center = (x * (wide / 2 + 0.36), -0.035, tall / 2)
        parts.append(in_material(shutters, box((0.44, 0.05, tall), center, without="+y")))
    return Model(f"window_{shutters}", "props", join(parts))


def window_pane() -> Model:
    """The glass of a window, a little in front of the dim room."""
    wide, tall = WINDOW
    glass = polygon(
        [
            (-wide / 2, -0.028, 0),
            (wide / 2, -0.028, 0),
            (wide / 2, -0.028, tall),
            (-wide / 2, -0.028, tall),
        ]
    )
    return Model("window_pane", "window_glass", glass)


def door(paint: str) -> Model:
    """Plank door in a stone surround on a wall at y = 0, threshold at z = 0."""
    wide, tall = 1.15, 2.15
    parts = [
        in_material("limestone", part)
        for part in (
            box((0.18, 0.14, tall), (-wide / 2 - 0.09, -0.07, tall / 2), without="+y-z+z"),
            box((0.18, 0.14, tall), (wide / 2 + 0.09, -0.07, tall / 2), without="+y-z+z"),
            box((wide + 0.5, 0.20, 0.20), (0, -0.10, tall + 0.10), without="+y"),
            box((wide + 0.62, 0.26, 0.07), (0, -0.13, tall + 0.235), without="+y"),
            box((wide + 0.3, 0.36, 0.05), (0, -0.18, 0.025), without="+y-z"),
        )
    ]
    for x in (-1, 1):
        leaf = box((wide / 2, 0.05, tall), (x * wide / 4, -0.025, tall / 2), without="+y-x+x")
        parts.append(in_material(paint, leaf))
        for z in (0.35, 1.1, 1.85):
            strap = box((0.46, 0.015, 0.07), (x * 0.32, -0.057, z), without="+y")
            parts.append(in_material("iron", strap))
        handle = ring(0.07, 0.012, 8, 3).moved(pose(x * 0.10, -0.075, 1.02, roll_deg=90))
        parts.append(in_material("iron", handle))
    return Model(f"door_{paint}", "props", join(parts))


def wall_panel(
    start: tuple[float, float],
    end: tuple[float, float],
    top: float,
    gable: float = 0.0,
    under_ceiling: bool = False,
) -> Patch:
    """House wall from the ground to `top`, seen with `start` at the left, `end` at the right.

    The dado is painted along the foot only; the dimmer strip that the texture has under a
    ceiling is used only where there is one.  `gable` adds a triangle above.
    """
    (x0, y0), (x1, y1) = start, end
    length = np.hypot(x1 - x0, y1 - y0)
    pieces = []
    split = 3.12 if under_ceiling else 2.0
    for low, high, v0, v1 in ((-0.1, split, -0.07, (split - STEP) / 3), (split, top, 0.38, 0.72)):
        corners = [(x0, y0, low), (x1, y1, low), (x1, y1, high), (x0, y0, high)]
        uvs = [(0, v0), (length / 3, v0), (length / 3, v1), (0, v1)]
        pieces.append(polygon(corners, uvs))
    if gable:
        tip = ((x0 + x1) / 2, (y0 + y1) / 2, top + gable)
        uvs = [(0, 0.4), (length / 3, 0.4), (length / 6, 0.4 + gable / 3)]
        pieces.append(polygon([(x0, y0, top), (x1, y1, top), tip], uvs))
    return join(pieces)


def _upright_sheet(low: np.ndarray, high: np.ndarray, y: float) -> Patch:
    """Flat surface facing -y between two (x, z) polylines; arch texture coordinates."""
    points = np.stack([low, high], axis=1)
    full = np.stack([points[..., 0], np.full(points.shape[:2], y), points[..., 1]], axis=-1)
    return sheet(full, _arch_uv(points))


def _across_sheet(line: np.ndarray, y0: float, y1: float, uv: np.ndarray, inward: bool) -> Patch:
    """Surface swept through the wall along an (x, z) polyline."""
    rows = [np.column_stack([line[:, 0], np.full(len(line), y), line[:, 1]]) for y in (y0, y1)]
    uvs = np.stack([uv, uv], axis=1)
    points = np.stack(rows, axis=1)
    return sheet(points[::-1], uvs[::-1]) if inward else sheet(points, uvs)


def _arch_uv(points: np.ndarray) -> np.ndarray:
    """Place in the arch front picture of an (x, z) point."""
    return (points - [-BAY / 2, SPRING]) / [BAY, EAVE - SPRING]


def _mitered_floor(half: float, y0: float, y1: float, z: float) -> Patch:
    return polygon(
        [(-half - y0, y0, z), (half + y0, y0, z), (half + y1, y1, z), (-half - y1, y1, z)]
    )


def _riser(reach: float, y: float, low: float, high: float) -> Patch:
    return polygon([(-reach, y, low), (reach, y, low), (reach, y, high), (-reach, y, high)])
