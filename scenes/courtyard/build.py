"""Build courtyard.glb: python -m scenes.courtyard.build.

World axes: x east, y north, z up, meters; the origin is the middle of the compass rose.
The same code always writes the same bytes.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenes.courtyard import architecture as arch
from scenes.courtyard import furniture, landscape, plants
from scenes.courtyard.materials import make_materials
from scenes.modeling.geometry import Patch, bar, box, join, polygon, pose, tile
from scenes.modeling.stage import Model, Stage

SEED = 20
OUTPUT = Path(__file__).with_name("courtyard.glb")
HALF_X, HALF_Y = 7.7, 5.5  # middle planes of the arcade
OUTER_X, OUTER_Y = HALF_X + arch.WALK, HALF_Y + arch.WALK
ROSE = 2.2  # half side of the compass square: 8 paving slabs
PATH_X = (3.575, 5.225)  # cobbled path between the south gate and the north door
WING_TOP = 6.6


@dataclass(frozen=True)
class Side:
    """One side of the court: `yaw_deg` turns parts modeled for the north side into place."""

    name: str
    yaw_deg: float
    half: float
    distance: float
    bays: int

    def place(
        self, x: float = 0.0, y: float = 0.0, z: float = 0.0, yaw_deg: float = 0.0
    ) -> np.ndarray:
        """Pose of a part at a place given in the side's own axes."""
        return pose(yaw_deg=self.yaw_deg) @ pose(x, self.distance + y, z, yaw_deg)


SIDES = (
    Side("north", 0, HALF_X, HALF_Y, 7),
    Side("east", -90, HALF_Y, HALF_X, 5),
    Side("south", 180, HALF_X, HALF_Y, 7),
    Side("west", 90, HALF_Y, HALF_X, 5),
)


def main() -> None:
    """Build the scene and print its size."""
    rng = np.random.default_rng(SEED)
    stage = Stage("courtyard", make_materials(rng))
    lay_floor(stage)
    build_arcades(stage)
    build_roofs(stage)
    build_wings(stage)
    hang_windows_and_doors(stage)
    open_south_side(stage)
    furnish(stage, rng)
    surround(stage, rng)
    size = stage.write(OUTPUT)
    print(
        f"{OUTPUT.name}: {size} bytes, {stage.triangle_count()} triangles, "
        f"{len(stage.nodes)} nodes, {len(stage.models)} meshes"
    )


def lay_floor(stage: Stage) -> None:
    """Paving, compass rose and cobbled path: rectangles of one grid, so no seams can open."""
    x_lines = [-HALF_X + arch.KERB, -ROSE, ROSE, *PATH_X, HALF_X - arch.KERB]
    y_lines = [-HALF_Y + arch.KERB, -ROSE, ROSE, HALF_Y - arch.KERB]
    paving, cobbles = [], []
    for x0, x1 in itertools.pairwise(x_lines):
        for y0, y1 in itertools.pairwise(y_lines):
            corners = [(x0, y0, 0), (x1, y0, 0), (x1, y1, 0), (x0, y1, 0)]
            if (x0, y0) == (-ROSE, -ROSE):
                rose = polygon(corners, [(0, 0), (1, 0), (1, 1), (0, 1)])
            else:
                (cobbles if x0 == PATH_X[0] else paving).append(polygon(corners))
    stage.place("compass_rose", Model("compass_rose", "compass_rose", rose))
    stage.place("court_paving", Model("court_paving", "paving", tile(join(paving), 2.2)))
    stage.place("cobbled_path", Model("cobbled_path", "cobbles", tile(join(cobbles), 1.65)))


def build_arcades(stage: Stage) -> None:
    """Columns, arches, banners, kerbs, walks, ceilings and beams of the four sides."""
    column, pier, beam, rod = arch.column(), arch.corner_pier(), arch.beam(), arch.banner_rod()
    lantern = furniture.lantern()
    for side in SIDES:
        name, bays = side.name, side.bays
        bay_arch, middle = arch.arch(name), (bays + 1) // 2
        for index in range(1, bays + 1):
            x = (index - middle) * arch.BAY
            stage.place(f"{name}_arch_{index:02}", bay_arch, side.place(x))
            if index % 2 == 1 and index != middle:
                at = side.place(x, 0, arch.SPRING + arch.ARCH_RADIUS)
                stage.place(f"{name}_lantern_{index:02}", lantern, at)
        for index in range(1, bays):
            x = (index - bays / 2) * arch.BAY
            stage.place(f"{name}_column_{index:02}", column, side.place(x))
            stage.place(f"{name}_beam_{index:02}", beam, side.place(x))
        stage.place(f"{name}_niche_wall", arch.niche_wall(name), side.place())
        stage.place(f"{name}_banner", arch.banner(name), side.place())
        stage.place(f"{name}_banner_rod", rod, side.place())
        stage.place(f"{name}_kerb", arch.kerb(name, side.half), side.place())
        open_end = arch.WALK + 0.45 if name == "south" else arch.WALK
        stage.place(f"{name}_walk", arch.walk(name, side.half, open_end), side.place())
        stage.place(f"{name}_ceiling", arch.ceiling(name, side.half), side.place())
    for corner, x, y in (("ne", 1, 1), ("se", 1, -1), ("sw", -1, -1), ("nw", -1, 1)):
        stage.place(f"corner_pier_{corner}", pier, pose(x * HALF_X, y * HALF_Y))


def build_roofs(stage: Stage) -> None:
    """Lean-to roofs over the walks, gutters in their valleys, gable roofs of the two wings."""
    foot, head = (arch.EAVE_EDGE, arch.ROOF_FOOT), (arch.WALK, arch.ROOF_TOP)
    long_slope = arch.tiled_slope("long_walk_roof", HALF_X, foot, head, 1, facets=3)
    short_slope = arch.tiled_slope("short_walk_roof", HALF_Y, foot, head, 1, facets=3)
    for side in SIDES:
        slope = long_slope if side.half == HALF_X else short_slope
        stage.place(f"{side.name}_walk_roof", slope, side.place())
    gutter = arch.valley_gutter()
    for corner, x, y, yaw in (
        ("ne", 1, 1, 0),
        ("nw", -1, 1, 90),
        ("sw", -1, -1, 180),
        ("se", 1, -1, 270),
    ):
        stage.place(f"valley_gutter_{corner}", gutter, pose(x * HALF_X, y * HALF_Y, 0, yaw))
    wing_foot, wing_head = (-2.55, WING_TOP + 0.02), (0.0, WING_TOP + 1.17)
    north = arch.tiled_slope("north_wing_roof", 12.4, wing_foot, wing_head, 0, facets=2)
    north_back = arch.tiled_slope("north_wing_roof_back", 12.4, wing_foot, wing_head, 0, facets=0)
    west = arch.tiled_slope("west_wing_roof", 9.2, wing_foot, wing_head, 0, facets=2)
    west_back = arch.tiled_slope("west_wing_roof_back", 9.2, wing_foot, wing_head, 0, facets=0)
    ridge_y, ridge_x = OUTER_Y + 2.15, -OUTER_X - 2.05
    stage.place("north_wing_roof_inner", north, pose(-1.85, ridge_y))
    stage.place("north_wing_roof_outer", north_back, pose(-1.85, ridge_y, 0, 180))
    stage.place("west_wing_roof_inner", west, pose(ridge_x, ridge_y - 9.1, 0, 90))
    stage.place("west_wing_roof_outer", west_back, pose(ridge_x, ridge_y - 9.1, 0, -90))
    ridge_z = wing_head[1] + 0.02
    ridges = [
        bar((-14.3, ridge_y, ridge_z), (10.6, ridge_y, ridge_z), 0.11, 8),
        bar((ridge_x, -8.5, ridge_z), (ridge_x, ridge_y, ridge_z), 0.11, 8),
    ]
    stage.place("wing_ridges", Model("wing_ridges", "roof_tiles", tile(join(ridges), 1.0)))


def build_wings(stage: Stage) -> None:
    """House walls north and west (two storeys), the garden wall east, their cornices."""
    outer_y, outer_x = OUTER_Y + 4.3, -OUTER_X - 4.1
    east, south = OUTER_X + 0.4, -OUTER_Y - 0.4
    panel, gable = arch.wall_panel, 1.1
    north_wall = [
        panel((-OUTER_X, OUTER_Y), (east, OUTER_Y), WING_TOP, under_ceiling=True),
        panel((east, OUTER_Y), (east, outer_y), WING_TOP, gable),
        panel((east, outer_y), (outer_x, outer_y), WING_TOP),
    ]
    west_wall = [
        panel((-OUTER_X, south), (-OUTER_X, OUTER_Y), WING_TOP, under_ceiling=True),
        panel((outer_x, outer_y), (outer_x, south), WING_TOP),
        panel((outer_x, south), (-OUTER_X, south), WING_TOP, gable),
    ]
    west_gable = panel((outer_x, outer_y), (outer_x, OUTER_Y), WING_TOP, gable)
    east_wall = [
        panel((OUTER_X, OUTER_Y), (OUTER_X, south), 4.8, under_ceiling=True),
        panel((OUTER_X, south), (east, south), 4.8),
        panel((east, south), (east, OUTER_Y), 4.8),
    ]
    for name, parts in (("north", north_wall), ("west", west_wall), ("east", east_wall)):
        stage.place(f"{name}_wall", Model(f"{name}_wall", f"{name}_wall", join(parts)))
    gable_top = west_gable.positions[-3:]
    stage.place("west_gable", Model("west_gable", "north_wall", tile(polygon(gable_top), 3.0)))
    coping = box((0.56, OUTER_Y - south, 0.12), (OUTER_X + 0.2, (OUTER_Y + south) / 2, 4.84))
    stage.place("east_wall_coping", Model("east_wall_coping", "ashlar", tile(coping, 1.6)))
    cornices = [
        box((OUTER_X + east, 0.16, 0.16), ((east - OUTER_X) / 2, OUTER_Y - 0.08, WING_TOP - 0.16)),
        box(
            (0.16, OUTER_Y - south, 0.16), (-OUTER_X + 0.08, (OUTER_Y + south) / 2, WING_TOP - 0.16)
        ),
    ]
    stage.place("wing_cornice", Model("wing_cornice", "ashlar", tile(join(cornices), 1.6)))
    chimney = Model(
        "chimney",
        "brick",
        tile(
            join(
                [
                    box((0.7, 0.7, 2.4), (0, 0, 1.2), "-z+z", courses=True),
                    box((0.86, 0.86, 0.14), (0, 0, 2.4)),
                    box((0.5, 0.5, 0.3), (0, 0, 2.6)),
                ]
            ),
            1.92,
        ),
    )
    for index, (x, y) in enumerate(((-11.2, -3.0), (-11.2, 3.5), (4.0, 9.0)), start=1):
        stage.place(f"chimney_{index:02}", chimney, pose(x, y, WING_TOP + 0.2))


def hang_windows_and_doors(stage: Stage) -> None:
    """Windows on both storeys of the house, windows and doors along the walks."""
    green, blue = arch.window("green_paint"), arch.window("blue_paint")
    pane, doors = (
        arch.window_pane(),
        {c: arch.door(c) for c in ("green_paint", "blue_paint", "dark_oak")},
    )
    plan = {
        "north": (
            green,
            (-6.6, -4.4, -2.2, 0, 2.2, 4.4, 6.6),
            (-6.6, -2.2, 2.2, 6.6),
            (-4.4, 4.4),
            "dark_oak",
        ),
        "east": (green, (), (-4.4, 0, 4.4), (-2.2,), "green_paint"),
        "west": (blue, (-4.4, -2.2, 0, 2.2, 4.4), (-4.4, 4.4), (-2.2, 2.2), "blue_paint"),
    }
    for side in SIDES:
        if side.name not in plan:
            continue
        model, upper, lower, door_places, door_kind = plan[side.name]
        spots = [(x, 4.86) for x in upper] + [(x, 1.1) for x in lower]
        for index, (x, z) in enumerate(spots, start=1):
            at = side.place(x, arch.WALK, z)
            stage.place(f"{side.name}_window_{index:02}", model, at)
            stage.place(f"{side.name}_window_{index:02}_glass", pane, at)
        for index, x in enumerate(door_places, start=1):
            at = side.place(x, arch.WALK, arch.STEP)
            stage.place(f"{side.name}_door_{index:02}", doors[door_kind], at)
    outside = [pose(x, OUTER_Y + 4.3, 4.3, 180) for x in (-9.9, -5.5, -1.1, 3.3, 7.7)]
    outside += [pose(-OUTER_X - 4.1, y, 4.3, 90 + 180) for y in (-5.0, -1.0, 3.0, 7.0)]
    for index, at in enumerate(outside, start=1):
        stage.place(f"outer_window_{index:02}", green, at)
        stage.place(f"outer_window_{index:02}_glass", pane, at)


def open_south_side(stage: Stage) -> None:
    """The south walk has no back wall: a second arcade, railings and a gate to the country."""
    south = next(side for side in SIDES if side.name == "south")
    bay_arch, column = stage.models["south_arch"], stage.models["column"]
    railing = Model("railing_panel", "wrought_iron", _railing(2.0, 0.95))
    gate_leaf = Model("gate_leaf", "wrought_iron", _railing(0.86, 1.45).shifted(x=0.43))
    for index in range(1, 10):
        x = (index - 5) * arch.BAY
        stage.place(f"south_outer_arch_{index:02}", bay_arch, south.place(x, arch.WALK))
        if x == -2 * arch.BAY:  # seen from the court, the gate is left of the middle: east
            for leaf, edge, yaw in (("east", -0.88, 70), ("west", 0.88, 110)):
                at = south.place(x + edge, arch.WALK, arch.STEP + 0.04, yaw)
                stage.place(f"south_gate_{leaf}", gate_leaf, at)
        else:
            at = south.place(x, arch.WALK, arch.STEP)
            stage.place(f"south_railing_{index:02}", railing, at)
    for index in range(10):
        x = (index - 4.5) * arch.BAY
        stage.place(f"south_outer_column_{index + 1:02}", column, south.place(x, arch.WALK))
    strip = box((2 * OUTER_X, 0.36, 1.5), (0, arch.WALK, arch.EAVE + 0.75), without="-x+x-z+z")
    stage.place(
        "south_wall_top", Model("south_wall_top", "south_wall", tile(strip, 3.0)), south.place()
    )
    coping = box((2 * OUTER_X, 0.5, 0.1), (0, arch.WALK, arch.EAVE + 1.54), without="-x+x")
    stage.place(
        "south_wall_coping", Model("south_wall_coping", "ashlar", tile(coping, 1.6)), south.place()
    )


def furnish(stage: Stage, rng: np.random.Generator) -> None:
    """Everything that stands on the paving."""
    bench, pot, planter = furniture.bench(), furniture.flower_pot(), furniture.planter_box()
    lemon, fruit = plants.lemon_tree(rng), plants.lemons(rng)
    cypress, amphora, crate = plants.potted_cypress(rng), furniture.amphora(), furniture.crate()
    for index, side in enumerate(SIDES, start=1):
        stage.place(f"bench_{index:02}", bench, side.place(0, -0.72))
        for number, x in enumerate((-1.35, 1.35), start=2 * index - 1):
            at = side.place(x, -0.78)
            stage.place(f"cypress_pot_{number:02}", pot, at)
            stage.place(f"cypress_{number:02}", cypress, at @ pose(z=0.42, yaw_deg=50 * number))
    for index, (x, y) in enumerate(((-6.3, 4.1), (6.3, 4.1), (6.3, -4.1), (-6.3, -4.1)), start=1):
        stage.place(f"planter_{index:02}", planter, pose(x, y))
        tree = pose(x, y, 0.48, 80 * index, 1.0 + 0.06 * index)
        stage.place(f"lemon_tree_{index:02}", lemon, tree)
        stage.place(f"lemons_{index:02}", fruit, tree)
    stage.place("fountain", furniture.fountain(), pose(-4.7, 1.6))
    stage.place("fountain_water", furniture.fountain_water(), pose(-4.7, 1.6))
    stage.place("sundial", furniture.sundial(), pose(2.2, -3.9))
    frame, parts = furniture.bicycle()
    leaning = pose(6.3, 2.55, 0, 100)
    stage.place("bicycle_frame", frame, leaning)
    stage.place("bicycle_parts", parts, leaning)
    for index, (x, y, z, yaw) in enumerate(
        ((-5.2, -3.9, 0, 12), (-4.5, -4.25, 0, -20), (-5.1, -3.95, 0.31, 35)), start=1
    ):
        stage.place(f"crate_{index:02}", crate, pose(x, y, z, yaw))
    for index, (x, y, size) in enumerate(
        ((-5.9, -3.1, 1.0), (-5.45, -2.75, 0.75), (5.75, -4.6, 1.1)), start=1
    ):
        stage.place(f"amphora_{index:02}", amphora, pose(x, y, 0, 70 * index, size))
    sphere = Model("garden_sphere", "sphere_red", furniture.ball(0.35, 11, 21).shifted(z=0.35))
    stage.place("garden_sphere", sphere, pose(2.3, 3.6))


def surround(stage: Stage, rng: np.random.Generator) -> None:
    """The country around."""
    stage.place("meadow", landscape.ground())
    stage.place("far_hills", landscape.far_hills())
    stage.place("road", landscape.road())
    landscape.plant_trees(stage, rng)
    landscape.build_houses(stage)
    landscape.fly_balloon(stage)
    landscape.build_tower(stage, stage.models["north_arch"])


def _railing(width: float, height: float) -> Patch:
    """Upright iron panel; the texture shows one meter of width."""
    half = width / 2
    corners = [(-half, 0, 0), (half, 0, 0), (half, 0, height), (-half, 0, height)]
    return polygon(corners, [(0, 0), (width, 0), (width, 0.999), (0, 0.999)])


if __name__ == "__main__":
    main()
