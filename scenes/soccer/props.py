"""Props: books, boxes, coats, plants, cables, robots."""

from __future__ import annotations

import numpy as np

from scenes.modeling.geometry import ball, bar, box, join, lathe, polygon, pose, tube
from scenes.modeling.stage import Model
from scenes.soccer.furniture import cushion
from scenes.soccer.materials import painted_in


def books(name: str, width: float, rng: np.random.Generator) -> Model:
    """Upright books of many colors from x = 0 to at most `width`, the last ones leaning."""
    hues = (
        "navy", "wine", "bottle", "cream", "straw", "denim", "brick", "paper", "black", "slate",
        "mustard", "plum", "moss", "rose", "teal", "light_grey", "orange", "pale_blue", "red",
    )  # fmt: skip
    parts, x = [], 0.0
    while True:
        thick, tall, deep = (
            rng.uniform(0.018, 0.055),
            rng.uniform(0.19, 0.30),
            rng.uniform(0.15, 0.22),
        )
        if x + thick > width - 0.08:
            break
        spine = box((thick - 0.001, deep, tall), (x + thick / 2, -0.27 + deep / 2, tall / 2), "-z")
        parts.append(painted_in(hues[rng.integers(len(hues))], spine))
        x += thick
    leaning = box((0.03, 0.18, 0.25), (0.015, -0.18, 0.125)).moved(
        pose(x + 0.065, 0, 0.006, pitch_deg=-14)
    )
    parts.append(painted_in("khaki", leaning))
    return Model(name, "paints", join(parts))


def binders(name: str, count: int, hue: str) -> Model:
    """A row of files with labels and finger holes, from x = 0."""
    parts = []
    for index in range(count):
        x = 0.08 * index + 0.04
        parts.append(painted_in(hue, box((0.077, 0.26, 0.31), (x, -0.15, 0.155), "-z")))
        parts.append(painted_in("paper", box((0.05, 0.002, 0.12), (x, -0.281, 0.20), "+y")))
        parts.append(painted_in("black", bar((x, -0.282, 0.07), (x, -0.280, 0.07), 0.013, 8)))
    return Model(name, "paints", join(parts))


def cardboard_box(name: str, size: tuple[float, float, float], hue: str = "cardboard") -> Model:
    """A box with tape over its lid, standing on z = 0."""
    x, y, z = size
    parts = [painted_in(hue, box(size, (0, 0, z / 2), "-z"))]
    parts.append(painted_in("sand", box((x + 0.002, 0.05, 0.002), (0, 0, z + 0.001), "-z")))
    for side in (-1, 1):
        tape = box((0.002, 0.05, 0.08), (side * (x / 2 + 0.001), 0, z - 0.04))
        parts.append(painted_in("sand", tape))
    parts.append(
        painted_in(
            "paper", box((0.3 * x, 0.002, 0.3 * z), (0.2 * x, -y / 2 - 0.001, 0.5 * z), "+y")
        )
    )
    return Model(name, "paints", join(parts))


def folder(hue: str) -> Model:
    """A thin folder lying flat."""
    parts = [
        painted_in(hue, box((0.23, 0.32, 0.012), (0, 0, 0.006), "-z")),
        painted_in("paper", box((0.21, 0.30, 0.004), (0.012, 0, 0.014), "-z")),
    ]
    return Model(f"folder_{hue}", "paints", join(parts))


def coat(hue: str, length: float) -> Model:
    """A coat hanging from its collar at z = 0."""
    profile = [
        (0.0, -length),
        (0.24, -length),
        (0.25, -0.8 * length),
        (0.20, -0.4 * length),
        (0.22, -0.22),
        (0.19, -0.10),
        (0.07, -0.02),
        (0.0, 0.02),
    ]
    body = lathe(profile, 18, crease_deg=75).moved(pose(scale=(1.0, 0.42, 1.0)))
    wave = 1 + 0.10 * np.sin(5 * np.arctan2(body.positions[:, 1], body.positions[:, 0]))
    wave = 1 + (wave - 1) * np.clip(-body.positions[:, 2] / length, 0, 1)
    body.positions[:, :2] *= wave[:, None]
    sleeves = [
        tube(
            [(s * 0.17, -0.02, -0.14), (s * 0.25, -0.05, -0.4), (s * 0.24, -0.06, -0.68)], 0.055, 8
        )
        for s in (-1, 1)
    ]
    return Model(f"coat_{hue}", "paints", painted_in(hue, join([body, *sleeves])))


def umbrella_stand() -> Model:
    """A tin with two umbrellas."""
    tin = lathe(
        [(0.0, 0.01), (0.12, 0.01), (0.12, 0.5), (0.11, 0.5), (0.11, 0.03), (0.0, 0.03)], 18
    )
    parts = [painted_in("steel", tin)]
    for x, hue, lean in ((-0.03, "navy", 5), (0.03, "red", -6)):
        shaft = join(
            [
                lathe([(0.0, 0.05), (0.03, 0.25), (0.04, 0.55), (0.01, 0.72)], 8),
                bar((0, 0, 0.7), (0, 0, 0.88), 0.01, 6),
            ]
        )
        parts.append(painted_in(hue, shaft.moved(pose(x, 0, 0, pitch_deg=lean))))
    return Model("umbrella_stand", "paints", join(parts))


def bin_with_paper(rng: np.random.Generator) -> Model:
    """A rubbish bin, half full."""
    wall = lathe(
        [
            (0.0, 0.0),
            (0.13, 0.0),
            (0.17, 0.34),
            (0.175, 0.36),
            (0.16, 0.36),
            (0.13, 0.12),
            (0.0, 0.12),
        ],
        20,
    )
    parts = [painted_in("dark_grey", wall)]
    for index in range(6):
        x, y, z = rng.uniform(-0.07, 0.07), rng.uniform(-0.07, 0.07), 0.20 + 0.025 * index
        crumple = ball(0.055, 4, 6).moved(pose(x, y, z, rng.uniform(0, 90), roll_deg=30))
        parts.append(painted_in("paper" if index % 3 else "straw", crumple))
    return Model("bin", "paints", join(parts))


def ladder() -> Model:
    """Leans on the wall at y = 0: foot 0.75 m away, head at 2.6 m."""
    foot, head = np.array([0, -0.75, 0.0]), np.array([0, -0.04, 2.6])
    parts = []
    for x in (-0.21, 0.21):
        parts.append(bar(foot + [x, 0, 0.02], head + [x, 0, 0], 0.024, 8))
    for step in np.linspace(0.1, 0.92, 9):
        middle = foot + (head - foot) * step
        parts.append(bar(middle - [0.21, 0, 0], middle + [0.21, 0, 0], 0.016, 8))
    return Model("ladder", "paints", painted_in("steel", join(parts)))


def tripod() -> Model:
    """A camera on a tripod."""
    legs = []
    for index in range(3):
        a = np.radians(120 * index + 30)
        legs.append(
            bar(
                (0.02 * np.cos(a), 0.02 * np.sin(a), 1.15),
                (0.38 * np.cos(a), 0.38 * np.sin(a), 0.0),
                0.014,
                7,
            )
        )
    legs.append(bar((0, 0, 0.9), (0, 0, 1.32), 0.016, 8))
    camera = [
        box((0.13, 0.08, 0.1), (0, 0, 1.37)),
        bar((0, 0.04, 1.37), (0, 0.12, 1.37), 0.035, 14),
    ]
    return Model(
        "tripod",
        "paints",
        join([painted_in("mid_grey", join(legs)), painted_in("black", join(camera))]),
    )


def toolbox() -> Model:
    """A red box with a handle."""
    case = painted_in("red", box((0.42, 0.2, 0.18), (0, 0, 0.09), "-z"))
    lid = painted_in("brick", box((0.43, 0.21, 0.03), (0, 0, 0.195)))
    handle = painted_in(
        "black", tube([(-0.1, 0, 0.21), (-0.1, 0, 0.26), (0.1, 0, 0.26), (0.1, 0, 0.21)], 0.01, 6)
    )
    return Model("toolbox", "paints", join([case, lid, handle]))


def robot_dog() -> Model:
    """A four-legged robot of the league, standing on z = 0, facing +x."""
    shell = [
        cushion(0.19, 0.11, 0.09).shifted(z=0.15),
        cushion(0.10, 0.08, 0.08).moved(pose(0.15, 0, 0.21, pitch_deg=15)),
    ]
    joints = [
        bar((0.09, 0, 0.17), (0.14, 0, 0.20), 0.02, 8),
        tube([(-0.09, 0, 0.18), (-0.13, 0, 0.22), (-0.14, 0, 0.26)], 0.008, 6),
    ]
    for x in (-0.07, 0.08):
        for y in (-0.06, 0.06):
            shell.append(tube([(x, y, 0.15), (x - 0.03, y, 0.08), (x + 0.01, y, 0.012)], 0.02, 8))
            joints.append(ball(0.025, 5, 8).shifted(x, y, 0.15))
    joints += [box((0.012, 0.05, 0.025), (0.203, 0, 0.205))]
    return Model(
        "robot_dog",
        "paints",
        join([painted_in("white_board", join(shell)), painted_in("dark_grey", join(joints))]),
    )


def ball_of_the_league() -> Model:
    """The orange ball, on z = 0."""
    return Model("ball", "paints", painted_in("orange", ball(0.045, 10, 16).shifted(z=0.045)))


def plant_pot(radius: float, hue: str) -> Model:
    """Pot with soil."""
    high = 1.7 * radius
    wall = lathe(
        [
            (0.0, 0.0),
            (0.7 * radius, 0.0),
            (radius, 0.92 * high),
            (radius, high),
            (0.9 * radius, high),
            (0.88 * radius, 0.9 * high),
        ],
        16,
    )
    soil = lathe([(0.9 * radius, 0.91 * high), (0.0, 0.92 * high)], 16)
    return Model(
        f"plant_pot_{hue}_{round(100 * radius)}",
        "paints",
        join([painted_in(hue, wall), painted_in("soil", soil)]),
    )


def leaves(name: str, count: int, length: float, stem: float, rng: np.random.Generator) -> Model:
    """Arching leaves round a stem of height `stem`, each a strip of three quads."""
    parts = []
    for index in range(count):
        turn = 137.5 * index
        height = stem * (0.25 + 0.75 * index / count)
        rise = np.radians(rng.uniform(25, 75))
        size = length * rng.uniform(0.75, 1.0)
        t = np.linspace(0, 1, 4)
        out = size * t * np.cos(rise)
        up = height + size * (t * np.sin(rise) - 0.55 * t**2)
        half = 0.16 * size
        for k in range(3):
            corners = [
                (out[k], -half, up[k]),
                (out[k + 1], -half, up[k + 1]),
                (out[k + 1], half, up[k + 1]),
                (out[k], half, up[k]),
            ]
            uvs = [(0, t[k]), (0, t[k + 1]), (1, t[k + 1]), (1, t[k])]
            parts.append(polygon(corners, uvs).moved(pose(yaw_deg=turn)))
    return Model(name, "leaves", join(parts))


def plant_stem(name: str, height: float) -> Model:
    """The stem that `leaves` grow from."""
    return Model(name, "paints", painted_in("olive", bar((0, 0, 0), (0, 0, height), 0.012, 6)))


def floor_cable(name: str, path: list[tuple[float, float]]) -> Model:
    """A cable on the floor, rounded at its bends."""
    line = np.array(path, float)
    for _ in range(3):  # Chaikin's corner cutting
        near, far = 0.75 * line[:-1] + 0.25 * line[1:], 0.25 * line[:-1] + 0.75 * line[1:]
        line = np.concatenate([line[:1], np.stack([near, far], 1).reshape(-1, 2), line[-1:]])
    points = np.column_stack([line, np.full(len(line), 0.007)])
    return Model(name, "paints", painted_in("black", tube(points, 0.007, 5)))


def power_strip() -> Model:
    """Six sockets on the floor."""
    parts = [painted_in("paper", box((0.4, 0.06, 0.045), (0, 0, 0.0225), "-z"))]
    parts += [
        painted_in("mid_grey", bar((x, 0, 0.045), (x, 0, 0.047), 0.019, 10))
        for x in np.linspace(-0.15, 0.15, 6)
    ]
    return Model("power_strip", "paints", join(parts))


def rucksack() -> Model:
    """A rucksack on the floor."""
    body = cushion(0.3, 0.2, 0.44).shifted(z=0.22)
    pocket = cushion(0.24, 0.08, 0.2).shifted(y=-0.11, z=0.16)
    return Model(
        "rucksack", "paints", join([painted_in("petrol", body), painted_in("teal", pocket)])
    )
