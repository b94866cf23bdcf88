"""The plan of the map: rooms between the middle lines of their walls, and the openings in them.

x east, y north, meters.  The four start poses are known from the lost map; all else is ours.
"""

from __future__ import annotations

from dataclasses import dataclass, field

HEIGHT = 2.7
HALF = 0.08  # half the thickness of an inner wall
OUTER = 0.22  # from the middle line to the outer face of an outside wall
EAST, WEST, NORTH, SOUTH = 11.0, -4.0, 13.0, -9.0
STAIR_HOLE = (7.9, 11.94, 10.90, 12.90)  # x0, y0, x1, y1 in the ceiling above the stairs

STARTS = ((0.75, -7.28), (3.63, 10.80), (1.91, 10.00), (3.85, 9.17))


@dataclass(frozen=True)
class Room:
    """A rectangle x0..x1, y0..y1 between middle lines, and its materials.

    Attributes:
        accents: walls of another material, by side.
        cuts: where long walls, floor and ceiling are divided into objects, along the longer axis.
    """

    name: str
    x0: float
    y0: float
    x1: float
    y1: float
    floor: str
    wall: str
    ceiling: str = "ceiling_panels"
    skirting: str = "white"
    accents: dict[str, str] = field(default_factory=dict)
    cuts: tuple[float, ...] = ()

    @property
    def along(self) -> str:
        """The longer axis."""
        return "x" if self.x1 - self.x0 > self.y1 - self.y0 else "y"


@dataclass(frozen=True)
class Opening:
    """A hole in the wall on the line `axis` = `line`, about `center`.

    Attributes:
        kind: "door", "passage", "window", "glazing", "front" or "breach".
        hinge: -1 or 1: at which end along the wall the leaf hangs, as seen along its axis.
        swing: -1 or 1: towards which side along the other axis it opens.
        open_deg: angle of the open leaf; None: there is no leaf.
    """

    name: str
    kind: str
    axis: str
    line: float
    center: float
    width: float = 1.04
    sill: float = 0.0
    head: float = 2.18
    leaf: str = "beech"
    hinge: int = -1
    swing: int = 1
    open_deg: float | None = None

    @property
    def outside(self) -> bool:
        """It is in an outside wall."""
        return self.line in ((EAST, WEST) if self.axis == "x" else (NORTH, SOUTH))


ROOMS = (
    Room("lobby", 0, -9, 6, -6, "stone_floor", "plaster_sand", accents={"north": "panelling"}),
    Room(
        "west_corridor", 0, -6, 2, 8, "lino_green", "plaster_green", skirting="dark_grey",
        cuts=(-2.0, 3.0),
    ),
    Room("cross_corridor", 2, 1, 6, 3, "lino_sand", "plaster_orange", skirting="dark_grey"),
    Room(
        "east_corridor", 6, -9, 8, 9.5, "lino_blue", "plaster_blue", skirting="dark_grey",
        cuts=(-5.0, -1.0, 3.0, 6.0),
    ),
    Room("kitchen", -4, -9, 0, -5, "chequer_floor", "paint_yellow", "ceiling_plaster",
         accents={"west": "kitchen_tiles", "south": "kitchen_tiles"}),
    Room("office_a", -4, -5, 0, -1.6, "carpet_blue", "paint_grey", accents={"west": "paint_lilac"}),
    Room("office_b", -4, -1.6, 0, 1.8, "carpet_green", "wallpaper", skirting="oak"),
    Room("meeting", -4, 1.8, 0, 7.4, "parquet", "panelling", skirting="walnut"),
    Room("collapsed", -4, 7.4, 0, 13, "concrete_floor", "broken_wall", "ceiling_broken",
         "concrete"),
    Room("lab", 0, 8, 6, 13, "painted_concrete", "blocks", "ceiling_plaster", "dark_grey"),
    Room("storage", 2, -6, 6, -2.5, "concrete_floor", "brick", "ceiling_plaster", "dark_grey"),
    Room("lounge", 2, -2.5, 6, 1, "floorboards", "paint_terracotta", "ceiling_plaster", "oak"),
    Room("studio", 2, 3, 6, 8, "carpet_red", "paint_grey", accents={"south": "paint_red"}),
    Room("stair_hall", 6, 9.5, 11, 13, "terrazzo", "plaster_sand", "ceiling_plaster", "dark_grey"),
    Room("washroom", 8, -9, 11, -5.5, "mosaic_floor", "bath_tiles", "ceiling_plaster", "teal"),
    Room("server_room", 8, -5.5, 11, -2, "raised_floor", "metal_wall", skirting="black"),
    Room("office_c", 8, -2, 11, 2, "carpet_blue", "paint_yellow", accents={"east": "paint_grey"}),
    Room("first_aid", 8, 2, 11, 5.5, "lino_mint", "paint_mint"),
    Room("library", 8, 5.5, 11, 9.5, "parquet", "paint_lilac", "ceiling_plaster", "walnut"),
)  # fmt: skip

WIDE = {"width": 1.7, "head": 2.36}
WINDOW = {"width": 1.5, "sill": 0.92, "head": 2.2}

OPENINGS = (
    # Ways without a leaf, and where a wall has come down.
    Opening("passage_lobby_north", "passage", "y", -6, 1.0, **WIDE),
    Opening("passage_lobby_east", "passage", "x", 6, -7.5, **WIDE),
    Opening("passage_cross_west", "passage", "x", 2, 2.0, **WIDE),
    Opening("passage_cross_east", "passage", "x", 6, 2.0, **WIDE),
    Opening("passage_lounge", "passage", "y", 1, 4.6, width=1.3, head=2.3),
    Opening("passage_stairs", "passage", "y", 9.5, 7.0, **WIDE),
    Opening("breach", "breach", "y", 7.4, -1.1, width=1.5, head=2.25),
    # Doors of the west side.
    Opening("door_kitchen", "door", "x", 0, -8.25, leaf="yellow", hinge=1, swing=-1, open_deg=92),
    Opening("door_office_a", "door", "x", 0, -2.6, hinge=1, swing=-1, open_deg=35),
    Opening("door_office_b", "door", "x", 0, 0.9, hinge=1, swing=-1, open_deg=90),
    Opening("door_between_offices", "door", "y", -1.6, -2.9, hinge=-1, swing=1, open_deg=88),
    Opening("door_meeting_south", "door", "x", 0, 2.6, leaf="walnut", swing=-1, open_deg=0),
    Opening("door_meeting_north", "door", "x", 0, 5.0, leaf="walnut", swing=-1, open_deg=92),
    # Doors of the lab.
    Opening("door_lab_south", "door", "y", 8, 1.0, leaf="orange", open_deg=93),
    Opening("door_lab_east", "door", "x", 6, 10.7, leaf="orange", hinge=1, open_deg=86),
    Opening("door_collapsed", "door", "x", 0, 11.8, leaf="none"),
    # Doors of the block in the middle.
    Opening("door_storage_west", "door", "x", 2, -5.0, leaf="blue", swing=1, open_deg=0),
    Opening("door_storage_east", "door", "x", 6, -4.2, leaf="blue", swing=-1, open_deg=95),
    Opening("door_lounge", "door", "x", 2, -0.4, leaf="red", hinge=1, open_deg=90),
    Opening("door_studio_west", "door", "x", 2, 7.2, leaf="red", hinge=1, open_deg=94),
    Opening("door_studio_east", "door", "x", 6, 4.0, leaf="red", swing=-1, open_deg=32),
    # Doors of the east side.
    Opening("door_washroom", "door", "x", 8, -6.5, leaf="teal", hinge=1, open_deg=60),
    Opening("door_server", "door", "x", 8, -3.0, leaf="grey", hinge=1, open_deg=92),
    Opening("door_office_c", "door", "x", 8, 0.7, hinge=1, open_deg=85),
    Opening("door_first_aid", "door", "x", 8, 3.0, leaf="white", open_deg=80),
    Opening("door_library", "door", "x", 8, 8.4, leaf="walnut", hinge=1, open_deg=95),
    # To the outside; all closed.
    Opening("door_front", "front", "y", -9, 3.0, width=1.9, head=2.3),
    Opening("door_emergency", "door", "y", -9, 7.0, leaf="green", swing=-1, open_deg=0),
    # Panes between rooms.
    Opening("glazing_studio", "glazing", "x", 2, 4.7, width=3.0, sill=0.95, head=2.25),
    Opening("glazing_library", "glazing", "x", 8, 6.7, width=1.8, sill=0.95, head=2.25),
    Opening("glazing_lounge", "glazing", "x", 6, -0.9, width=2.2, sill=0.6, head=2.25),
    # Windows.
    Opening("window_kitchen", "window", "x", -4, -7.0, **WINDOW),
    Opening("window_office_a", "window", "x", -4, -3.3, **WINDOW),
    Opening("window_office_b", "window", "x", -4, 0.1, **WINDOW),
    Opening("window_meeting_south", "window", "x", -4, 3.3, **WINDOW),
    Opening("window_meeting_north", "window", "x", -4, 5.9, **WINDOW),
    Opening("window_collapsed_west", "window", "x", -4, 9.2, **WINDOW),
    Opening("window_collapsed_north", "window", "y", 13, -2.0, **WINDOW),
    Opening("window_lab_west", "window", "y", 13, 1.7, **WINDOW),
    Opening("window_lab_east", "window", "y", 13, 4.3, **WINDOW),
    Opening("window_stair_hall", "window", "x", 11, 10.6, width=1.0, sill=0.92, head=2.2),
    Opening("window_library", "window", "x", 11, 7.5, **WINDOW),
    Opening("window_first_aid", "window", "x", 11, 3.8, **WINDOW),
    Opening("window_office_c", "window", "x", 11, 0.0, **WINDOW),
    Opening("window_washroom", "window", "x", 11, -6.3, width=0.9, sill=1.6, head=2.2),
    Opening("window_lobby_west", "window", "y", -9, 1.2, width=1.0, sill=0.4, head=2.3),
    Opening("window_lobby_east", "window", "y", -9, 4.8, width=1.0, sill=0.4, head=2.3),
)


def room_named(name: str) -> Room:
    """The room of a name."""
    return next(room for room in ROOMS if room.name == name)
