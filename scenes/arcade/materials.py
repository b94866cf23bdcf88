"""Materials of the arcade: stone, glass, metal, light, and one atlas for all else."""

from __future__ import annotations

import numpy as np
from trimesh.visual.material import PBRMaterial

from scenes.arcade.painted_pictures import make_pictures
from scenes.arcade.plan import WALLS
from scenes.modeling import interior_textures as indoor
from scenes.modeling import surface_textures as surface
from scenes.modeling.pbr_materials import Color, glass, metal, plain, textured
from scenes.modeling.picture_atlas import Atlas, pack

# Luminance of what shines, times its color: 1 is white.
EMISSIVE = {
    "lamp_warm": 16.0,
    "lamp_cool": 16.0,
    "globe": 9.0,
    "neon_amber": 2.4,
    "neon_red": 2.4,
    "neon_pink": 2.4,
    "neon_blue": 2.4,
    "neon_green": 2.4,
}
_LIGHTS: dict[str, Color] = {
    "lamp_warm": (1.0, 0.83, 0.62),
    "lamp_cool": (0.92, 0.97, 1.0),
    "globe": (1.0, 0.86, 0.66),
    "neon_amber": (1.0, 0.48, 0.10),
    "neon_red": (1.0, 0.12, 0.08),
    "neon_pink": (1.0, 0.20, 0.62),
    "neon_blue": (0.16, 0.46, 1.0),
    "neon_green": (0.16, 1.0, 0.36),
}
_TRANSMISSION, _VOLUME, _IOR = (f"KHR_materials_{n}" for n in ("transmission", "volume", "ior"))
# Glass of bottles and vases: what is left of white light after a distance in meters.
_BODIES: dict[str, tuple[Color, float, float]] = {
    "crystal": ((0.96, 0.99, 0.98), 0.30, 1.54),
    "cobalt": ((0.10, 0.22, 0.86), 0.012, 1.52),
    "amber_glass": ((0.90, 0.42, 0.06), 0.012, 1.52),
    "bottle_green": ((0.16, 0.62, 0.22), 0.012, 1.52),
    "ruby": ((0.80, 0.05, 0.08), 0.010, 1.52),
}
EXTENSIONS: dict[str, dict[str, dict]] = {
    "pane": {_TRANSMISSION: {"transmissionFactor": 1.0}},
    "roof_glass": {_TRANSMISSION: {"transmissionFactor": 1.0}},
    "frosted": {_TRANSMISSION: {"transmissionFactor": 1.0}},
    **{
        name: {
            _TRANSMISSION: {"transmissionFactor": 1.0},
            _IOR: {"ior": ior},
            _VOLUME: {
                "thicknessFactor": 0.1,
                "attenuationColor": list(color),
                "attenuationDistance": distance_m,
            },
        }
        for name, (color, distance_m, ior) in _BODIES.items()
    },
}
METALS = {
    "mirror": ((0.93, 0.95, 0.94), 0.0),
    "chrome": ((0.78, 0.79, 0.80), 0.03),
    "brushed_steel": ((0.66, 0.66, 0.67), 0.3),
    "brass": ((0.89, 0.66, 0.30), 0.35),
}
STONES = ("terrazzo_light", "terrazzo_dark", "terrazzo_red")
GLOSSY = frozenset({*EXTENSIONS, *METALS, *STONES})
TILES = {"terrazzo_light": 0.9, "terrazzo_dark": 0.7, "terrazzo_red": 0.7, "ashlar": 2.4}
TILES |= {"oak_floor": 2.0, "checker_floor": 1.6}
CELL = 64  # pixels that show one meter of a material in the atlas
ATLAS = 896
# Colors of props, in sRGB.
_PAINTS: dict[str, Color] = {
    "joinery": (0.13, 0.25, 0.21),
    "moulding": (0.86, 0.81, 0.70),
    "iron": (0.17, 0.20, 0.21),
    "lacquer": (0.08, 0.09, 0.10),
    "white": (0.91, 0.91, 0.89),
    "ivory": (0.88, 0.83, 0.72),
    "grey": (0.55, 0.56, 0.58),
    "red": (0.72, 0.13, 0.11),
    "wine": (0.40, 0.10, 0.16),
    "orange": (0.87, 0.45, 0.13),
    "mustard": (0.80, 0.62, 0.18),
    "moss": (0.30, 0.42, 0.20),
    "leaf": (0.26, 0.50, 0.16),
    "teal": (0.16, 0.46, 0.48),
    "navy": (0.13, 0.18, 0.36),
    "denim": (0.28, 0.40, 0.62),
    "lilac": (0.60, 0.50, 0.72),
    "pink": (0.86, 0.47, 0.58),
    "terracotta": (0.72, 0.41, 0.29),
    "leather": (0.42, 0.26, 0.16),
}


def make_materials(rng: np.random.Generator) -> tuple[dict[str, PBRMaterial], Atlas]:
    """All materials by name, and the atlas of the material "props"."""
    atlas, image = _props(rng)
    made = [
        textured("props", image, roughness=0.8),
        *_stones(rng),
        textured("ashlar", _ashlar(256, rng)),
        textured("oak_floor", indoor.floorboards(256, 12, (0.62, 0.45, 0.28), rng)),
        textured(
            "checker_floor", indoor.checker(256, 4, (0.86, 0.83, 0.76), (0.20, 0.21, 0.22), rng)
        ),
        plain("plaster", (0.74, 0.72, 0.67)),
        _from_both_sides(plain("foliage", (0.05, 0.19, 0.03))),
        plain("asphalt", (0.12, 0.12, 0.13)),
        plain("pavement", (0.38, 0.37, 0.35)),
        glass("pane", (0.96, 0.985, 0.97)),
        glass("roof_glass", (0.93, 0.96, 0.95)),
        glass("frosted", (0.72, 0.80, 0.79), roughness=0.6),
    ]
    made += [plain(name, color) for name, color in (WALLS | _LIGHTS).items()]
    made += [metal(name, color, roughness) for name, (color, roughness) in METALS.items()]
    made += [glass(name, is_pane=False) for name in _BODIES]
    return {material.name: material for material in made}, atlas


def _from_both_sides(material: PBRMaterial) -> PBRMaterial:
    material.doubleSided = True
    return material


def _stones(rng: np.random.Generator) -> list[PBRMaterial]:
    """Polished terrazzo, of roughness 0.1."""
    grounds = {
        "terrazzo_light": ((0.70, 0.66, 0.58), 512, 900),
        "terrazzo_dark": ((0.17, 0.19, 0.19), 256, 320),
        "terrazzo_red": ((0.44, 0.17, 0.13), 256, 320),
    }
    return [
        textured(name, indoor.terrazzo(size, chips, ground, rng), roughness=0.1)
        for name, (ground, size, chips) in grounds.items()
    ]


def _ashlar(size: int, rng: np.random.Generator) -> np.ndarray:
    """Dressed limestone in courses."""
    return surface.mottled(size, (0.80, 0.74, 0.62), 0.10, rng) * _courses(size)


def _courses(size: int) -> np.ndarray:
    """Darkness of the joints of six courses of stones, two to a course, in a running bond."""
    y = (np.arange(size) + 0.5)[:, None] * 6 / size * np.ones((1, size))
    x = (np.arange(size) + 0.5)[None, :] * 2 / size + 0.5 * (y.astype(int) % 2)
    from_joint = np.minimum(np.minimum(y % 1, 1 - y % 1), 3 * np.minimum(x % 1, 1 - x % 1))
    return np.where(from_joint < 0.03, 0.72, 1.0)[..., None]


def _props(rng: np.random.Generator) -> tuple[Atlas, np.ndarray]:
    """Atlas of paints, wood and pictures."""
    cells = {name: surface.mottled(CELL, hue, 0.06, rng) for name, hue in _PAINTS.items()}
    cells["oak"] = surface.planks(CELL, 3, (0.58, 0.41, 0.25), rng)
    cells["walnut"] = surface.planks(CELL, 3, (0.34, 0.22, 0.14), rng)
    return pack(cells | make_pictures(rng), ATLAS)
