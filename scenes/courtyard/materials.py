"""The materials of the courtyard: names, textures and plain factors."""

from __future__ import annotations

import numpy as np
from trimesh.visual.material import PBRMaterial

from scenes.courtyard import painted_textures as painted
from scenes.modeling import surface_textures as surface
from scenes.modeling.geometry import Patch, fit_to_rectangle
from scenes.modeling.pbr_materials import Color, masked, plain, see_through, textured

# side: (wall, dado and accent, banner cloth, banner ink)
SIDE_COLORS: dict[str, tuple[Color, Color, Color, Color]] = {
    "north": ((0.93, 0.89, 0.81), (0.62, 0.64, 0.60), (0.13, 0.22, 0.44), (0.96, 0.92, 0.80)),
    "east": ((0.80, 0.47, 0.34), (0.55, 0.25, 0.19), (0.95, 0.90, 0.78), (0.56, 0.13, 0.11)),
    "south": ((0.93, 0.76, 0.42), (0.72, 0.45, 0.17), (0.15, 0.34, 0.25), (0.97, 0.90, 0.66)),
    "west": ((0.66, 0.78, 0.85), (0.30, 0.45, 0.57), (0.58, 0.12, 0.15), (0.97, 0.86, 0.58)),
}
ARCH_TEXTURE_HEIGHT_RATIO = 1.35 / 2.2


def make_materials(rng: np.random.Generator) -> dict[str, PBRMaterial]:
    """Every material of the scene by name."""
    made = [
        textured("paving", surface.paving(512, 8, rng)),
        textured("compass_rose", painted.compass_rose(1024, 16, rng)),
        textured("terracotta_floor", surface.terracotta_floor(512, 8, rng), roughness=0.8),
        textured("cobbles", surface.cobbles(512, 12, rng)),
        textured("ashlar", surface.ashlar(512, 8, rng)),
        textured("brick", surface.brick(512, 24, rng)),
        textured("roof_tiles", surface.roof_tiles(512, 8, 6, rng)),
        textured(
            "ceiling_planks",
            surface.planks(256, 8, (0.50, 0.35, 0.22), rng),
            factor=(0.75, 0.75, 0.75),
        ),
        textured("grass", surface.grass(512, rng)),
        textured("props", painted.prop_atlas(1024, rng), roughness=0.8),
        textured("balloon_stripes", painted.balloon_stripes(192)),
        plain("far_hills", (0.36, 0.45, 0.50)),
        plain("bicycle_enamel", (0.02, 0.22, 0.20), roughness=0.35),
        plain("sphere_red", (0.65, 0.03, 0.02), roughness=0.4),
        see_through("window_glass", (0.62, 0.74, 0.80, 0.35), roughness=0.1),
        see_through("water", (0.16, 0.46, 0.50, 0.62), roughness=0.05),
        masked("foliage", painted.foliage(256, rng)),
        masked("wrought_iron", painted.railing(128)),
    ]
    for side, (wall, accent, cloth, ink) in SIDE_COLORS.items():
        made.append(textured(f"{side}_wall", surface.plaster_wall(512, wall, accent, rng)))
        front = painted.arch_front(512, round(512 * ARCH_TEXTURE_HEIGHT_RATIO), wall, accent, rng)
        made.append(textured(f"{side}_arch", front))
        made.append(
            textured(f"{side}_banner", painted.banner(320, 416, side.upper(), cloth, ink, rng))
        )
    return {material.name: material for material in made}


def in_material(cell: str, patch: Patch) -> Patch:
    """Give a part one of the prop atlas's materials, e.g. "oak"."""
    index = painted.PROP_CELLS.index(cell)
    return fit_to_rectangle(patch, (index % 4) / 4, 1 - (index // 4 + 1) / 4, 1 / 4)
