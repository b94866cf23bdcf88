"""The materials of the courtyard: names, textures and plain factors."""

from __future__ import annotations

import io

import numpy as np
import painted_textures as painted
import surface_textures as surface
from geometry import Patch, fit_to_rectangle
from PIL import Image
from trimesh.visual.material import PBRMaterial

Colour = tuple[float, float, float]

# side: (wall, dado and accent, banner cloth, banner ink)
SIDE_COLOURS: dict[str, tuple[Colour, Colour, Colour, Colour]] = {
    "north": ((0.93, 0.89, 0.81), (0.62, 0.64, 0.60), (0.13, 0.22, 0.44), (0.96, 0.92, 0.80)),
    "east": ((0.80, 0.47, 0.34), (0.55, 0.25, 0.19), (0.95, 0.90, 0.78), (0.56, 0.13, 0.11)),
    "south": ((0.93, 0.76, 0.42), (0.72, 0.45, 0.17), (0.15, 0.34, 0.25), (0.97, 0.90, 0.66)),
    "west": ((0.66, 0.78, 0.85), (0.30, 0.45, 0.57), (0.58, 0.12, 0.15), (0.97, 0.86, 0.58)),
}
ARCH_TEXTURE_HEIGHT_RATIO = 1.35 / 2.2


def make_materials(rng: np.random.Generator) -> dict[str, PBRMaterial]:
    """Every material of the scene by name."""
    made = [
        _textured("paving", surface.paving(512, 8, rng)),
        _textured("compass_rose", painted.compass_rose(1024, 16, rng)),
        _textured("terracotta_floor", surface.terracotta_floor(512, 8, rng), roughness=0.8),
        _textured("cobbles", surface.cobbles(512, 12, rng)),
        _textured("ashlar", surface.ashlar(512, 8, rng)),
        _textured("brick", surface.brick(512, 24, rng)),
        _textured("roof_tiles", surface.roof_tiles(512, 8, 6, rng)),
        _textured(
            "ceiling_planks",
            surface.planks(256, 8, (0.50, 0.35, 0.22), rng),
            factor=(0.75, 0.75, 0.75),
        ),
        _textured("grass", surface.grass(512, rng)),
        _textured("props", painted.prop_atlas(1024, rng), roughness=0.8),
        _textured("balloon_stripes", painted.balloon_stripes(192)),
        _plain("far_hills", (0.36, 0.45, 0.50)),
        _plain("bicycle_enamel", (0.02, 0.22, 0.20), roughness=0.35),
        _plain("sphere_red", (0.65, 0.03, 0.02), roughness=0.4),
        PBRMaterial(
            name="window_glass",
            baseColorFactor=_bytes((0.62, 0.74, 0.80, 0.35)),
            metallicFactor=0.0,
            roughnessFactor=0.1,
            alphaMode="BLEND",
        ),
        PBRMaterial(
            name="water",
            baseColorFactor=_bytes((0.16, 0.46, 0.50, 0.62)),
            metallicFactor=0.0,
            roughnessFactor=0.05,
            alphaMode="BLEND",
        ),
        _masked("foliage", painted.foliage(256, rng)),
        _masked("wrought_iron", painted.railing(128)),
    ]
    for side, (wall, accent, cloth, ink) in SIDE_COLOURS.items():
        made.append(_textured(f"{side}_wall", surface.plaster_wall(512, wall, accent, rng)))
        front = painted.arch_front(512, round(512 * ARCH_TEXTURE_HEIGHT_RATIO), wall, accent, rng)
        made.append(_textured(f"{side}_arch", front))
        made.append(
            _textured(f"{side}_banner", painted.banner(320, 416, side.upper(), cloth, ink, rng))
        )
    return {material.name: material for material in made}


def in_material(cell: str, patch: Patch) -> Patch:
    """Give a part one of the prop atlas's materials, e.g. "oak"."""
    index = painted.PROP_CELLS.index(cell)
    return fit_to_rectangle(patch, (index % 4) / 4, 1 - (index // 4 + 1) / 4, 1 / 4)


def _textured(
    name: str, image: np.ndarray, roughness: float = 0.9, factor: Colour = (1.0, 1.0, 1.0)
) -> PBRMaterial:
    pixels = (np.clip(image, 0, 1) * 255 + 0.5).astype(np.uint8)
    # The exporter stores an image as JPEG only where it was read from one.
    encoded = io.BytesIO()
    Image.fromarray(pixels).save(encoded, format="JPEG", quality=92, subsampling=0)
    encoded.seek(0)
    return PBRMaterial(
        name=name,
        baseColorTexture=Image.open(encoded),
        baseColorFactor=_bytes((*factor, 1.0)),
        metallicFactor=0.0,
        roughnessFactor=roughness,
    )


def _masked(name: str, image: np.ndarray) -> PBRMaterial:
    pixels = (np.clip(image, 0, 1) * 255 + 0.5).astype(np.uint8)
    return PBRMaterial(
        name=name,
        baseColorTexture=Image.fromarray(pixels),
        metallicFactor=0.0,
        roughnessFactor=0.9,
        alphaMode="MASK",
        alphaCutoff=0.5,
        doubleSided=True,
    )


def _plain(name: str, colour: Colour, roughness: float = 0.9) -> PBRMaterial:
    return PBRMaterial(
        name=name,
        baseColorFactor=_bytes((*colour, 1.0)),
        metallicFactor=0.0,
        roughnessFactor=roughness,
    )


def _bytes(colour: tuple[float, ...]) -> np.ndarray:
    return np.round(np.array(colour) * 255).astype(np.uint8)
