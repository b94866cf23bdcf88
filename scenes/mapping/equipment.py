"""Fittings of kitchen, lab, stores, washroom, server room and stairs.

What stands against a wall has its back in the plane y = 0 and faces -y.
"""

from __future__ import annotations

import numpy as np

from scenes.modeling.geometry import ball, bar, box, disc, join, lathe, polygon, pose, ring, tube
from scenes.modeling.picture_atlas import Atlas
from scenes.modeling.stage import Model


def kitchen_counter(a: Atlas) -> Model:
    """Counter, 2.4 m, with oven, sink and tap."""
    parts = [
        a.block("teal", (2.4, 0.56, 0.76), (0, -0.28, 0.48), "-z"),
        a.block("black", (2.4, 0.50, 0.10), (0, -0.25, 0.05), "-z+z"),
        a.block("grey", (2.44, 0.62, 0.04), (0, -0.31, 0.88)),
        a.picture("oven", 0.56, 0.56, -0.575).shifted(0.6, 0, 0.2),
        a.block("dark_grey", (0.50, 0.44, 0.008), (0.6, -0.31, 0.904), "-z"),
        a.block("steel", (0.56, 0.44, 0.008), (-0.5, -0.31, 0.904), "-z"),
        a.block("dark_grey", (0.40, 0.32, 0.006), (-0.5, -0.33, 0.911), "-z"),
    ]
    for x in (-0.9, -0.3, 1.04):
        parts.append(
            a.block("white", (0.5 if x < 0 else 0.26, 0.016, 0.70), (x, -0.568, 0.49), "+y")
        )
        parts.append(a.block("steel", (0.12, 0.02, 0.012), (x, -0.586, 0.78)))
    tap = tube([(0, 0, 0), (0, 0, 0.24), (0, -0.10, 0.28), (0, -0.16, 0.22)], 0.014, 6)
    parts.append(a.in_material("steel", tap.shifted(-0.5, -0.10, 0.90)))
    for x, y in ((0.48, -0.2), (0.72, -0.2), (0.48, -0.42), (0.72, -0.42)):
        parts.append(a.in_material("black", disc(0.085, 0.912, 14).shifted(x, y)))
    return Model("kitchen_counter", "props", join(parts))


def wall_cupboards(a: Atlas) -> Model:
    """A row of cupboards on a wall, z = 0 at their foot."""
    parts = [a.block("white", (1.8, 0.34, 0.6), (0, -0.17, 0.3))]
    for k in range(4):
        x = (k - 1.5) * 0.45
        parts.append(a.block("yellow", (0.435, 0.016, 0.585), (x, -0.348, 0.3), "+y"))
        parts.append(a.block("steel", (0.10, 0.02, 0.012), (x, -0.366, 0.06)))
    return Model("wall_cupboards", "props", join(parts))


def front_box(a: Atlas, name: str, paint: str, size: tuple[float, float, float]) -> Model:
    """An appliance: a box with a picture for its front."""
    wide, deep, high = size
    body = a.block(paint, size, (0, -deep / 2, high / 2), "-y-z")
    return Model(f"box_{name}", "props", join([body, a.picture(name, wide, high, -deep)]))


def water_cooler(a: Atlas) -> Model:
    """Water cooler with its bottle."""
    bottle = lathe([(0.06, 0.98), (0.13, 1.06), (0.13, 1.34), (0.05, 1.40), (0.0, 1.40)], 14, 50)
    parts = [
        a.block("white", (0.32, 0.32, 0.98), (0, -0.18, 0.49), "-z"),
        a.block("dark_grey", (0.22, 0.01, 0.26), (0, -0.345, 0.72), "+y"),
        a.block("blue", (0.04, 0.03, 0.04), (-0.05, -0.36, 0.80), "+y"),
        a.block("red", (0.04, 0.03, 0.04), (0.05, -0.36, 0.80), "+y"),
        a.in_material("mirror", bottle.shifted(0, -0.18, 0)),
    ]
    return Model("water_cooler", "props", join(parts))


def workbench(a: Atlas) -> Model:
    """Workbench with a vice."""
    parts = [
        a.block("oak", (2.0, 0.72, 0.06), (0, -0.36, 0.87)),
        a.block("oak", (1.86, 0.56, 0.03), (0, -0.36, 0.22)),
        a.block("blue", (0.14, 0.20, 0.14), (-0.7, -0.60, 0.97), "-z"),
        a.block("blue", (0.14, 0.06, 0.14), (-0.7, -0.80, 0.97)),
        a.in_material("steel", bar((-0.7, -0.90, 0.96), (-0.7, -0.70, 0.96), 0.018, 6)),
        a.in_material("steel", bar((-0.78, -0.89, 0.96), (-0.62, -0.89, 0.96), 0.009, 5)),
    ]
    for x in (-0.92, 0.92):
        for y in (-0.06, -0.66):
            parts.append(a.block("oak", (0.09, 0.09, 0.84), (x, y, 0.42), "-z+z"))
    return Model("workbench", "props", join(parts))


def drill_press(a: Atlas) -> Model:
    """Pillar drill on the floor."""
    parts = [
        a.block("green", (0.40, 0.55, 0.08), (0, -0.30, 0.04), "-z"),
        a.in_material("steel", bar((0, -0.15, 0.08), (0, -0.15, 1.60), 0.045, 10)),
        a.block("green", (0.34, 0.36, 0.03), (0, -0.36, 0.90)),
        a.block("green", (0.26, 0.56, 0.30), (0, -0.30, 1.58)),
        a.block("yellow", (0.272, 0.10, 0.04), (0, -0.54, 1.58)),
        a.in_material(
            "steel",
            lathe([(0.0, 1.12), (0.01, 1.2), (0.03, 1.24), (0.05, 1.43)], 10, 60).shifted(0, -0.42),
        ),
    ]
    for k in range(3):
        t = np.radians(120 * k + 40)
        tip = (0.20, -0.34 + 0.18 * np.cos(t), 1.52 + 0.18 * np.sin(t))
        parts.append(a.in_material("black", bar((0.14, -0.34, 1.52), tip, 0.010, 5)))
    return Model("drill_press", "props", join(parts))


def rover(a: Atlas, paint: str) -> Model:
    """Four-wheeled robot, 0.63 m x 0.5 m, nose towards +x, with a mirror camera on a mast."""
    parts = [
        a.block(paint, (0.50, 0.30, 0.16), (0, 0, 0.20)),
        a.block("black", (0.40, 0.34, 0.02), (0, 0, 0.29)),
        a.block("blue", (0.14, 0.15, 0.16), (0.14, 0, 0.38), "-z"),
        a.in_material("black", bar((-0.08, 0, 0.30), (-0.08, 0, 0.62), 0.016, 6)),
        a.in_material(
            "steel",
            lathe([(0.0, 0.60), (0.05, 0.64), (0.06, 0.70), (0.0, 0.71)], 12, 60).shifted(-0.08),
        ),
    ]
    for x in (-0.2, 0.2):
        for s in (-1, 1):
            tire = bar((x, s * 0.16, 0.11), (x, s * 0.25, 0.11), 0.11, 14)
            hub = bar((x, s * 0.245, 0.11), (x, s * 0.255, 0.11), 0.05, 8)
            parts += [a.in_material("black", tire), a.in_material("yellow", hub)]
    return Model(f"rover_{paint}", "props", join(parts))


def metal_shelf(a: Atlas, rng: np.random.Generator, name: str, wide: float = 1.6) -> Model:
    """Open steel shelf with boxes on it."""
    deep, high = 0.5, 2.0
    parts = []
    for x in (-wide / 2 + 0.02, wide / 2 - 0.02):
        for y in (-0.02, -deep + 0.02):
            parts.append(a.block("blue", (0.04, 0.04, high), (x, y, high / 2), "-z"))
    for z in (0.12, 0.72, 1.32, 1.94):
        parts.append(a.block("orange", (wide - 0.08, deep - 0.008, 0.05), (0, -deep / 2, z)))
        if z > 1.9:
            continue
        left = -wide / 2 + 0.08
        while left < wide / 2 - 0.42:
            size = (rng.uniform(0.24, 0.42), rng.uniform(0.30, 0.42), rng.uniform(0.20, 0.46))
            x = left + size[0] / 2
            if rng.random() < 0.85:
                paint = ("cardboard", "cardboard", "teal", "red", "grey", "yellow")[rng.integers(6)]
                middle = (x, -deep / 2, z + 0.025 + size[2] / 2)
                parts.append(a.block(paint, size, middle, "-z"))
                if paint == "cardboard":
                    label = a.picture("label_fragile", 0.16, 0.12, -deep / 2 - size[1] / 2 - 0.002)
                    parts.append(label.shifted(x, 0, z + 0.05))
            left += size[0] + rng.uniform(0.02, 0.10)
    return Model(name, "props", join(parts))


def carton(a: Atlas, wide: float, high: float) -> Model:
    """Closed cardboard box with tape and a label."""
    parts = [
        a.block("cardboard", (wide, wide * 0.8, high), (0, 0, high / 2), "-z"),
        a.block("ivory", (wide + 0.002, 0.05, 0.003), (0, 0, high + 0.0015), "-z"),
        a.picture("label_fragile", 0.2, 0.15, -wide * 0.4 - 0.002).shifted(0, 0, high * 0.4),
    ]
    return Model(f"carton_{round(100 * wide)}_{round(100 * high)}", "props", join(parts))


def barrel(a: Atlas, paint: str) -> Model:
    """Steel drum."""
    body = [(0.0, 0.0), (0.29, 0.0)]
    for z in (0.29, 0.58):
        body += [(0.285, z - 0.02), (0.305, z), (0.285, z + 0.02)]
    body += [(0.285, 0.86), (0.295, 0.88), (0.27, 0.88), (0.27, 0.865), (0.0, 0.865)]
    return Model(f"barrel_{paint}", "props", a.in_material(paint, lathe(body, 18, 50)))


def pallet(a: Atlas) -> Model:
    """Wooden pallet, 1.2 m x 0.8 m."""
    parts = []
    for y in np.linspace(-0.35, 0.35, 6):
        parts.append(a.block("crate_wood", (1.2, 0.09, 0.022), (0, y, 0.133)))
    for x in (-0.55, 0.0, 0.55):
        parts.append(a.block("crate_wood", (0.10, 0.78, 0.122), (x, 0, 0.061), "-z"))
    return Model("pallet", "props", join(parts))


def server_rack(a: Atlas) -> Model:
    """Rack, 0.6 m x 0.9 m x 2 m."""
    body = a.block("black", (0.6, 0.9, 2.0), (0, -0.45, 1.0), "-z")
    front = a.picture("server", 0.56, 1.9, -0.904).shifted(z=0.06)
    return Model("server_rack", "props", join([body, front]))


def cable_tray(a: Atlas, length: float) -> Model:
    """Tray with cables under the ceiling, along x, z = 0 its lower side."""
    parts = [a.block("steel", (length, 0.30, 0.02), (0, 0, 0.01))]
    for y in (-0.15, 0.15):
        parts.append(a.block("steel", (length, 0.012, 0.08), (0, y, 0.05)))
    for k, paint in enumerate(("black", "blue", "yellow", "black")):
        y = -0.09 + 0.06 * k
        cable = bar((-length / 2, y, 0.045), (length / 2, y, 0.045), 0.024, 6)
        parts.append(a.in_material(paint, cable))
    return Model(f"cable_tray_{round(100 * length)}", "props", join(parts))


def pipes(a: Atlas, length: float) -> Model:
    """Two pipes and a duct under the ceiling, along x, z = 0 the ceiling."""
    duct = a.in_material(
        "steel", bar((-length / 2, 0.3, -0.24), (length / 2, 0.3, -0.24), 0.18, 14)
    )
    parts = [duct]
    for y, radius, paint in ((-0.10, 0.05, "red"), (-0.28, 0.035, "green")):
        parts.append(
            a.in_material(paint, bar((-length / 2, y, -0.14), (length / 2, y, -0.14), radius, 8))
        )
    for x in np.linspace(-length / 2 + 0.4, length / 2 - 0.4, 4):
        parts.append(
            a.in_material(
                "black", ring(0.19, 0.012, 16, 4).moved(pose(x, 0.3, -0.24, pitch_deg=90))
            )
        )
        parts.append(a.block("black", (0.04, 0.9, 0.03), (x, 0, -0.035)))
    return Model("pipes", "props", join(parts))


def lift_front(a: Atlas) -> Model:
    """Closed lift doors in a steel frame, with a call button."""
    parts = [
        a.picture("lift", 1.1, 2.1, -0.03),
        a.block("dark_grey", (0.14, 0.06, 2.24), (-0.62, -0.03, 1.12), "+y-z"),
        a.block("dark_grey", (0.14, 0.06, 2.24), (0.62, -0.03, 1.12), "+y-z"),
        a.block("dark_grey", (1.10, 0.06, 0.14), (0, -0.03, 2.17), "+y-x+x"),
        a.block("steel", (0.12, 0.015, 0.24), (0.86, -0.0075, 1.1), "+y"),
        a.block("yellow", (0.05, 0.012, 0.05), (0.86, -0.020, 1.14), "+y"),
        a.picture("sign_one", 0.2, 0.2, -0.066).shifted(0, 0, 2.28),
        a.block("black", (0.24, 0.06, 0.24), (0, -0.03, 2.38), "+y"),
    ]
    return Model("lift", "props", join(parts))


def stairs(a: Atlas, steps: int, going: float, rise: float, wide: float) -> Model:
    """Solid flight that climbs along +x from x = 0, wall at y = 0, open side at -y."""
    parts = []
    for k in range(steps):
        size = (going, wide, rise * (k + 1))
        middle = (going * (k + 0.5), -wide / 2, size[2] / 2)
        parts.append(a.block("concrete", size, middle, "-x+x-z+y+z"))
        tread = (going + 0.02, wide + 0.012, 0.03)
        parts.append(
            a.block("grey", tread, (middle[0] - 0.01, -wide / 2 - 0.006, size[2] - 0.015), "+x+y")
        )
        riser = (0.01, wide, rise)
        parts.append(
            a.block(
                "concrete", riser, (going * k + 0.005, -wide / 2, size[2] - rise / 2), "+x-z+z-y+y"
            )
        )
        nosing = (0.03, wide, 0.004)
        parts.append(
            a.block("yellow", nosing, (going * k + 0.01, -wide / 2, size[2] + 0.002), "-z+y")
        )
    return Model("stairs", "props", join(parts))


def handrail(a: Atlas, run: float, climb: float) -> Model:
    """Railing along a flight, from its foot at the origin."""
    parts = [
        a.in_material(
            "red", tube([(-0.1, 0, 0.92), (0, 0, 0.95), (run, 0, 0.95 + climb)], 0.024, 8)
        )
    ]
    for t in np.linspace(0.03, 0.97, 9):
        foot = (run * t, 0, climb * t)
        parts.append(
            a.in_material("dark_grey", bar(foot, (run * t, 0, 0.95 + climb * t), 0.012, 5))
        )
    return Model("handrail", "props", join(parts))


def washbasin(a: Atlas) -> Model:
    """Basin on a wall, with tap and mirror; z = 0 is the floor."""
    bowl = lathe(
        [
            (0.0, 0.62),
            (0.08, 0.62),
            (0.22, 0.78),
            (0.24, 0.86),
            (0.21, 0.86),
            (0.06, 0.72),
            (0.0, 0.72),
        ],
        16,
        50,
    )
    parts = [
        a.in_material("porcelain", bowl.moved(pose(0, -0.25, 0, scale=(1.15, 1.0, 1.0)))),
        a.block("porcelain", (0.5, 0.12, 0.10), (0, -0.06, 0.80)),
        a.block("porcelain", (0.16, 0.16, 0.66), (0, -0.12, 0.33), "-z"),
        a.in_material(
            "steel", tube([(0, -0.06, 0.86), (0, -0.07, 0.98), (0, -0.19, 0.98)], 0.013, 6)
        ),
        a.block("steel", (0.62, 0.012, 0.82), (0, -0.006, 1.56), "+y"),
        a.block("mirror", (0.58, 0.006, 0.78), (0, -0.015, 1.56), "+y"),
    ]
    return Model("washbasin", "props", join(parts))


def toilet(a: Atlas) -> Model:
    """Toilet with cistern."""
    bowl = lathe([(0.12, 0.0), (0.13, 0.10), (0.20, 0.34), (0.21, 0.40), (0.0, 0.405)], 14, 50)
    parts = [
        a.in_material("porcelain", bowl.moved(pose(0, -0.42, 0, scale=(0.9, 1.2, 1.0)))),
        a.in_material(
            "black", disc(0.19, 0.41, 14).moved(pose(0, -0.42, 0, scale=(0.9, 1.2, 1.0)))
        ),
        a.block("porcelain", (0.38, 0.17, 0.36), (0, -0.085, 0.60)),
        a.block("steel", (0.06, 0.04, 0.01), (0, -0.085, 0.785), "-z"),
    ]
    return Model("toilet", "props", join(parts))


def cubicle_wall(a: Atlas, length: float) -> Model:
    """Partition on feet, along -y from the wall."""
    parts = [
        a.block("orange", (0.03, length, 1.85), (0, -length / 2, 1.075), "+y"),
        a.in_material("steel", bar((0, -length + 0.05, 0), (0, -length + 0.05, 0.16), 0.02, 6)),
        a.in_material("steel", bar((0, -length / 2, 0), (0, -length / 2, 0.16), 0.02, 6)),
    ]
    return Model(f"cubicle_wall_{round(100 * length)}", "props", join(parts))


def bed(a: Atlas) -> Model:
    """Examination bed, head at the wall."""
    parts = [
        a.block("fabric_green", (0.7, 1.9, 0.12), (0, -0.95, 0.66)),
        a.block("white", (0.6, 0.40, 0.08)).moved(pose(0, -0.26, 0.75, roll_deg=-10)),
        a.block("white", (0.72, 0.9, 0.02), (0, -1.40, 0.728)),
        a.block("steel", (0.62, 1.8, 0.03), (0, -0.95, 0.585)),
    ]
    for x in (-0.28, 0.28):
        for y in (-0.12, -1.78):
            parts.append(a.in_material("steel", bar((x, y, 0), (x, y, 0.58), 0.02, 6)))
    return Model("bed", "props", join(parts))


def folding_screen(a: Atlas) -> Model:
    """Three-winged cloth screen along x."""
    parts = []
    for k, (x, yaw) in enumerate(((-0.62, 24), (0.0, -24), (0.62, 24))):
        wing = [a.block("white", (0.66, 0.012, 1.36), (0, 0, 0.95))]
        for s in (-1, 1):
            wing.append(
                a.in_material("teal", bar((s * 0.34, 0, 0.0), (s * 0.34, 0, 1.66), 0.014, 5))
            )
        for z in (0.25, 1.65):
            wing.append(a.in_material("teal", bar((-0.34, 0, z), (0.34, 0, z), 0.012, 5)))
        parts.append(join(wing).moved(pose(x, 0.002 * k, 0, yaw)))
    return Model("folding_screen", "props", join(parts))


def medicine_cabinet(a: Atlas) -> Model:
    """White box with a green cross on a wall, z = 0 its foot."""
    parts = [
        a.block("white", (0.6, 0.22, 0.7), (0, -0.11, 0.35)),
        a.block("green", (0.30, 0.006, 0.10), (0, -0.223, 0.35), "+y"),
        a.block("green", (0.10, 0.006, 0.10), (0, -0.223, 0.45), "+y"),
        a.block("green", (0.10, 0.006, 0.10), (0, -0.223, 0.25), "+y"),
    ]
    return Model("medicine_cabinet", "props", join(parts))


def globe(a: Atlas) -> Model:
    """Globe on a stand."""
    parts = [
        a.in_material("blue", ball(0.24, 10, 16).moved(pose(0, 0, 0.92, roll_deg=23))),
        a.in_material("walnut", ring(0.28, 0.014, 24, 5).moved(pose(0, 0, 0.92, roll_deg=90))),
        a.in_material("walnut", bar((0, 0, 0.04), (0, 0, 0.64), 0.025, 8)),
        a.in_material("walnut", lathe([(0.22, 0.0), (0.22, 0.03), (0.03, 0.06)], 14, 40)),
    ]
    for x, z, size in ((0.18, 1.0, 0.11), (-0.16, 0.88, 0.12), (0.02, 1.05, 0.09)):
        land = ball(1.0, 5, 8).moved(pose(x, -0.13, z, scale=(size, 0.085, size)))
        parts.append(a.in_material("green", land))
    return Model("globe", "props", join(parts))


def gas_bottles(a: Atlas) -> Model:
    """Three gas bottles chained to a wall."""
    parts = []
    for x, paint in ((-0.28, "green"), (0.0, "red"), (0.28, "grey")):
        bottle = lathe(
            [(0.11, 0.0), (0.115, 0.05), (0.115, 1.2), (0.05, 1.36), (0.05, 1.5), (0.0, 1.5)],
            12,
            50,
        )
        parts.append(a.in_material(paint, bottle.shifted(x, -0.14, 0)))
    parts.append(a.block("steel", (0.94, 0.015, 0.05), (0, -0.265, 0.9)))
    for s in (-1, 1):
        parts.append(a.block("steel", (0.015, 0.26, 0.05), (s * 0.462, -0.13, 0.9), "+y"))
    return Model("gas_bottles", "props", join(parts))


def ceiling_lamp(wide: float, long: float, is_on: bool) -> tuple[Model, Model]:
    """Panel lamp under the ceiling, z = 0: its housing, and the panel."""
    name = f"{round(100 * wide)}_{round(100 * long)}"
    housing = box((wide + 0.05, long + 0.05, 0.05), (0, 0, -0.025), "+z-z")
    half_x, half_y, z = wide / 2 + 0.025, long / 2 + 0.025, -0.05
    glow = polygon(
        [(-half_x, -half_y, z), (-half_x, half_y, z), (half_x, half_y, z), (half_x, -half_y, z)]
    )
    return (
        Model(f"lamp_housing_{name}", "lamp_housing", housing),
        Model(f"lamp_{name}", "lamp_white", glow)
        if is_on
        else Model(f"lamp_off_{name}", "lamp_off", glow),
    )
