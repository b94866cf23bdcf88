"""Build p2at.glb: python -m scenes.p2at.build.

Base frame: x forward, y left, z up, meters; the origin is on the ground between the wheels.
The same code always writes the same bytes.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np

from scenes.modeling import omnidirectional_camera, robot_parts
from scenes.modeling.geometry import Patch, bar, join, pose, tube
from scenes.modeling.palette import Label, Palette
from scenes.modeling.prisms import block, inset_outline, prism
from scenes.modeling.robot_files import read_robot
from scenes.modeling.robot_parts import cylinder, facing
from scenes.modeling.stage import Model, Stage
from scenes.p2at import laser_scanner
from scenes.p2at.wheel import outwards, wheel

OUTPUT = Path(__file__).with_name("p2at.glb")
WHEELBASE = 0.300
DECK = 0.240  # upper side of the top plate
PLATE = 0.008
PLATE_HALF_WIDTH = 0.172
BELLY = 0.062
SONAR_BAND = (0.176, DECK - PLATE)
FACET = 0.052  # width of a sonar's facet
FACETS_DEG = (10, 30, 50)  # left of the middle; one more faces to the side
OVERHANG = 0.005  # of the top plate over the sonars' facets
LMS_PLATE = 0.005
WHITE, RED, BLACK = (0.93, 0.93, 0.91), (0.80, 0.085, 0.07), (0.115, 0.115, 0.12)
PALETTE = Palette(
    {
        "red": RED,
        "black": BLACK,
        "charcoal": (0.22, 0.22, 0.23),
        "white": WHITE,
        "rim": (0.84, 0.84, 0.81),
        **robot_parts.COLORS,
        **omnidirectional_camera.COLORS,
        **laser_scanner.COLORS,
    },
    {"pioneer": Label("PIONEER", 4.8, RED, WHITE, 0.68), **laser_scanner.LABELS},
)


def main() -> None:
    """Build the robot and print its size."""
    robot, sensors, mirror = read_robot(Path(__file__).parent)
    stage = Stage(
        "p2at", {"paint": PALETTE.material("paint"), "glass": omnidirectional_camera.GLASS}
    )
    parts = {
        "body": body(),
        "top_plate": top_plate(),
        "sonar_front": sonar_array(),
        "sonar_rear": sonar_array().moved(pose(yaw_deg=180)),
        "user_panel": user_panel(),
        "emergency_stop": robot_parts.emergency_stop(PALETTE).shifted(-0.225, 0.0, DECK),
        "antenna": robot_parts.antenna(PALETTE, 0.150).shifted(-0.170, 0.130, DECK),
        "lms200": laser_scanner.laser_scanner(PALETTE).shifted(*sensors["lms200"]["position_m"]),
        "lms200_mount": laser_mount(sensors["lms200"]["position_m"]),
    }
    for name, patch in parts.items():
        stage.place(name, Model(name, "paint", patch))
    kinematics = robot["kinematics"]
    diameter, track = kinematics["wheel_diameter_m"], kinematics["track_m"]
    model = Model("wheel", "paint", wheel(PALETTE, diameter))
    for end, x in (("front", WHEELBASE / 2), ("rear", -WHEELBASE / 2)):
        for name, side in (("left", 1), ("right", -1)):
            at = pose(x, side * track / 2, diameter / 2) @ outwards(side)
            stage.place(f"wheel_{end}_{name}", model, at)
    omnidirectional_camera.place_camera(
        stage, PALETTE, mirror, sensors["omnicam"]["position_m"], DECK
    )
    size = stage.write(OUTPUT)
    print(f"{OUTPUT.name}: {size} bytes, {stage.triangle_count()} triangles")


def nose() -> np.ndarray:
    """Left half of the sonars' facets from above: corners (x, y) from the middle to the side."""
    tip = 0.626 / 2 - OVERHANG / np.cos(np.radians(FACETS_DEG[0]))
    corners = [(tip, 0.0)]
    for angle in np.radians(FACETS_DEG):
        x, y = corners[-1]
        corners.append((x - FACET * np.sin(angle), y + FACET * np.cos(angle)))
    return np.array(corners)


def plate_outline() -> np.ndarray:
    """The top plate from above: over the facets by `OVERHANG`, wider between the ends."""
    front = nose()
    array = np.concatenate([front[:0:-1] * (1, -1), front])
    closed = np.concatenate([[(0.0, array[0, 1])], array, [(0.0, array[-1, 1])]])
    # without the two corners at x = 0, which only close it
    front = inset_outline(closed, -OVERHANG)[1:-1]
    shoulder = np.array([(0.180, -PLATE_HALF_WIDTH), (0.180, PLATE_HALF_WIDTH)])
    half = np.concatenate([shoulder[:1], front, shoulder[1:]])
    return np.concatenate([half, -half])


def top_plate() -> Patch:
    """Black plate with its hinge, bolts and two handles."""
    plate = prism(
        plate_outline(),
        [(DECK - PLATE, 0.001), (DECK - PLATE + 0.001, 0.0), (DECK - 0.001, 0.0), (DECK, 0.001)],
    )
    hinge = bar((0.030, -0.150, DECK), (0.030, 0.150, DECK), 0.004, 8)
    bolts = [
        cylinder(0.004, 0.003, 6).shifted(x, y, DECK - 0.001)
        for x, y in (
            *((x, side * 0.160) for x in (-0.165, -0.055, 0.055, 0.165) for side in (-1, 1)),
            *((end * 0.285, side * 0.045) for end in (-1, 1) for side in (-1, 1)),
        )
    ]
    vents = [
        block((0.004, 0.070, 0.003), (x, -0.085, DECK), 0.001)
        for x in np.arange(-0.020, 0.012, 0.009)
    ]
    grip = robot_parts.handle(0.100, 0.026).moved(pose(-0.285, 0, DECK, yaw_deg=90))
    return join(
        [
            PALETTE.paint("black", plate),
            PALETTE.paint("charcoal", hinge, *vents),
            PALETTE.paint("silver", *bolts, grip),
        ]
    )


def body() -> Patch:
    """Red tub and middle part, axles, the doors at both ends, a label on each side."""
    tub = prism(
        plate_outline(),
        [(BELLY, 0.050), (0.098, 0.024), (0.172, 0.022), (SONAR_BAND[0] + 0.001, 0.026)],
    )
    middle = block((0.392, 0.300, DECK - 0.001 - 0.170), (0, 0, (0.170 + DECK - 0.001) / 2))
    axles = [
        bar((x, -0.190, 0.110), (x, 0.190, 0.110), 0.014, 12)
        for x in (-WHEELBASE / 2, WHEELBASE / 2)
    ]
    labels = [
        PALETTE.label("pioneer", 0.026, "white").moved(
            pose(0, side * 0.1515, 0.205, yaw_deg=90 * side)
        )
        for side in (-1, 1)
    ]
    doors = [
        PALETTE.paint("black", block((0.020, 0.110, 0.048), (x, 0, 0.136))) for x in (-0.284, 0.284)
    ]
    catches = [
        PALETTE.paint("white", cylinder(0.007, 0.004, 12).moved(facing(0)).shifted(x, y, 0.136))
        for x in (0.292, -0.296)
        for y in (-0.04, 0.04)
    ]
    return join(
        [
            PALETTE.paint("red", tub, middle),
            PALETTE.paint("charcoal", *axles),
            *labels,
            *doors,
            *catches,
        ]
    )


def sonar_array() -> Patch:
    """Eight sonars on the facets of the nose, from one side round to the other."""
    front = nose()
    side_x = front[-1, 0] - FACET
    corners = np.concatenate([front, [(side_x, front[-1, 1])]])
    outline = np.concatenate([corners[:0:-1] * (1, -1), corners])
    bottom, top = SONAR_BAND
    parts = [
        PALETTE.paint("black", prism(outline, [(bottom, 0.002), (bottom + 0.002, 0), (top, 0)]))
    ]
    height = (bottom + top) / 2
    for (start, end), angle in zip(itertools.pairwise(corners), (*FACETS_DEG, 90), strict=True):
        x, y = (start + end) / 2
        for sign in (-1, 1):
            at = pose(x, sign * y, height) @ facing(sign * angle)
            parts.append(robot_parts.sonar(PALETTE).moved(at))
    return join(parts)


def user_panel() -> Patch:
    """Switches and lamps at the right of the rear deck."""
    panel = block((0.110, 0.060, 0.006), (-0.165, -0.115, DECK + 0.002), 0.001)
    top = DECK + 0.005
    parts = [PALETTE.paint("white", panel)]
    for x, color, radius in (
        (-0.205, "button_red", 0.007),
        (-0.185, "charcoal", 0.007),
        (-0.165, "charcoal", 0.007),
    ):
        parts.append(PALETTE.paint(color, cylinder(radius, 0.007, 12).shifted(x, -0.105, top)))
    for x, color in ((-0.205, "green"), (-0.190, "yellow"), (-0.175, "button_red")):
        parts.append(PALETTE.paint(color, cylinder(0.003, 0.002, 8).shifted(x, -0.130, top)))
    socket = block((0.030, 0.014, 0.008), (-0.133, -0.115, top), 0.001)
    parts.append(PALETTE.paint("charcoal", socket))
    return join(parts)


def laser_mount(scan: tuple[float, float, float]) -> Patch:
    """Plate under the laser scanner, and its cable."""
    x, y, z = scan
    underside = z - laser_scanner.SCAN_HEIGHT
    plate = block((0.165, 0.170, underside - DECK), (x, y, (underside + DECK) / 2), 0.001)
    back = x - laser_scanner.DEPTH / 2
    cable = [
        (back + 0.01, 0.045, underside + 0.035),
        (back - 0.018, 0.045, underside + 0.034),
        (back - 0.028, 0.045, underside + 0.022),
        (back - 0.032, 0.045, DECK - 0.002),
    ]
    return join([PALETTE.paint("silver", plate), PALETTE.paint("rubber", tube(cable, 0.004, 8))])


if __name__ == "__main__":
    main()
