"""Everything outside the cloister: ground, hills, trees, houses, bell tower."""

from __future__ import annotations

import numpy as np

from scenes.courtyard.architecture import EAVE, wall_panel
from scenes.courtyard.materials import in_material
from scenes.courtyard.plants import cypress_shape, olive_shape
from scenes.modeling.geometry import Patch, bar, box, disc, join, lathe, polygon, pose, sheet, tile
from scenes.modeling.stage import Model, Stage

GROUND = -0.08  # below the court's paving, so that the two never fight for the same pixels
RINGS = np.array([0.01, 14, 20, 26, 32, 38, 44, 50, 57, 64, 72, 80])
SECTORS = np.linspace(0, 2 * np.pi, 49)
TOWER_AT = (17.5, 4.5)
# Where trees and houses are kept out: the cloister itself and the road south of the gate.
KEEP_OUT = ((-16.5, 12.5, -11.0, 14.5), (-0.5, 9.5, -60.0, -8.0), (14.0, 21.0, 1.0, 8.0))


def ground_height(x: np.ndarray | float, y: np.ndarray | float) -> np.ndarray:
    """Height of the meadow's mesh: what stands on it must neither float nor sink."""
    radius, angle = np.hypot(x, y), np.arctan2(y, x) % (2 * np.pi)
    row = np.clip(np.searchsorted(RINGS, radius) - 1, 0, len(RINGS) - 2)
    column = np.clip((angle / SECTORS[1]).astype(int), 0, len(SECTORS) - 2)
    t_row = (radius - RINGS[row]) / (RINGS[row + 1] - RINGS[row])
    t_column = angle / SECTORS[1] - column
    table = _rolling_hills(RINGS[:, None], SECTORS[None, :])
    near = table[row, column] * (1 - t_column) + table[row, column + 1] * t_column
    far = table[row + 1, column] * (1 - t_column) + table[row + 1, column + 1] * t_column
    return near * (1 - t_row) + far * t_row


def _rolling_hills(radius: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Flat around the cloister, hills further out."""
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    ramp = np.clip((radius - 26) / 50, 0, 1) ** 1.6
    waves = 5.5 + 2.3 * np.sin(3 * angle + 0.7) + 1.6 * np.sin(5 * angle - 1.1)
    return GROUND + ramp * (waves + 0.8 * np.sin(0.22 * x) * np.sin(0.19 * y + 1))


def ground() -> Model:
    """Meadow out to 80 m."""
    x, y = RINGS[:, None] * np.cos(SECTORS), RINGS[:, None] * np.sin(SECTORS)
    z = _rolling_hills(RINGS[:, None], SECTORS[None, :])
    points = np.stack([x, y, z], axis=-1)
    return Model("meadow", "grass", tile(sheet(points, points[..., :2], wraps=True), 6.0))


def far_hills() -> Model:
    """Blue ridge behind the meadow, all around."""
    angle = np.linspace(0, 2 * np.pi, 91)
    crest = 12 + 4 * np.sin(2 * angle + 1) + 2.5 * np.sin(7 * angle) + 1.5 * np.sin(11 * angle + 2)
    rings = []
    for radius, height in ((76, -1.0 + 0 * angle), (96, 0.8 * crest), (108, crest)):
        rings.append(np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1))
    points = np.stack(rings)
    return Model("far_hills", "far_hills", sheet(points, points[..., :2] / 10, wraps=True))


def road() -> Model:
    """Cobbled road from the south gate into the country, following the ground."""
    y = np.concatenate([[-8.25], np.linspace(-10, -62, 27)])
    middle = 4.4 + 2.5 * np.sin((y + 8.25) * 0.09) * np.clip((-8.25 - y) / 20, 0, 1)
    sides = [
        np.stack([middle + offset, y, ground_height(middle + offset, y) + lift], axis=1)
        for offset, lift in ((1.1, 0.06), (0.0, 0.09), (-1.1, 0.06))
    ]
    points = np.stack(sides, axis=0)
    return Model("road", "cobbles", tile(sheet(points, points[..., :2]), 1.65))


def plant_trees(stage: Stage, rng: np.random.Generator) -> None:
    """Cypresses and olive trees around the cloister; a double row along the road."""
    cypress = Model("field_cypress", "foliage", cypress_shape(rng, 8.8, 0.95, layers=4, around=6))
    olive = Model("olive_tree", "foliage", olive_shape(rng, 3.6, 1.7, cards=19))
    spots = [(4.4 + side * 2.9, y) for y in (-13.0, -18.5, -24.5, -31.0) for side in (-1, 1)]
    for index, (x, y) in enumerate(spots, start=1):
        _plant(stage, f"road_cypress_{index:02}", cypress, x, y, rng)
    counts = {"olive_tree": 0, "field_cypress": 0}
    while sum(counts.values()) < 24:
        angle, radius = rng.uniform(0, 2 * np.pi), rng.uniform(17, 62)
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        if any(x0 < x < x1 and y0 < y < y1 for x0, x1, y0, y1 in KEEP_OUT):
            continue
        model = olive if rng.random() < 0.68 else cypress
        counts[model.name] += 1
        _plant(stage, f"{model.name}_{counts[model.name]:02}", model, x, y, rng)


def build_houses(stage: Stage) -> None:
    """Farmhouses on the hills, small enough to read as far away."""
    walls = {
        side: Model(f"house_{side}", f"{side}_wall", _house_walls())
        for side in ("north", "south", "east")
    }
    roof = Model("house_roof", "roof_tiles", _house_roof())
    spots = [
        (-16, -44, 20, "south"),
        (22, -40, -35, "north"),
        (-3, -54, 5, "east"),
        (34, -22, 60, "south"),
        (-40, -18, -50, "north"),
        (38, 30, 40, "east"),
        (-34, 34, 15, "south"),
        (6, 50, 0, "north"),
    ]
    for index, (x, y, yaw, side) in enumerate(spots, start=1):
        at = pose(x, y, float(ground_height(x, y)) - 0.3, yaw)
        stage.place(f"farmhouse_{index:02}", walls[side], at)
        stage.place(f"farmhouse_{index:02}_roof", roof, at)


def build_tower(stage: Stage, belfry_arch: Model) -> None:
    """Brick bell tower beyond the east wall: something tall against the sky."""
    at = pose(*TOWER_AT, GROUND)
    half, shaft = 1.7, 11.6
    bricks = [box((2 * half, 2 * half, shaft + 0.2), (0, 0, shaft / 2), "-z", courses=True)]
    for sx in (-1, 1):
        for sy in (-1, 1):
            post = (sx * 1.4, sy * 1.4, shaft + 1.6)
            bricks.append(box((0.6, 0.6, 3.2), post, "-z+z", courses=True))
    stage.place("bell_tower", Model("bell_tower", "brick", tile(join(bricks), 1.92)), at)
    stone = [
        box((3.7, 3.7, 0.25), (0, 0, 5.6)),
        box((3.7, 3.7, 0.3), (0, 0, shaft)),
        box((3.9, 3.9, 0.3), (0, 0, shaft + 3.3)),
        box((3.6, 3.6, 1.2), (0, 0, 0.6)),
    ]
    for index in range(4):  # imposts: the arches need something to stand on
        for x in (-0.95, 0.95):
            impost = box((0.36, 0.44, 0.12), (x, 1.4, shaft + 1.74))
            stone.append(impost.moved(pose(yaw_deg=90 * index)))
    stage.place(
        "bell_tower_cornices", Model("bell_tower_cornices", "ashlar", tile(join(stone), 1.6)), at
    )
    lift = shaft + 3.15 - EAVE
    for index in range(4):
        turn = at @ pose(0, 0, lift, 90 * index) @ pose(y=1.4)
        stage.place(f"bell_tower_arch_{index + 1:02}", belfry_arch, turn)
    spire = lathe([(2.75, shaft + 3.42), (0.0, shaft + 6.6)], 4, 180).moved(pose(yaw_deg=45))
    stage.place(
        "bell_tower_roof",
        Model("bell_tower_roof", "roof_tiles", tile(_flat_pyramid(spire), 1.8)),
        at,
    )
    stage.place("bell", _bell(), at @ pose(z=shaft + 1.1))
    stage.place("weather_vane", _weather_vane(), at @ pose(z=shaft + 6.5))
    clock = _tower_clock(half)
    for index, side in enumerate(("east", "north", "west", "south")):
        stage.place(f"tower_clock_{side}", clock, at @ pose(0, 0, 9.2, 90 * index + 90))


def fly_balloon(stage: Stage) -> None:
    """Striped hot-air balloon in the south-west sky."""
    angle = np.linspace(0, np.pi, 11)
    round_part = [(4.6 * np.sin(a), 4.6 * np.cos(a)) for a in angle[:7]]
    profile = [(0.0, -6.5), (0.75, -6.6), (1.0, -6.2), *round_part[::-1]]
    skin = lathe(profile, 20, 180)
    stripes = Patch(skin.positions, skin.normals, skin.uvs / skin.uvs.max(axis=0), skin.faces)
    at = pose(-21, -36, 27, 20)
    stage.place("balloon", Model("balloon", "balloon_stripes", stripes), at)
    basket = [in_material("oak", box((1.3, 1.3, 1.0), (0, 0, -8.6)))]
    for x in (-0.6, 0.6):
        for y in (-0.6, 0.6):
            basket.append(in_material("leather", bar((x, y, -8.1), (x, y, -6.5), 0.03, 4)))
    stage.place("balloon_basket", Model("balloon_basket", "props", join(basket)), at)


def _plant(
    stage: Stage, node: str, model: Model, x: float, y: float, rng: np.random.Generator
) -> None:
    size = rng.uniform(0.8, 1.2)
    stage.place(
        node, model, pose(x, y, float(ground_height(x, y)) - 0.05, rng.uniform(0, 360), size)
    )


def _house_walls() -> Patch:
    x, y, top, gable = 3.6, 2.6, 3.3, 1.35
    corners = [(-x, -y), (x, -y), (x, y), (-x, y)]
    gables = (0, gable, 0, gable)
    return join(wall_panel(corners[i], corners[(i + 1) % 4], top, gables[i]) for i in range(4))


def _house_roof() -> Patch:
    """Gable roof, closed below; the ridge runs along x."""
    x, y, eave, ridge = 3.9, 3.0, 3.15, 4.75
    a, b, c, d = (-x, -y, eave), (x, -y, eave), (x, y, eave), (-x, y, eave)
    left, right = (-x, 0, ridge), (x, 0, ridge)
    faces = ([a, b, right, left], [c, d, left, right], [b, c, right], [d, a, left], [d, c, b, a])
    return tile(join(polygon(face) for face in faces), 2.0)


def _flat_pyramid(spire: Patch) -> Patch:
    corners = spire.positions[spire.faces]
    faces = [polygon(triangle) for triangle in corners]
    base = corners[:, :, :].reshape(-1, 3)
    low = base[np.abs(base[:, 2] - base[:, 2].min()) < 1e-6]
    reach = float(np.abs(low[:, 0]).max())
    z = float(low[0, 2])
    under = polygon(
        [(-reach, -reach, z), (-reach, reach, z), (reach, reach, z), (reach, -reach, z)]
    )
    return join([*faces, under])


def _bell() -> Model:
    body = lathe(
        [
            (0.0, 0.06),
            (0.50, 0.0),
            (0.52, 0.06),
            (0.40, 0.25),
            (0.32, 0.60),
            (0.24, 0.78),
            (0.10, 0.84),
            (0.0, 0.85),
        ],
        16,
        50,
    )
    yoke = bar((-1.5, 0, 1.0), (1.5, 0, 1.0), 0.07)
    hanger = bar((0, 0, 0.8), (0, 0, 1.0), 0.05)
    return Model(
        "bell",
        "props",
        join(
            [
                in_material("bronze", body),
                in_material("dark_oak", yoke),
                in_material("iron", hanger),
            ]
        ),
    )


def _weather_vane() -> Model:
    parts = [bar((0, 0, -0.2), (0, 0, 1.5), 0.03), bar((-0.5, 0, 1.1), (0.5, 0, 1.1), 0.02)]
    parts.append(box((0.3, 0.02, 0.26), (-0.45, 0, 1.1)))
    parts.append(lathe([(0.09, 0.0), (0.0, 0.22)], 6, 180).moved(pose(0.5, 0, 1.1, pitch_deg=90)))
    return Model("weather_vane", "props", in_material("iron", join(parts)))


def _tower_clock(half: float) -> Model:
    """Clock on the -y side of the tower."""
    face = disc(0.85, 0.0, 16)
    unit = Patch(face.positions, face.normals, face.positions[:, :2] / 1.70 + 0.5, face.faces)
    upright = pose(0, -half - 0.05, 0, roll_deg=90)
    frame = lathe([(1.0, -0.05), (1.0, 0.06), (0.96, 0.10), (0.85, 0.10), (0.85, 0.0)], 16, 40)
    parts = [
        in_material("clock", unit).moved(upright),
        in_material("limestone", frame).moved(upright),
    ]
    return Model("tower_clock", "props", join(parts))
