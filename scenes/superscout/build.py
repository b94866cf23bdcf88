"""Build superscout.glb: python -m scenes.superscout.build.

Base frame: x forward, y left, z up, meters; the origin is on the ground between the wheels.
The same code always writes the same bytes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scenes.modeling import omnidirectional_camera, robot_parts
from scenes.modeling.geometry import Patch, bar, bent, join, lathe, pose, tube
from scenes.modeling.palette import Label, Palette
from scenes.modeling.prisms import block
from scenes.modeling.robot_files import read_robot
from scenes.modeling.robot_parts import cylinder, facing
from scenes.modeling.stage import Model, Stage

OUTPUT = Path(__file__).with_name("superscout.glb")
RADIUS = 0.205  # of the bumpers, which reach farthest
SHELL = 0.198
SKIRT, DECK = 0.138, 0.360  # lower edge of the shell, upper side of the top plate
CHASSIS = 0.150
WHEEL_WIDTH = 0.026
BUMPER_LEVELS = (0.068, 0.112)
BUMPER_ROD = 0.0115
BUMPERS = 6
SONARS = 16
SONAR_Z, SONAR_RADIUS = 0.306, 0.190  # the band they sit in is set back
SEGMENTS = 48
BODY, WHITE = (0.27, 0.30, 0.40), (0.93, 0.93, 0.91)
PALETTE = Palette(
    {
        "shell": BODY,
        "band": (0.12, 0.12, 0.13),
        "top": (0.22, 0.22, 0.23),
        "steel": (0.55, 0.56, 0.58),
        "white": WHITE,
        **robot_parts.COLORS,
        **omnidirectional_camera.COLORS,
    },
    {
        "nomad": Label("NOMAD", 3.8, WHITE, BODY, 0.7),
        "scout": Label("SUPER SCOUT", 7.6, WHITE, BODY, 0.7),
    },
)


def main() -> None:
    """Build the robot and print its size."""
    robot, sensors, mirror = read_robot(Path(__file__).parent)
    stage = Stage(
        "superscout", {"paint": PALETTE.material("paint"), "glass": omnidirectional_camera.GLASS}
    )
    parts = {
        "body": body(),
        "top_plate": top_plate(),
        "sonar_ring": sonar_ring(),
        "chassis": chassis(),
        "castor": caster(),
        "control_panel": control_panel(),
        "emergency_stop": robot_parts.emergency_stop(PALETTE).shifted(-0.150, 0.0, DECK),
        "antenna": robot_parts.antenna(PALETTE, 0.120).shifted(-0.120, 0.110, DECK),
    }
    for name, patch in parts.items():
        stage.place(name, Model(name, "paint", patch))
    bumper = Model("bumper", "paint", bumper_arc())
    for index in range(BUMPERS):
        at = pose(yaw_deg=index * 360 / BUMPERS)
        stage.place(f"bumper_{index + 1}", bumper, at)
    kinematics = robot["kinematics"]
    model = Model("wheel", "paint", wheel(kinematics["wheel_diameter_m"]))
    for name, side in (("left", 1), ("right", -1)):
        middle = side * kinematics["track_m"] / 2
        at = pose(0, middle, kinematics["wheel_diameter_m"] / 2) @ pose(roll_deg=-90 * side)
        stage.place(f"wheel_{name}", model, at)
    omnidirectional_camera.place_camera(
        stage, PALETTE, mirror, sensors["omnicam"]["position_m"], DECK
    )
    size = stage.write(OUTPUT)
    print(f"{OUTPUT.name}: {size} bytes, {stage.triangle_count()} triangles")


def body() -> Patch:
    """The shell up to the sonars, its seams and slots, and a name at both ends."""
    shell = lathe(
        [
            (0.0, SKIRT),
            (SHELL - 0.006, SKIRT),
            (SHELL, SKIRT + 0.006),
            (SHELL, 0.272),
            (SHELL - 0.004, 0.278),
            (0.0, 0.278),
        ],
        SEGMENTS,
    )
    seams = [
        PALETTE.paint(
            "band", block((0.003, 0.003, 0.124), (SHELL - 0.0008, 0, 0.208), 0.0005)
        ).moved(pose(yaw_deg=angle))
        for angle in (45, 135, 225, 315)
    ]
    slots = [
        PALETTE.paint("band", block((0.003, 0.060, 0.005), (SHELL - 0.0015, 0, z), 0.001)).moved(
            pose(yaw_deg=angle)
        )
        for angle in (90, 270)
        for z in (0.170, 0.184, 0.198, 0.212)
    ]
    labels = [
        bent(PALETTE.label(name, height, "shell", columns=10), SHELL + 0.0006)
        .shifted(z=z)
        .moved(pose(yaw_deg=yaw))
        for name, height, yaw, z in (
            ("nomad", 0.030, 0, 0.240),
            ("scout", 0.020, 0, 0.208),
            ("nomad", 0.030, 180, 0.240),
        )
    ]
    return join([PALETTE.paint("shell", shell), *seams, *slots, *labels])


def top_plate() -> Patch:
    """Rim over the sonars and the lid in it, with bolts and two handles."""
    lid = lathe(
        [
            (0.0, 0.332),
            (SHELL - 0.004, 0.332),
            (SHELL, 0.337),
            (SHELL, 0.352),
            (SHELL - 0.006, DECK),
            (SHELL - 0.016, DECK),
            (SHELL - 0.018, DECK - 0.003),
            (SHELL - 0.021, DECK - 0.003),
            (SHELL - 0.023, DECK),
            (0.0, DECK),
        ],
        SEGMENTS,
    )
    bolts = [
        cylinder(0.004, 0.003, 6).shifted(0.160, 0, DECK - 0.001).moved(pose(yaw_deg=angle))
        for angle in range(22, 382, 45)
    ]
    handles = [robot_parts.handle(0.110, 0.030).moved(pose(0, y, DECK)) for y in (-0.145, 0.145)]
    return join([PALETTE.paint("top", lid), PALETTE.paint("steel", *bolts, *handles)])


def sonar_ring() -> Patch:
    """Sixteen sonars in a dark band; the first looks straight ahead."""
    band = lathe(
        [(0.0, 0.276), (SONAR_RADIUS, 0.276), (SONAR_RADIUS, 0.334), (0.0, 0.334)], 2 * SONARS
    )
    parts = [PALETTE.paint("band", band)]
    for index in range(SONARS):
        heading = index * 360 / SONARS
        at = pose(yaw_deg=heading) @ pose(SONAR_RADIUS - 0.0006, 0, SONAR_Z) @ facing(0)
        parts.append(robot_parts.sonar(PALETTE, 0.021).moved(at))
    return join(parts)


def chassis() -> Patch:
    """Drum between the wheels, the axle, and the struts that carry the bumpers."""
    drum = lathe(
        [(0.0, 0.034), (CHASSIS - 0.012, 0.034), (CHASSIS, 0.046), (CHASSIS, 0.140), (0.0, 0.140)],
        36,
    )
    axle = bar((0, -0.172, 0.0635), (0, 0.172, 0.0635), 0.010, 10)
    struts = []
    for index in range(BUMPERS):
        angle = (index + 0.5) * 2 * np.pi / BUMPERS
        for offset in (-0.30, 0.30):
            way = np.array([np.cos(angle + offset), np.sin(angle + offset), 0])
            for z in BUMPER_LEVELS:
                inner, outer = 0.140 * way, (RADIUS - BUMPER_ROD) * way
                struts.append(bar(inner + (0, 0, z), outer + (0, 0, z), 0.004, 6))
    return join([PALETTE.paint("band", drum), PALETTE.paint("steel", axle, *struts)])


def bumper_arc() -> Patch:
    """Two rubber rods, one above the other, over a sixth of the circle."""
    half = np.pi / BUMPERS - 0.03
    angle = np.linspace(-half, half, 9) + np.pi / BUMPERS
    middle = RADIUS - BUMPER_ROD
    arc = np.stack([middle * np.cos(angle), middle * np.sin(angle), 0 * angle], axis=1)
    rods = [tube(arc + (0, 0, z), BUMPER_ROD, 8) for z in BUMPER_LEVELS]
    return PALETTE.paint("rubber", *rods)


def wheel(diameter: float) -> Patch:
    """Narrow wheel about its axle, its outer side facing +z."""
    radius, half = diameter / 2, WHEEL_WIDTH / 2
    tire = [
        (0.0, -half),
        (radius - 0.004, -half),
        (radius, 0.003 - half),
        (radius, half - 0.003),
        (radius - 0.004, half),
        (radius - 0.012, half),
    ]
    rim = [tire[-1], (radius - 0.014, half - 0.006), (0.014, half - 0.006), (0.012, half)]
    rim.append((0.0, half))
    return join([PALETTE.paint("rubber", lathe(tire, 36)), PALETTE.paint("steel", lathe(rim, 36))])


def caster() -> Patch:
    """Small wheel at the back in its fork."""
    radius, x = 0.021, -0.118
    profile = [(0.0, -0.009), (radius - 0.003, -0.009), (radius, -0.006), (radius, 0.006)]
    profile += [(radius - 0.003, 0.009), (0.0, 0.009)]
    roller = lathe(profile, 20).moved(pose(x, 0, radius, roll_deg=90))
    fork = [block((0.016, 0.003, 0.034), (x, y, 0.030), 0.001) for y in (-0.012, 0.012)]
    return join([PALETTE.paint("rubber", roller), PALETTE.paint("steel", *fork)])


def control_panel() -> Patch:
    """Switch, lamps and sockets on the top plate, at the right."""
    top = DECK + 0.004
    parts = [
        PALETTE.paint("steel", block((0.084, 0.050, 0.006), (0.105, -0.095, DECK + 0.001), 0.001))
    ]
    for x, color in ((0.080, "button_red"), (0.100, "band")):
        parts.append(PALETTE.paint(color, cylinder(0.007, 0.007, 12).shifted(x, -0.088, top)))
    for x, color in ((0.078, "green"), (0.090, "yellow"), (0.102, "button_red")):
        parts.append(PALETTE.paint(color, cylinder(0.003, 0.002, 8).shifted(x, -0.110, top)))
    parts.append(PALETTE.paint("band", block((0.018, 0.030, 0.008), (0.130, -0.095, top), 0.001)))
    return join(parts)


if __name__ == "__main__":
    main()
