"""The materials of the map: floors, walls, ceilings, and one atlas for everything else."""

from __future__ import annotations

import numpy as np
from trimesh.visual.material import PBRMaterial

from scenes.mapping.painted_pictures import make_pictures
from scenes.modeling import interior_textures as indoor
from scenes.modeling import surface_textures as surface
from scenes.modeling.pbr_materials import Color, plain, see_through, textured
from scenes.modeling.picture_atlas import Atlas, pack

# Panels of 4000 lm each, 0.43 m2: 2960 cd/m2. The exposure shows a white surface under 450 lx as
# white, and these as pi times luminance over 450 lx.
EMISSIVE = {"lamp_white": 20.7}
CELL = 96  # pixels that show one meter of a material in the atlas
ATLAS = 1408

# Floor materials and how many meters their pictures show.
FLOORS = {
    "stone_floor": 2.4,
    "lino_green": 3.0,
    "lino_sand": 3.0,
    "lino_blue": 3.0,
    "lino_mint": 3.0,
    "chequer_floor": 2.4,
    "carpet_blue": 2.0,
    "carpet_green": 2.0,
    "carpet_red": 2.0,
    "parquet": 2.4,
    "floorboards": 2.4,
    "concrete_floor": 4.0,
    "painted_concrete": 4.0,
    "raised_floor": 2.4,
    "mosaic_floor": 1.2,
    "terrazzo": 0.9,
}
# Wall materials and how many meters their pictures show; 3 m pictures stand on the floor.
WALLS = {
    "plaster_sand": 3.0,
    "plaster_green": 3.0,
    "plaster_orange": 3.0,
    "plaster_blue": 3.0,
    "paint_yellow": 3.0,
    "paint_grey": 3.0,
    "paint_red": 3.0,
    "paint_terracotta": 3.0,
    "paint_mint": 3.0,
    "paint_lilac": 3.0,
    "wallpaper": 2.0,
    "panelling": 3.0,
    "brick": 1.92,
    "blocks": 1.6,
    "kitchen_tiles": 1.5,
    "bath_tiles": 1.2,
    "metal_wall": 2.4,
    "broken_wall": 3.0,
}
CEILINGS = {"ceiling_panels": 2.4, "ceiling_broken": 2.4, "ceiling_plaster": 3.0}
SIZES = {**FLOORS, **WALLS, **CEILINGS}


def make_materials(rng: np.random.Generator) -> tuple[dict[str, PBRMaterial], Atlas]:
    """Materials of the scene by name, and the rectangles of the atlas called "props"."""
    atlas, image = pack({**_swatches(rng), **make_pictures(rng)}, ATLAS)
    made = [textured("props", image, roughness=0.8), *_floors(rng), *_walls(rng)]
    panels = indoor.ceiling_panels
    made += [
        textured("ceiling_panels", panels(256, 4, rng)),
        textured("ceiling_broken", panels(256, 4, rng, missing=4)),
        textured("ceiling_plaster", surface.mottled(128, (0.92, 0.91, 0.88), 0.06, rng)),
        textured("grass", surface.grass(256, rng)),
        textured("asphalt", surface.mottled(128, (0.36, 0.36, 0.37), 0.30, rng)),
        plain("lamp_white", (1.0, 0.98, 0.94)),
        plain("lamp_off", (0.74, 0.74, 0.72)),
        plain("lamp_housing", (0.80, 0.80, 0.80)),
        plain("far_hills", (0.36, 0.45, 0.50)),
        see_through("glass", (0.62, 0.76, 0.78, 0.22), roughness=0.1),
        see_through("frosted_glass", (0.86, 0.90, 0.90, 0.62), roughness=0.4),
    ]
    return {material.name: material for material in made}, atlas


def _floors(rng: np.random.Generator) -> list[PBRMaterial]:
    gray, pale = (0.46, 0.47, 0.48), (0.80, 0.77, 0.70)
    blue, white = (0.22, 0.40, 0.56), (0.86, 0.88, 0.88)
    return [
        textured("stone_floor", indoor.checker(512, 4, pale, (0.70, 0.65, 0.57), rng)),
        textured("lino_green", indoor.linoleum(384, (0.56, 0.62, 0.52), rng)),
        textured("lino_sand", indoor.linoleum(384, (0.72, 0.62, 0.46), rng)),
        textured("lino_blue", indoor.linoleum(384, (0.46, 0.54, 0.62), rng)),
        textured("lino_mint", indoor.linoleum(384, (0.66, 0.78, 0.72), rng)),
        textured(
            "chequer_floor", indoor.checker(384, 8, (0.88, 0.87, 0.83), (0.26, 0.27, 0.29), rng)
        ),
        textured("carpet_blue", indoor.carpet(384, 4, (0.26, 0.34, 0.50), rng)),
        textured("carpet_green", indoor.carpet(384, 4, (0.36, 0.44, 0.30), rng)),
        textured("carpet_red", indoor.carpet(384, 4, (0.48, 0.25, 0.24), rng)),
        textured("parquet", indoor.parquet(512, 6, 5, (0.66, 0.45, 0.26), rng)),
        textured("floorboards", indoor.floorboards(512, 16, (0.52, 0.34, 0.21), rng)),
        textured("concrete_floor", indoor.concrete(512, (0.56, 0.55, 0.52), rng)),
        textured("painted_concrete", indoor.concrete(512, (0.50, 0.55, 0.56), rng, slabs=2)),
        textured("raised_floor", indoor.checker(384, 4, gray, (0.42, 0.43, 0.45), rng)),
        textured("mosaic_floor", indoor.tiled_wall(384, 8, blue, white, 0.30, rng)),
        textured("terrazzo", indoor.terrazzo(512, 420, (0.62, 0.58, 0.53), rng)),
    ]


def _walls(rng: np.random.Generator) -> list[PBRMaterial]:
    cream = (0.92, 0.90, 0.84)
    paint, brick = indoor.painted_wall, surface.brick(512, 24, rng)
    dados: dict[str, tuple[Color, Color]] = {
        "plaster_sand": ((0.93, 0.90, 0.84), (0.70, 0.60, 0.45)),
        "plaster_green": ((0.90, 0.91, 0.84), (0.38, 0.54, 0.40)),
        "plaster_orange": ((0.94, 0.90, 0.82), (0.82, 0.52, 0.26)),
        "plaster_blue": ((0.89, 0.91, 0.92), (0.30, 0.44, 0.62)),
    }
    made = [
        textured(name, paint(384, wall, dado, 1.05, rng, line=tuple(0.7 * c for c in dado)))
        for name, (wall, dado) in dados.items()
    ]
    plain_walls: dict[str, Color] = {
        "paint_yellow": (0.92, 0.84, 0.56),
        "paint_grey": (0.80, 0.81, 0.82),
        "paint_red": (0.66, 0.22, 0.20),
        "paint_terracotta": (0.80, 0.52, 0.38),
        "paint_mint": (0.76, 0.88, 0.82),
        "paint_lilac": (0.78, 0.74, 0.86),
    }
    made += [textured(name, paint(128, hue, hue, 0.0, rng)) for name, hue in plain_walls.items()]
    broken = indoor.broken_plaster(_repeated(brick, 512), (0.74, 0.72, 0.66), 0.34, rng)
    tiles = indoor.tiled_wall(384, 10, (0.93, 0.93, 0.90), (0.66, 0.66, 0.64), 0.06, rng)
    made += [
        textured(
            "wallpaper", indoor.wallpaper(384, 10, (0.84, 0.87, 0.76), (0.62, 0.72, 0.56), rng)
        ),
        textured("panelling", indoor.wood_panelling(512, 5, (0.60, 0.40, 0.24), rng)),
        textured("brick", brick),
        textured("blocks", indoor.blockwork(384, 8, cream, rng)),
        textured("kitchen_tiles", tiles),
        textured("bath_tiles", indoor.tiled_wall(384, 8, (0.42, 0.66, 0.72), cream, 0.22, rng)),
        textured("metal_wall", indoor.metal_panels(384, 4, (0.72, 0.75, 0.78), rng)),
        textured("broken_wall", broken),
    ]
    return made


def _repeated(image: np.ndarray, size: int) -> np.ndarray:
    """Two copies each way, for a picture that shows twice as much wall."""
    return np.tile(image, (2, 2, 1))[::2, ::2][:size, :size]


def _swatches(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Materials of props."""
    cloudy: dict[str, tuple[Color, float]] = {
        "white": ((0.92, 0.92, 0.90), 0.05),
        "ivory": ((0.88, 0.84, 0.74), 0.06),
        "grey": ((0.62, 0.63, 0.64), 0.08),
        "dark_grey": ((0.32, 0.33, 0.35), 0.12),
        "black": ((0.12, 0.12, 0.13), 0.20),
        "steel": ((0.70, 0.72, 0.74), 0.14),
        "red": ((0.74, 0.14, 0.12), 0.10),
        "yellow": ((0.92, 0.74, 0.16), 0.10),
        "green": ((0.20, 0.50, 0.32), 0.10),
        "blue": ((0.16, 0.34, 0.62), 0.10),
        "orange": ((0.90, 0.46, 0.14), 0.10),
        "teal": ((0.12, 0.50, 0.52), 0.10),
        "fabric_blue": ((0.24, 0.32, 0.50), 0.34),
        "fabric_red": ((0.58, 0.20, 0.20), 0.34),
        "fabric_green": ((0.32, 0.46, 0.28), 0.34),
        "fabric_mustard": ((0.78, 0.58, 0.20), 0.34),
        "leather": ((0.36, 0.22, 0.15), 0.30),
        "cardboard": ((0.70, 0.54, 0.36), 0.16),
        "soil": ((0.26, 0.19, 0.14), 0.60),
        "leaf": ((0.24, 0.42, 0.18), 0.40),
        "dark_leaf": ((0.15, 0.30, 0.16), 0.40),
        "bark": ((0.36, 0.28, 0.21), 0.40),
        "terracotta": ((0.72, 0.42, 0.29), 0.24),
        "porcelain": ((0.94, 0.95, 0.95), 0.03),
        "mirror": ((0.64, 0.74, 0.78), 0.10),
        "dark_window": ((0.14, 0.18, 0.22), 0.30),
        "plasterboard": ((0.82, 0.80, 0.74), 0.30),
        "rust": ((0.46, 0.27, 0.17), 0.55),
        "concrete": ((0.56, 0.55, 0.53), 0.34),
    }
    woods: dict[str, Color] = {
        "beech": (0.80, 0.62, 0.42),
        "oak": (0.64, 0.46, 0.28),
        "walnut": (0.40, 0.26, 0.17),
    }
    made = {
        name: surface.mottled(CELL, color, strength, rng)
        for name, (color, strength) in cloudy.items()
    }
    made |= {name: surface.planks(CELL, 2, color, rng) for name, color in woods.items()}
    made["crate_wood"] = surface.planks(CELL, 8, (0.66, 0.52, 0.34), rng)
    made["bricks"] = surface.brick(CELL, 12, rng)
    return made
