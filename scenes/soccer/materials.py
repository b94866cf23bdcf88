"""The materials of the laboratory: names, textures and plain factors."""

from __future__ import annotations

import numpy as np
from trimesh.visual.material import PBRMaterial

from scenes.modeling import surface_textures as surface
from scenes.modeling.geometry import Patch, fit_to_rectangle
from scenes.modeling.pbr_materials import Color, masked, plain, see_through, textured
from scenes.soccer import interior_textures as interior
from scenes.soccer import pictures

# Materials that shine by themselves.
UNLIT = frozenset({"outside", "screens"})
# Of two tubes of 5200 lm each in a lamp, 1.5 m long and 26 mm wide: 13 500 cd/m2. The exposure
# shows a white surface under 600 lx as white, and these as pi times luminance over 600 lx.
EMISSIVE = {"lamp_glow": 75.0}
WALL_HUES: dict[str, Color] = {
    "north": (0.90, 0.89, 0.86),
    "east": (0.84, 0.87, 0.84),
    "south": (0.91, 0.88, 0.82),
    "west": (0.86, 0.86, 0.89),
}
# Colors of props, in sRGB, in the order of the atlas: 6 x 6 from the top left, by rows.
# What comes near a landmark's color is duller than it, none is the same.
PAINTS: dict[str, Color] = {
    "white_board": (0.90, 0.90, 0.88),
    "light_grey": (0.76, 0.77, 0.77),
    "mid_grey": (0.54, 0.55, 0.57),
    "dark_grey": (0.30, 0.31, 0.33),
    "black": (0.13, 0.13, 0.14),
    "cream": (0.87, 0.82, 0.70),
    "beech": (0.78, 0.62, 0.42),
    "oak": (0.60, 0.43, 0.27),
    "dark_wood": (0.36, 0.25, 0.17),
    "cardboard": (0.68, 0.53, 0.36),
    "steel": (0.64, 0.66, 0.68),
    "brass": (0.66, 0.55, 0.30),
    "denim": (0.26, 0.36, 0.55),
    "navy": (0.13, 0.18, 0.34),
    "teal": (0.22, 0.48, 0.52),
    "pale_blue": (0.58, 0.71, 0.80),
    "slate": (0.36, 0.42, 0.50),
    "petrol": (0.10, 0.30, 0.38),
    "red": (0.68, 0.14, 0.12),
    "brick": (0.60, 0.30, 0.23),
    "wine": (0.42, 0.10, 0.18),
    "rose": (0.80, 0.50, 0.58),
    "plum": (0.45, 0.24, 0.42),
    "orange": (0.85, 0.42, 0.13),
    "straw": (0.85, 0.75, 0.45),
    "mustard": (0.72, 0.57, 0.18),
    "sand": (0.78, 0.71, 0.58),
    "olive": (0.43, 0.45, 0.22),
    "moss": (0.28, 0.38, 0.20),
    "mint": (0.60, 0.76, 0.64),
    "bottle": (0.10, 0.32, 0.22),
    "terracotta": (0.70, 0.41, 0.29),
    "soil": (0.24, 0.18, 0.13),
    "leather": (0.40, 0.25, 0.16),
    "khaki": (0.56, 0.52, 0.40),
    "paper": (0.93, 0.92, 0.88),
}
_SIDE = 6


def make_materials(palette: dict[str, Color], rng: np.random.Generator) -> dict[str, PBRMaterial]:
    """Every material of the scene by name; `palette` has the landmarks' colors, linear RGB."""
    made = [
        textured("carpet", interior.carpet(512, rng), roughness=1.0),
        textured("floor", interior.linoleum(512, rng), roughness=0.6),
        textured("ceiling", interior.ceiling_panels(256, rng)),
        textured("concrete", surface.mottled(256, (0.66, 0.65, 0.63), 0.07, rng)),
        textured("paints", _paint_atlas(576, rng), roughness=0.7),
        textured("pictures", pictures.atlas(rng), roughness=0.6),
        textured("screens", pictures.screens(rng), roughness=0.3),
        textured("outside", interior.outside(1024, 256, rng)),
        textured("lawn", surface.grass(256, rng)),
        masked("leaves", interior.leaf(64)),
        plain("line_white", (0.78, 0.78, 0.78)),
        # as a camera has them whose white is a sheet on the field, which the carpet makes greener
        plain("lamp_glow", (0.95, 0.935, 1.0)),
        see_through("window_glass", (0.70, 0.80, 0.84, 0.10), roughness=0.1),
    ]
    made += [plain(f"landmark_{name}", color) for name, color in palette.items()]
    plaster = surface.mottled(256, (1.0, 1.0, 1.0), 0.03, rng)
    made += [textured(f"wall_{side}", plaster * np.array(hue)) for side, hue in WALL_HUES.items()]
    return {material.name: material for material in made}


def painted_in(paint: str, patch: Patch) -> Patch:
    """Give a part one of `PAINTS`."""
    index = list(PAINTS).index(paint)
    column, row = index % _SIDE, index // _SIDE
    return fit_to_rectangle(patch, column / _SIDE, 1 - (row + 1) / _SIDE, 1 / _SIDE)


def _paint_atlas(size: int, rng: np.random.Generator) -> np.ndarray:
    """All small-object materials in one picture, so that each object is one mesh."""
    cell = size // _SIDE
    wooden = {"beech", "oak", "dark_wood"}
    cells = [
        surface.planks(cell, 3, hue, rng)
        if name in wooden
        else surface.mottled(cell, hue, 0.08, rng)
        for name, hue in PAINTS.items()
    ]
    rows = [np.concatenate(cells[i : i + _SIDE], axis=1) for i in range(0, len(cells), _SIDE)]
    return np.concatenate(rows, axis=0)
