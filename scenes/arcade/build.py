"""Build arcade.glb: python -m scenes.arcade.build.

World axes: x along the passage from the street to the mirror, y to the left of that, z up, meters;
the origin is on the threshold, on the floor. The same code always writes the same bytes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scenes.arcade import furniture, glassware
from scenes.arcade.display import Display
from scenes.arcade.ends import build_ends
from scenes.arcade.materials import EMISSIVE, EXTENSIONS, GLOSSY, make_materials
from scenes.arcade.plan import BAY, HALF, RIDGE, front_named
from scenes.arcade.shell import build_shell
from scenes.arcade.shopfronts import build_fronts
from scenes.arcade.shops import furnish_shops
from scenes.modeling.geometry import pose
from scenes.modeling.stage import Stage

SEED = 1838
OUTPUT = Path(__file__).with_name("arcade.glb")


def main() -> None:
    """Build the scene and print its size."""
    rng = np.random.default_rng(SEED)
    materials, atlas = make_materials(rng)
    stage = Stage(
        "arcade",
        materials,
        emissive=EMISSIVE,
        is_matte=True,
        glossy=GLOSSY,
        extensions=EXTENSIONS,
    )
    show = Display(stage, atlas, rng)
    build_shell(show)
    build_fronts(show)
    build_ends(show)
    furnish_shops(show)
    furnish_passage(show)
    size = stage.write(OUTPUT, compact=True)
    print(
        f"{OUTPUT.name}: {size} bytes, {stage.triangle_count()} triangles, "
        f"{len(stage.nodes)} nodes, {len(stage.models)} meshes"
    )


def furnish_passage(show: Display) -> None:
    """Lamps, bollards, benches, plants and the glass ball at the end."""
    for k in range(5):
        at = pose(BAY * (k + 1), 0.0, RIDGE - 1.3 - 0.16)
        show.put("lamp_globe", show.made(furniture.globe), at)
        show.put("lamp_globe_rod", show.made(furniture.globe_chain), at)
    bollard = show.made(glassware.chrome_ball)
    for y in (-1.35, 1.35):
        show.put("chrome_ball", bollard, pose(1.1, y, 0.2, scale=0.2))
    show.put("chrome_ball", bollard, pose(12.5, 1.75, 0.35, scale=0.35))
    looking = front_named("looking")
    for x in (-1.55, 1.55):
        show.put("bench", show.made(furniture.bench), looking.place(x, -0.02))
    for x, y in ((10.0, HALF - 0.55), (20.0, -HALF + 0.55), (10.0, -HALF + 0.55)):
        show.plant(1400, pose(x, y, 0.0, 7 * x))
    show.put("plinth", show.made(furniture.plinth, "ivory", 500, 850), pose(27.2))
    ball = show.made(glassware.glass_ball, "crystal")
    show.put("glass_ball", ball, pose(27.2, 0.0, 0.85 + 0.256, scale=0.26))


if __name__ == "__main__":
    main()
