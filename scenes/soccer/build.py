"""Build soccer.glb: python -m scenes.soccer.build.

World axes: x along the field towards the blue goal, y to the left of that, z up, meters; the
origin is the middle of the field, on the carpet. The same code always writes the same bytes.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np

from scenes.modeling.geometry import pose
from scenes.modeling.stage import Model, Stage
from scenes.soccer import field, furniture, pictures, props
from scenes.soccer.hall import EAST, FLOOR, NORTH, SILL, SOUTH, WEST, build_hall
from scenes.soccer.materials import EMISSIVE, UNLIT, make_materials

SEED = 2006
FOLDER = Path(__file__).parent
OUTPUT = FOLDER / "soccer.glb"


def main() -> None:
    """Build the scene and print its size."""
    rng = np.random.default_rng(SEED)
    listed = tomllib.loads((FOLDER / "scene.toml").read_text(encoding="utf-8"))
    materials = make_materials(listed["palette"], rng)
    stage = Stage("soccer", materials, UNLIT, EMISSIVE, is_matte=True)
    field.lay_carpet(stage)
    field.build_landmarks(stage, listed["landmarks"])
    build_hall(stage)
    furnish_desks(stage, rng)
    furnish_shelves(stage, rng)
    furnish_west(stage, rng)
    hang_pictures(stage)
    put_plants(stage, rng)
    scatter_props(stage)
    size = stage.write(OUTPUT)
    print(
        f"{OUTPUT.name}: {size} bytes, {stage.triangle_count()} triangles, "
        f"{len(stage.nodes)} nodes, {len(stage.models)} meshes"
    )


def furnish_desks(stage: Stage, rng: np.random.Generator) -> None:
    """Four desks along the east wall, two in the north: monitors, computers, chairs."""
    desk, monitor, keys = furniture.desk(), furniture.monitor(), furniture.keyboard()
    tower = furniture.computer()
    shows = {
        name: Model(
            f"screen_{name}",
            "screens",
            pictures.screen(name, 0.53, 0.33).shifted(y=-0.0315, z=0.36),
        )
        for name in pictures.SCREENS
    }
    chairs = [
        furniture.chair(cloth) for cloth in ("denim", "dark_grey", "pale_blue", "brick", "teal")
    ]
    spots = [(EAST, x) for x in (-3.2, -1.1, 1.1, 3.2)] + [(NORTH, -2.8), (NORTH, 2.8)]
    screens = 0
    for index, (side, x) in enumerate(spots, start=1):
        stage.place(f"desk_{index:02}", desk, side.place(x, -0.25))
        double = index in (1, 3, 6)
        for offset, yaw in ((-0.32, 12), (0.32, -12)) if double else ((0.0, 4),):
            screens += 1
            at = side.place(x + offset, -0.48, FLOOR + furniture.DESK_TOP, yaw)
            name = list(shows)[screens % len(shows)]
            stage.place(f"monitor_{screens:02}", monitor, at)
            stage.place(f"monitor_{screens:02}_screen", shows[name], at)
        stage.place(
            f"keyboard_{index:02}",
            keys,
            side.place(x - 0.05, -0.85, FLOOR + furniture.DESK_TOP, rng.uniform(-8, 8)),
        )
        stage.place(f"computer_{index:02}", tower, side.place(x - 0.45, -0.62, FLOOR, 3))
        seat = chairs[index % len(chairs)]
        stage.place(
            f"chair_{index:02}", seat, side.place(x - 0.1, -1.35, FLOOR, rng.uniform(-40, 40))
        )


def furnish_shelves(stage: Stage, rng: np.random.Generator) -> None:
    """Bookcases, a workbench and a cabinet along the south wall."""
    case = furniture.bookcase()
    rows = [props.books(f"books_{k}", width, rng) for k, width in enumerate((0.93, 0.6, 0.8, 0.45))]
    files = [
        props.binders(f"binders_{hue}", count, hue)
        for hue, count in (("slate", 5), ("wine", 4), ("mid_grey", 6))
    ]
    small = props.cardboard_box("box_small", (0.32, 0.24, 0.2))
    pale = props.cardboard_box("box_white", (0.36, 0.26, 0.24), "paper")
    pink = props.folder("rose")
    number = 0
    for index, x in enumerate((3.9, 2.85, -0.3, -1.35), start=1):
        stage.place(f"bookcase_{index:02}", case, SOUTH.place(x))
        for level, z in enumerate(furniture.SHELVES):
            at = SOUTH.place(x - 0.46, 0, FLOOR + z)
            number += 1
            row = rows[(index + level) % 4]
            kind = (2 * index + 3 * level) % 7
            if kind in (1, 4):
                stage.place(f"binders_{number:02}", files[number % 3], at)
            else:
                stage.place(f"books_{number:02}", row, at)
            if kind == 4 or row.name == "books_3":
                other = pale if number % 2 else small
                stage.place(
                    f"shelf_box_{number:02}", other, SOUTH.place(x + 0.27, -0.16, FLOOR + z, 4)
                )
        top = FLOOR + 2.0
        stage.place(
            f"shelf_top_box_{index:02}",
            (small, pale)[index % 2],
            SOUTH.place(x - 0.2, -0.16, top, 5 * index),
        )
    bench = furniture.workbench()
    stage.place("workbench_01", bench, SOUTH.place(1.25))
    stage.place("workbench_02", bench, SOUTH.place(-3.2))
    high = FLOOR + 0.9
    stage.place("toolbox", props.toolbox(), SOUTH.place(0.75, -0.3, high, 10))
    stage.place("folder_01", pink, SOUTH.place(1.3, -0.35, high, 25))
    stage.place("folder_02", pink, EAST.place(3.6, -0.75, FLOOR + furniture.DESK_TOP, -15))
    stage.place(
        "folder_03",
        props.folder("straw"),
        EAST.place(-0.55, -0.8, FLOOR + furniture.DESK_TOP, 20),
    )
    dog = props.robot_dog()
    for index, (x, y, yaw) in enumerate(
        ((1.75, -0.35, 70), (-2.7, -0.4, 100), (-3.2, -0.3, 130)), start=1
    ):
        stage.place(f"robot_dog_{index:02}", dog, SOUTH.place(x, y, high, yaw))
    stage.place("ball_01", props.ball_of_the_league(), SOUTH.place(-3.7, -0.35, high))
    stage.place("workbench_box_01", small, SOUTH.place(1.7, -0.35, FLOOR + 0.265, 8))
    stage.place("workbench_box_02", pale, SOUTH.place(-3.6, -0.35, FLOOR + 0.265, -6))
    stool = furniture.stool()
    for index, (x, y) in enumerate(((0.9, -1.0), (-2.9, -1.05)), start=1):
        stage.place(f"stool_{index:02}", stool, SOUTH.place(x, y))
    stage.place("cabinet_01", furniture.cabinet(), SOUTH.place(-5.0))


def furnish_west(stage: Stage, rng: np.random.Generator) -> None:
    """Coats, whiteboard, ladder and bin by the door."""
    stage.place("coat_rack", furniture.coat_rack(), WEST.place(-0.4))
    for index, (x, hue, length) in enumerate(
        ((-0.9, "navy", 1.0), (-0.4, "khaki", 0.85), (0.1, "plum", 0.9)), start=1
    ):
        at = WEST.place(x, -0.13, FLOOR + 1.68)
        stage.place(f"coat_{index:02}", props.coat(hue, length), at)
    stage.place("umbrella_stand", props.umbrella_stand(), WEST.place(-1.35, -0.25))
    whiteboard = furniture.board_frame("whiteboard", 2.0, 1.0, "steel", ledge=True)
    stage.place("whiteboard", whiteboard, WEST.place(2.0, 0, 1.55))
    face = Model(
        "whiteboard_face", "pictures", pictures.picture("whiteboard", 2.0, 1.0).shifted(y=-0.022)
    )
    stage.place("whiteboard_face", face, WEST.place(2.0, 0, 1.55))
    stage.place("ladder", props.ladder(), WEST.place(3.6))
    can = props.bin_with_paper(rng)
    stage.place("bin_01", can, WEST.place(-3.4, -0.3))
    stage.place("bin_02", can, EAST.place(2.15, -0.45))
    stage.place("rucksack", props.rucksack(), WEST.place(1.0, -0.2, FLOOR, 12))


def hang_pictures(stage: Stage) -> None:
    """Posters, a map, a board of cork."""
    places = (
        ("robot", EAST, -2.1, 1.85, 0.75, 1.0),
        ("optics", EAST, 0.0, 1.85, 0.85, 1.1),
        ("goal", EAST, 2.15, 1.85, 0.75, 1.0),
        ("map", SOUTH, 1.25, 1.85, 1.2, 0.9),
        ("tower", SOUTH, -2.4, 1.95, 0.6, 0.85),
        ("results", SOUTH, -3.5, 1.8, 0.8, 1.1),
        ("calendar", NORTH, 0.0, 1.9, 0.4, 0.55),
        ("mirror", NORTH, 2.8, 1.9, 0.6, 0.8),
        ("cork", NORTH, -2.8, 1.85, 0.7, 0.9),
    )
    for name, side, x, z, width, height in places:
        hue = "oak" if name in ("map", "cork") else "paper"
        frame = furniture.board_frame(f"{name}_frame", width, height, hue)
        stage.place(f"poster_{name}_frame", frame, side.place(x, 0, z))
        face = Model(
            f"{name}_face", "pictures", pictures.picture(name, width, height).shifted(y=-0.022)
        )
        stage.place(f"poster_{name}", face, side.place(x, 0, z))


def put_plants(stage: Stage, rng: np.random.Generator) -> None:
    """Tall plants in corners, small ones on window boards."""
    tall = props.leaves("leaves_tall", 26, 0.55, 1.1, rng)
    low = props.leaves("leaves_low", 14, 0.28, 0.06, rng)
    stem = props.plant_stem("stem_tall", 1.1)
    tub, pot = props.plant_pot(0.2, "terracotta"), props.plant_pot(0.08, "white_board")
    spots = [(side, x, -0.55, FLOOR) for side, x in ((NORTH, 5.35), (SOUTH, 5.3), (NORTH, -5.3))]
    for index, (side, x, y, z) in enumerate(spots, start=1):
        stage.place(f"plant_{index:02}_pot", tub, side.place(x, y, z))
        stage.place(f"plant_{index:02}_stem", stem, side.place(x, y, z + 0.3))
        stage.place(f"plant_{index:02}", tall, side.place(x, y, z + 0.3, 70 * index))
    for index, x in enumerate((-4.8, -3.5, -0.9, 1.9, 3.6, 4.9), start=len(spots) + 1):
        stage.place(f"plant_{index:02}_pot", pot, NORTH.place(x, -0.02, FLOOR + SILL))
        stage.place(
            f"plant_{index:02}", low, NORTH.place(x, -0.02, FLOOR + SILL + 0.125, 50 * index)
        )


def scatter_props(stage: Stage) -> None:
    """Boxes, cables, a tripod: all more than half a meter from the field's lines."""
    large = props.cardboard_box("box_large", (0.6, 0.45, 0.4))
    middle = props.cardboard_box("box_middle", (0.45, 0.4, 0.3), "khaki")
    for index, (model, x, y, z, yaw) in enumerate(
        (
            (large, -5.35, 3.55, 0.0, 12),
            (middle, -5.3, 3.5, 0.4, -20),
            (large, -4.55, 3.8, 0.0, -8),
            (middle, 5.3, -3.0, 0.0, 35),
            (large, 0.35, 4.0, 0.0, 5),
        ),
        start=1,
    ):
        stage.place(f"box_{index:02}", model, pose(x, y, FLOOR + z, yaw))
    stage.place("tripod", props.tripod(), pose(-3.9, -2.9, FLOOR, -50))
    strip = props.power_strip()
    stage.place("power_strip_01", strip, pose(4.55, 2.3, FLOOR, 80))
    stage.place("power_strip_02", strip, pose(-4.6, -3.2, FLOOR, 20))
    paths = (
        [(4.56, 2.5), (4.6, 3.1), (5.2, 2.7), (5.4, 3.4), (5.9, 3.3)],
        [(4.53, 2.1), (4.3, 1.2), (4.9, 0.7), (5.5, 0.9), (5.9, 0.4)],
        [(-4.4, -3.15), (-4.1, -2.6), (-3.7, -3.1), (-3.9, -2.9)],
        [(-4.8, -3.25), (-5.2, -3.0), (-5.4, -2.2), (-5.95, -2.0)],
    )
    for index, path in enumerate(paths, start=1):
        name = f"cable_{index:02}"
        stage.place(name, props.floor_cable(name, path), pose(z=FLOOR))


if __name__ == "__main__":
    main()
