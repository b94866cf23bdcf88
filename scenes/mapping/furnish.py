"""Furniture and props of each room.  x, y in world meters, yaw counter-clockwise."""

from __future__ import annotations

from scenes.mapping import equipment, office, rubble
from scenes.mapping.interior import Interior
from scenes.mapping.plan import HEIGHT
from scenes.modeling.geometry import pose
from scenes.modeling.stage import Model


def furnish(inside: Interior) -> None:
    """All rooms, from the south-west to the north-east."""
    for part in (
        _lobby,
        _corridors,
        _kitchen,
        _office_a,
        _office_b,
        _meeting,
        _collapsed,
        _lab,
        _storage,
        _lounge,
        _studio,
        _stair_hall,
        _washroom,
        _server_room,
        _office_c,
        _first_aid,
        _library,
        _lamps,
        _door_signs,
    ):
        part(inside)


def _workplace(
    i: Interior, x: float, y: float, yaw: float, screen: str, fabric: str, top: str = "beech"
) -> None:
    """Desk with its back edge at (x, y), facing -y before it is turned, and a chair."""
    at = pose(x, y, 0, yaw)
    i.put("desk", i.made(office.desk, top), at)
    i.put("monitor", i.made(office.monitor, screen), at @ pose(-0.15, -0.22, 0.75, 6))
    i.put("keyboard", i.made(office.keyboard), at @ pose(-0.15, -0.56, 0.75))
    i.put("papers", i.made(office.papers), at @ pose(0.52, -0.42, 0.75, 20))
    i.put("office_chair", i.made(office.office_chair, fabric), at @ pose(-0.1, -1.05, 0, 170))


def _wall_picture(
    i: Interior, name: str, size: tuple, room: str, side: str, along: float, z: float = 1.2
) -> None:
    i.lean("picture", i.made(office.picture, name, *size), room, side, along, z, 0.0)


def _plant(i: Interior, big: bool, x: float, y: float) -> None:
    name, leaf, count, reach = (
        ("plant_big", "leaf", 16, 0.56) if big else ("plant_small", "dark_leaf", 13, 0.42)
    )
    if name not in i.stage.models:
        i.stage.models[name] = office.plant(i.atlas, i.rng, name, leaf, count, reach)
    i.stand("plant", i.stage.models[name], x, y, 77 * (x + y))


def _lobby(i: Interior) -> None:
    i.stand("reception_desk", i.made(office.reception_desk), 4.0, -6.15)
    i.stand("office_chair", i.made(office.office_chair, "fabric_red"), 3.6, -6.46, 15)
    i.stand("monitor", i.made(office.monitor, "screen_map"), 4.5, -6.56, 10, 0.75)
    i.put("welcome_sign", i.made(office.picture, "welcome", 1.8, 0.45), pose(4.0, -6.09, 1.75))
    i.stand("door_mat", i.made(office.door_mat), 3.0, -8.36)
    i.lean("bench", i.made(office.bench, "teal"), "lobby", "south", 4.9)
    _plant(i, True, 2.42, -6.55)
    i.stand("coat_stand", i.made(office.coat_stand), 5.62, -6.45)
    _wall_picture(i, "poster_map", (1.12, 0.8), "lobby", "west", -7.05, 1.25)
    i.lean("fire_extinguisher", i.made(office.fire_extinguisher), "lobby", "west", -6.3, 0.5, 0.0)
    i.lean("clock", i.made(office.wall_clock), "lobby", "south", 3.0, 2.53, 0.0)
    i.lean("bin", i.made(office.waste_bin, "steel"), "lobby", "south", 1.95, 0, 0.18)


def _corridors(i: Interior) -> None:
    hung = i.made
    for room, side, along, name, size in (
        ("west_corridor", "east", -4.0, "poster_hills", (0.6, 0.84)),
        ("west_corridor", "west", -4.2, "poster_circles", (0.6, 0.84)),
        ("west_corridor", "west", -0.6, "noticeboard", (1.44, 0.9)),
        ("west_corridor", "east", -1.7, "poster_squares", (0.7, 0.7)),
        ("west_corridor", "west", 3.9, "poster_mirror", (0.6, 0.84)),
        ("west_corridor", "west", 6.6, "poster_robot", (0.6, 0.84)),
        ("cross_corridor", "north", 3.0, "poster_sea", (1.12, 0.8)),
        ("cross_corridor", "north", 4.9, "poster_chart", (0.6, 0.84)),
        ("cross_corridor", "south", 2.9, "poster_robot", (0.6, 0.84)),
        ("east_corridor", "west", -5.2, "poster_squares", (0.7, 0.7)),
        ("east_corridor", "east", -4.6, "poster_chart", (0.6, 0.84)),
        ("east_corridor", "east", -0.9, "poster_map", (1.12, 0.8)),
        ("east_corridor", "west", 6.2, "poster_hills", (0.6, 0.84)),
        ("east_corridor", "east", 4.7, "poster_circles", (0.6, 0.84)),
        ("east_corridor", "west", 8.6, "poster_mirror", (0.6, 0.84)),
    ):
        _wall_picture(i, name, size, room, side, along)
    extinguisher = hung(office.fire_extinguisher)
    for room, side, along in (
        ("west_corridor", "west", 5.9),
        ("east_corridor", "west", 5.2),
        ("east_corridor", "east", -8.3),
    ):
        i.lean("fire_extinguisher", extinguisher, room, side, along, 0.5, 0.0)
    for side, along in (("west", 1.75), ("east", -2.9)):
        letter = hung(office.picture, "sign_middle" if along > 0 else "sign_south", 0.3, 0.3)
        i.lean("letter", letter, "west_corridor", side, along, 1.5, 0.0)
    north = hung(office.picture, "sign_north", 0.3, 0.3)
    i.lean("letter", north, "west_corridor", "north", 1.75, 1.5, 0.0)
    i.lean("letter", north, "east_corridor", "west", 9.2, 1.5, 0.0)
    exit_sign = hung(office.hanging_sign, "sign_exit", 0.64, 0.24)
    for x, y, yaw in ((1.0, -5.2, 0), (7.0, -8.2, 0), (1.0, 3.6, 0), (7.0, 3.6, 0), (4.0, 2.0, 90)):
        i.stand("exit_sign", exit_sign, x, y, yaw, HEIGHT)
    i.lean("cupboard", hung(office.cupboard, "grey", 1.0, 1.9), "east_corridor", "west", 7.3)
    i.lean("water_cooler", hung(equipment.water_cooler), "cross_corridor", "south", 3.55)
    i.lean("bench", hung(office.bench, "orange"), "cross_corridor", "north", 4.0)
    _plant(i, False, 2.85, 1.4)
    _plant(i, False, 0.4, -5.6)
    _plant(i, True, 7.46, 5.25)
    i.stand("bin", hung(office.waste_bin, "orange"), 2.3, 2.75)


def _kitchen(i: Interior) -> None:
    room = "kitchen"
    i.lean("kitchen_counter", i.made(equipment.kitchen_counter), room, "south", -2.55)
    i.lean("wall_cupboards", i.made(equipment.wall_cupboards), room, "south", -2.8, 1.5, 0.0)
    fridge = i.made(equipment.front_box, "fridge", "white", (0.64, 0.62, 1.7))
    i.lean("fridge", fridge, room, "north", -2.35)
    microwave = i.made(equipment.front_box, "microwave", "grey", (0.48, 0.34, 0.28))
    i.lean("microwave", microwave, room, "south", -2.5, 0.901, 0.08)
    vending = i.made(equipment.front_box, "vending", "red", (1.0, 0.8, 1.85))
    i.lean("vending_machine", vending, room, "north", -3.3)
    for number, (x, y) in enumerate(((-2.75, -6.9), (-1.1, -5.95))):
        i.stand("round_table", i.made(office.round_table, "white"), x, y)
        i.stand("mug", i.made(office.mug, ("red", "blue")[number]), x + 0.2, y - 0.1, 40, 0.745)
        for k, fabric in enumerate(("yellow", "teal", "yellow")[: 3 - number]):
            turn = 120 * k + 40 + 50 * number
            at = pose(x, y, 0, turn) @ pose(0, 0.72)
            i.put("chair", i.made(office.side_chair, fabric), at)
    i.lean("radiator", i.made(office.radiator), room, "west", -7.0)
    i.stand("bin", i.made(office.waste_bin, "green"), -0.4, -7.3)
    _wall_picture(i, "poster_sea", (0.84, 0.6), room, "north", -1.3)
    i.lean("calendar", i.made(office.picture, "calendar", 0.36, 0.48), room, "east", -7.1, 1.4, 0.0)


def _office_a(i: Interior) -> None:
    room = "office_a"
    _workplace(i, -3.0, -4.86, 180, "screen_code", "fabric_blue")
    _workplace(i, -1.2, -4.86, 180, "screen_plot", "fabric_blue")
    i.lean("radiator", i.made(office.radiator), room, "west", -3.3)
    i.lean("bookcase", i.made(office.bookcase, ("binders",) * 5, "beech"), room, "north", -0.75)
    i.lean("filing_cabinet", i.made(office.filing_cabinet, "grey"), room, "north", -1.55)
    _plant(i, True, -0.52, -3.65)
    i.stand("bin", i.made(office.waste_bin, "black"), -0.24, -4.72)
    _wall_picture(i, "whiteboard", (1.8, 1.0), room, "south", -2.1, 1.15)
    i.lean("calendar", i.made(office.picture, "calendar", 0.36, 0.48), room, "west", -4.5, 1.4, 0.0)


def _office_b(i: Interior) -> None:
    room = "office_b"
    _workplace(i, -3.78, 0.42, 90, "screen_plot", "fabric_green", "oak")
    i.stand("desk_lamp", i.made(office.desk_lamp), -3.55, -0.2, 60, 0.75)
    i.lean(
        "bookcase",
        i.made(office.bookcase, ("books_a", "books_c", "books_b", "books_a", "books_c"), "oak"),
        room,
        "north",
        -3.3,
    )
    i.lean(
        "bookcase",
        i.made(office.bookcase, ("books_b", "books_a", "binders"), "oak"),
        room,
        "north",
        -2.3,
    )
    i.lean("armchair", i.made(office.sofa, "fabric_green", 1), room, "east", -0.85)
    i.stand("round_table", i.made(office.round_table, "walnut"), -1.5, -0.95)
    i.stand("mug", i.made(office.mug, "green"), -1.35, -0.85, 10, 0.745)
    i.lean("radiator", i.made(office.radiator), room, "west", 0.35)
    _wall_picture(i, "poster_hills", (0.6, 0.84), room, "south", -1.4)
    i.lean("clock", i.made(office.wall_clock), room, "north", -1.2, 1.9, 0.0)
    _plant(i, False, -1.42, 1.4)


def _meeting(i: Interior) -> None:
    room = "meeting"
    table_x, table_y = -2.2, 4.3
    i.stand("meeting_table", i.made(office.meeting_table), table_x, table_y)
    chair = i.made(office.side_chair, "fabric_red")
    for k, y in enumerate((3.35, 4.3, 5.25)):
        i.stand("chair", chair, table_x - 0.85, y, 90 + 8 * (k - 1))
        i.stand("chair", chair, table_x + 0.85, y, -90 + 12 * (1 - k))
    i.stand("chair", chair, table_x + 0.05, 6.0, 4)
    i.stand("projection", i.made(office.picture, "projection", 2.0, 1.25), table_x, 1.89, 180, 0.85)
    i.stand("projector", i.made(office.projector), table_x, 3.9, 0, HEIGHT)
    i.lean("cupboard", i.made(office.cupboard, "walnut", 1.2, 0.9), room, "north", -3.2)
    _plant(i, True, -3.42, 2.36)
    for x, y in ((-2.4, 3.6), (-1.95, 4.9), (-2.5, 5.2)):
        i.stand("papers", i.made(office.papers), x, y, 90 + 30 * (x + y), 0.75)
    i.stand("mug", i.made(office.mug, "teal"), -2.0, 3.5, 30, 0.75)
    for along in (3.3, 5.9):
        i.lean("radiator", i.made(office.radiator), room, "west", along)
    _wall_picture(i, "whiteboard", (1.16, 0.65), room, "east", 3.8, 1.2)
    _wall_picture(i, "poster_sea", (1.12, 0.8), room, "north", -3.2, 1.3)


def _collapsed(i: Interior) -> None:
    """A way stays open along the east side, from the lab's door to the breach."""
    a, rng = i.atlas, i.rng
    i.stand("rubble_heap", rubble.heap(a, rng, "heap_large", 0.95, 0.50), -3.05, 11.5)
    i.stand("rubble_heap", rubble.heap(a, rng, "heap_small", 0.6, 0.34), -3.35, 8.1, 40)
    i.stand("rubble_heap", rubble.heap(a, rng, "heap_low", 0.45, 0.22), -3.45, 9.3, 200)
    i.stand("loose_bricks", rubble.loose_bricks(a, rng), -2.3, 9.3, 30)
    # The cupboard lies on its front, its head on the heap.
    tipped = i.made(office.cupboard, "green", 1.0, 1.9)
    i.put("tipped_cupboard", tipped, pose(-2.0, 12.55, 0.45, -25, roll_deg=79))
    long, short = i.made(rubble.plank, 2.2, "oak"), i.made(rubble.plank, 1.3, "walnut")
    for model, x, y, z, yaw, pitch in (
        (long, -2.7, 11.0, 0.42, 35, 17),
        (long, -3.2, 11.6, 0.50, 100, -15),
        (short, -3.3, 8.6, 0.22, 70, 14),
        (short, -3.0, 9.2, 0.20, -25, 8),
        (short, -2.55, 8.75, 0.005, 12, 0),
        (long, -0.28, 9.2, 1.02, 88, 62),
    ):
        i.put("fallen_board", model, pose(x, y, z, yaw, pitch_deg=pitch))
    slab = i.made(rubble.slab)
    i.put("fallen_slab", slab, pose(-3.15, 9.4, 0.30, 20, pitch_deg=30))
    i.put("fallen_slab", slab, pose(-3.2, 12.2, 0.45, -35, pitch_deg=24, roll_deg=12))
    panel = i.made(rubble.ceiling_tile)
    for x, y, z, yaw, pitch in (
        (-1.9, 8.4, 0.004, 22, 0),
        (-1.75, 8.8, 0.06, 60, 8),
        (-1.9, 9.95, 0.004, 40, 0),
        (-3.6, 10.6, 0.24, 10, 55),
        (-1.4, 10.2, 2.46, 0, 48),
    ):
        i.put("fallen_panel", panel, pose(x, y, z, yaw, pitch_deg=pitch))
    i.put("hanging_cables", rubble.cables(a, rng), pose(-2.9, 9.3, HEIGHT))
    chair, barrel = i.made(office.side_chair, "fabric_red"), i.made(equipment.barrel, "rust")
    i.put("tipped_chair", chair, pose(-2.5, 7.95, 0.23, 35, roll_deg=90))
    i.put("tipped_barrel", barrel, pose(-0.25, 12.6, 0.305, -90, roll_deg=90))
    i.put("fallen_door", i.stage.models["leaf_beech"], pose(-1.6, 10.05, 0.075, 98, roll_deg=-90))
    i.stand("radiator", i.made(office.radiator), -3.9, 9.5, 93)
    closed = i.made(office.picture, "sign_closed", 0.8, 0.2, "white")
    i.lean("sign_closed", closed, "collapsed", "south", -2.7, 1.6, 0.0)


def _lab(i: Interior) -> None:
    room = "lab"
    for along in (1.6, 4.4):
        i.lean("workbench", i.made(equipment.workbench), room, "north", along)
    i.stand("monitor", i.made(office.monitor, "screen_map"), 1.4, 12.55, 0, 0.9)
    i.stand("keyboard", i.made(office.keyboard), 1.4, 12.31, 0, 0.9)
    i.stand("rover", i.made(equipment.rover, "red"), 4.5, 12.52, 160, 0.9)
    i.stand("rover", i.made(equipment.rover, "orange"), 2.75, 8.5, 15)
    i.stand("drill_press", i.made(equipment.drill_press), 5.62, 12.5, -90)
    i.lean("tool_board", i.made(office.picture, "tools", 1.8, 0.9), room, "east", 9.0, 1.2, 0.0)
    i.lean("workbench", i.made(equipment.workbench), room, "east", 9.1)
    i.stand("carton", i.made(equipment.carton, 0.4, 0.3), 5.5, 8.5, -84, 0.9)
    i.stand("desk_lamp", i.made(office.desk_lamp), 5.7, 9.2, -60, 0.9)
    shelf = equipment.metal_shelf(i.atlas, i.rng, "metal_shelf_lab")
    i.lean("metal_shelf", shelf, room, "west", 9.95)
    i.lean("gas_bottles", i.made(equipment.gas_bottles), room, "east", 11.9)
    _wall_picture(i, "poster_robot", (0.8, 1.12), room, "south", 2.3, 1.1)
    _wall_picture(i, "whiteboard", (1.8, 1.0), room, "south", 4.2, 1.15)
    i.lean("fire_extinguisher", i.made(office.fire_extinguisher), room, "west", 12.6, 0.5, 0.0)
    i.stand("pipes", i.made(equipment.pipes, 5.8), 3.0, 10.5, 0, HEIGHT)
    i.stand("office_chair", i.made(office.office_chair, "fabric_mustard"), 2.35, 11.7, 200)
    i.lean("letter", i.made(office.picture, "sign_north", 0.4, 0.4), room, "west", 11.0, 1.5, 0.0)


def _storage(i: Interior) -> None:
    room, a, rng = "storage", i.atlas, i.rng
    for number, along in enumerate((2.9, 4.5), start=1):
        shelf = equipment.metal_shelf(a, rng, f"metal_shelf_store_{number}")
        i.lean("metal_shelf", shelf, room, "north", along)
    for number, along in enumerate((2.9, 4.5), start=3):
        shelf = equipment.metal_shelf(a, rng, f"metal_shelf_store_{number}")
        i.lean("metal_shelf", shelf, room, "south", along)
    i.stand("pallet", i.made(equipment.pallet), 2.65, -4.0, 90)
    for x, y, z, yaw, wide, high in (
        (2.62, -4.3, 0.144, 4, 0.5, 0.4),
        (2.68, -3.72, 0.144, -8, 0.6, 0.5),
        (2.60, -4.25, 0.544, 20, 0.4, 0.3),
    ):
        i.stand("carton", i.made(equipment.carton, wide, high), x, y, yaw + 90, z)
    i.stand("barrel", i.made(equipment.barrel, "blue"), 5.6, -2.92)
    i.stand("barrel", i.made(equipment.barrel, "yellow"), 5.6, -5.55)


def _lounge(i: Interior) -> None:
    room = "lounge"
    i.lean("sofa", i.made(office.sofa, "fabric_mustard", 3), room, "south", 4.75)
    i.stand("armchair", i.made(office.sofa, "leather", 1), 2.6, -1.85, 112)
    i.stand("low_table", i.made(office.low_table), 4.75, -0.95)
    i.stand("mug", i.made(office.mug, "red"), 4.95, -0.9, 50, 0.4375)
    books = ("books_c", "books_a", "none", "books_b")
    i.lean("bookcase", i.made(office.bookcase, books, "walnut"), room, "north", 2.9)
    _plant(i, True, 5.46, 0.3)
    _wall_picture(i, "poster_squares", (1.2, 1.2), room, "south", 4.75, 1.15)
    _wall_picture(i, "poster_circles", (0.6, 0.84), room, "west", -1.6)


def _studio(i: Interior) -> None:
    room = "studio"
    for x, y, yaw, screen in (
        (3.55, 4.72, 0, "screen_code"),
        (3.55, 4.76, 180, "screen_map"),
        (5.0, 6.3, 0, "screen_plot"),
        (5.0, 6.34, 180, "screen_code"),
    ):
        _workplace(i, x, y, yaw, screen, "fabric_red")
    i.lean("filing_cabinet", i.made(office.filing_cabinet, "orange"), room, "north", 3.4)
    i.lean("filing_cabinet", i.made(office.filing_cabinet, "grey"), room, "north", 3.92)
    _plant(i, True, 2.55, 3.6)
    _wall_picture(i, "poster_chart", (0.8, 1.12), room, "south", 3.2, 1.1)
    _wall_picture(i, "poster_mirror", (0.8, 1.12), room, "south", 4.6, 1.1)
    _wall_picture(i, "whiteboard", (1.8, 1.0), room, "east", 6.3, 1.1)
    i.lean("clock", i.made(office.wall_clock), room, "south", 3.9, 2.2, 0.0)
    i.stand("bin", i.made(office.waste_bin, "blue"), 2.4, 5.6)


def _stair_hall(i: Interior) -> None:
    room, steps, going, rise, wide = "stair_hall", 15, 0.215, 0.18, 0.96
    foot = pose(7.0, 12.91)
    i.put("stairs", equipment.stairs(i.atlas, steps, going, rise, wide), foot)
    i.put(
        "handrail",
        equipment.handrail(i.atlas, steps * going, steps * rise),
        foot @ pose(0, -wide + 0.04, 0.0),
    )
    landing = i.atlas.block("concrete", (0.70, wide, 2.7), (0.35, -wide / 2, 1.35), "-x+x-z+y")
    i.put("landing", Model("landing", "props", landing), foot @ pose(steps * going))
    i.lean("lift", i.made(equipment.lift_front), room, "south", 9.0, 0.0, 0.0)
    _plant(i, True, 10.4, 10.05)
    _wall_picture(i, "poster_map", (1.12, 0.8), room, "west", 12.0, 1.2)
    letter = i.made(office.picture, "sign_one", 0.5, 0.5)
    i.lean("letter", letter, room, "south", 10.2, 1.5, 0.0)
    i.lean("bin", i.made(office.waste_bin, "steel"), room, "east", 11.6, 0, 0.16)


def _washroom(i: Interior) -> None:
    room = "washroom"
    for along in (9.3, 10.1):
        i.lean("washbasin", i.made(equipment.washbasin), room, "north", along)
    for along in (-8.5, -7.5):
        i.lean("toilet", i.made(equipment.toilet), room, "east", along)
    for along in (-8.0, -7.0):
        i.lean("cubicle_wall", i.made(equipment.cubicle_wall, 1.35), room, "east", along)
    i.lean(
        "washing_machine",
        i.made(equipment.front_box, "washer", "white", (0.6, 0.58, 0.85)),
        room,
        "south",
        8.5,
    )
    i.stand("bin", i.made(office.waste_bin, "white"), 10.65, -5.85)


def _server_room(i: Interior) -> None:
    room = "server_room"
    for along in (-5.0, -4.38, -3.76):
        i.lean("server_rack", i.made(equipment.server_rack), room, "east", along, 0.0, 0.08)
    i.lean("cupboard", i.made(office.cupboard, "blue", 1.0, 1.9), room, "south", 8.75)
    i.put("cable_tray", i.made(equipment.cable_tray, 3.3), pose(10.4, -3.75, 2.42, 90))
    i.stand("monitor", i.made(office.monitor, "screen_code"), 10.4, -2.4, 0, 0.75)
    i.stand("desk", i.made(office.desk, "beech"), 10.0, -2.12, 0)
    i.lean("fire_extinguisher", i.made(office.fire_extinguisher), room, "north", 8.7, 0.5, 0.0)


def _office_c(i: Interior) -> None:
    room = "office_c"
    _workplace(i, 10.78, -1.1, -90, "screen_map", "fabric_mustard", "walnut")
    i.lean(
        "bookcase",
        i.made(office.bookcase, ("binders", "books_b", "books_a", "binders", "none"), "walnut"),
        room,
        "south",
        9.4,
    )
    i.lean("cupboard", i.made(office.cupboard, "teal", 1.0, 0.9), room, "north", 9.9)
    _plant(i, True, 10.42, 1.0)
    _plant(i, False, 8.42, -1.55)
    _wall_picture(i, "poster_circles", (0.8, 1.12), room, "north", 9.2, 1.1)
    _wall_picture(i, "poster_sea", (0.84, 0.6), room, "west", -0.9)
    i.lean("radiator", i.made(office.radiator), room, "east", 0.3)


def _first_aid(i: Interior) -> None:
    room = "first_aid"
    i.lean("bed", i.made(equipment.bed), room, "north", 10.3)
    i.stand("folding_screen", i.made(equipment.folding_screen), 9.5, 4.35, 90)
    i.lean("medicine_cabinet", i.made(equipment.medicine_cabinet), room, "south", 10.2, 1.3, 0.0)
    i.lean("desk", i.made(office.desk, "beech"), room, "south", 9.9)
    i.stand("office_chair", i.made(office.office_chair, "fabric_green"), 9.8, 3.1, 10)
    _wall_picture(i, "poster_eyes", (0.48, 0.72), room, "north", 8.7, 1.3)
    i.lean("radiator", i.made(office.radiator), room, "east", 3.8)
    i.lean("washbasin", i.made(equipment.washbasin), room, "west", 4.6)


def _library(i: Interior) -> None:
    room = "library"
    tall = ("books_a", "books_b", "books_c", "books_a", "books_b", "books_c")
    for k, along in enumerate((8.65, 9.63)):
        rows = tall[k:] + tall[:k]
        i.lean("bookcase", i.made(office.bookcase, rows, "walnut"), room, "south", along)
    i.lean("bookcase", i.made(office.bookcase, tall[2:] + tall[:2], "walnut"), room, "north", 10.43)
    i.stand("round_table", i.made(office.round_table, "walnut"), 9.9, 7.4)
    i.stand("desk_lamp", i.made(office.desk_lamp), 9.9, 7.5, 20, 0.745)
    for turn in (20, 150, 260):
        at = pose(9.9, 7.4, 0, turn) @ pose(0, 0.72)
        i.put("chair", i.made(office.side_chair, "leather"), at)
    i.lean("armchair", i.made(office.sofa, "leather", 1), room, "west", 6.55)
    i.stand("globe", i.made(equipment.globe), 10.5, 6.05)
    i.lean("radiator", i.made(office.radiator), room, "east", 7.5)


def _lamps(i: Interior) -> None:
    """Panel lamps in rows, long side along the room's longer axis."""
    rows: dict[tuple[float, float], list[tuple[float, float]]] = {
        (0.3, 1.2): [
            *((1.0, y) for y in (-4.8, -2.4, 0.0, 2.4, 4.8, 7.2)),
            *((7.0, y) for y in (-7.2, -4.8, -2.4, 0.0, 2.4, 4.8, 7.2)),
            *((x, y) for x in (-2.7, -1.5) for y in (3.3, 5.4)),
            *((x, y) for x in (2.7, 5.1) for y in (4.5, 6.6)),
        ],
        (1.2, 0.3): [
            *((x, 2.1) for x in (3.3, 4.8)),
            *((x, -7.5) for x in (1.2, 3.0, 4.8)),
            *((x, y) for x in (1.4, 4.5) for y in (9.2, 11.8)),
            *((x, y) for x in (3.0, 4.8) for y in (-4.2,)),
        ],
        (0.6, 0.6): [
            *((-2.0, y) for y in (-7.8, -6.2)),
            *((x, -3.3) for x in (-2.7, -1.5)),
            *((x, 0.3) for x in (-2.7, -1.5)),
            *((x, -0.7) for x in (3.2, 4.8)),
            *((9.5, y) for y in (-7.8, -6.6, -4.5, -2.7, -0.9, 0.9, 2.9, 4.5, 6.6, 8.4)),
            *((x, 10.6) for x in (7.0, 9.2)),
        ],
    }
    broken = {(1.0, 7.2), (-2.7, 5.4), (1.4, 11.8), (7.0, -2.4), (9.5, -6.6)}
    for (wide, long), places in rows.items():
        housing, lit = equipment.ceiling_lamp(wide, long, is_on=True)
        dark = equipment.ceiling_lamp(wide, long, is_on=False)[1]
        for x, y in places:
            i.stand("lamp_housing", housing, x, y, 0, HEIGHT)
            i.stand("lamp", dark if (x, y) in broken else lit, x, y, 0, HEIGHT)


def _door_signs(i: Interior) -> None:
    """A sign beside or above each door, on the corridor's side."""
    for name, room, side, along, z in (
        ("kitchen", "lobby", "west", -8.25, 2.28),
        ("office_a", "west_corridor", "west", -2.6, 2.28),
        ("office_b", "west_corridor", "west", 0.9, 2.28),
        ("meeting", "west_corridor", "west", 5.0, 2.28),
        ("meeting", "west_corridor", "west", 2.6, 2.28),
        ("lab", "west_corridor", "north", 1.0, 2.28),
        ("store", "west_corridor", "east", -5.0, 2.28),
        ("store", "east_corridor", "west", -4.2, 2.28),
        ("lounge", "west_corridor", "east", -0.4, 2.28),
        ("studio", "west_corridor", "east", 7.2, 2.28),
        ("studio", "east_corridor", "west", 4.0, 2.28),
        ("washroom", "east_corridor", "east", -6.5, 2.28),
        ("server", "east_corridor", "east", -3.0, 2.28),
        ("office_c", "east_corridor", "east", 0.7, 2.28),
        ("first_aid", "east_corridor", "east", 3.0, 2.28),
        ("library", "east_corridor", "east", 8.4, 2.28),
        ("stairs", "east_corridor", "north", 7.0, 2.45),
        ("lab", "stair_hall", "west", 10.7, 2.28),
        ("closed", "lab", "west", 11.8, 2.28),
    ):
        plate = i.made(office.picture, f"sign_{name}", 0.8, 0.2, "white")
        i.lean(f"sign_{name}", plate, room, side, along, z, 0.0)
