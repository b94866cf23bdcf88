"""Kind of a surface: glass, mirror, cutout and so on, decided here, once for each material.

Back ends, sensors, bakes and notices ask `kind_of`; and how much light its glass transmits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Flag, auto
from weakref import WeakKeyDictionary

import numpy as np

from omnisim.core.arrays import Bools
from omnisim.scene.parts import AlphaMode, Material, SlabMaterial
from omnisim.scene.surface_reflectance import MIN_ROUGHNESS

# Rougher surfaces reflect the prefiltered sky and surroundings only, by rays; and rougher planar
# mirrors do so by virtual cameras.
MAX_TRACED_ROUGHNESS, MAX_MIRRORED_ROUGHNESS = 0.5, 0.3
MAX_PANE_ROUGHNESS = 0.2  # rougher glass is frosted: it scatters what it transmits


class SurfaceKind(Flag):
    """Kind of a surface, a combination of flags; without any, it is opaque with rough gloss.

    `kind & SurfaceKind.REFLECTING` is true if a surface has any of the combined flags.
    """

    UNLIT = auto()  # shows its base color in any light
    MATTE = auto()  # Lambertian or unlit: no gloss, metal, maps or emission
    CUTOUT = auto()  # has holes, where its alpha is below the cutoff
    BLENDED = auto()  # its alpha blends it with the background
    PANE = auto()  # clear glass that light passes straight
    SLAB = auto()  # pane with two faces, which traced images refract; has PANE, too
    GLASS = auto()  # body of clear glass, which refracts
    FROSTED_PANE = auto()  # thin glass that scatters what it transmits
    FROSTED_GLASS = auto()  # thick glass that does so
    GLOSSY = auto()  # gloss, metal or a clear coat reflects the scene, at least somewhere
    MIRROR = auto()  # reflects like a mirror, at least somewhere; has GLOSSY, too
    # flat parts of these show one mirrored view: no holes, no blending, no normal maps
    PLANAR_PANE = auto()
    PLANAR_MIRROR = auto()  # mirror or gloss, up to `MAX_MIRRORED_ROUGHNESS`; no pane
    ROUGH_MIRROR = auto()  # planar mirror with gloss or coat rougher than a smooth mirror
    SPECULAR = auto()  # planar pane, or smooth mirror: beams and depths are followed there

    HOLES = CUTOUT | BLENDED
    SEE_THROUGH = BLENDED | PANE  # drawn back to front
    REFRACTING = SLAB | GLASS
    FROSTED = FROSTED_PANE | FROSTED_GLASS
    REFLECTING = GLOSSY | PANE | GLASS  # shows the scene in traced images


NO_KIND = SurfaceKind(0)
_WITHOUT_GLOSS = SurfaceKind.UNLIT | SurfaceKind.HOLES
_KINDS: WeakKeyDictionary[Material, SurfaceKind] = WeakKeyDictionary()


def kind_of(material: Material, is_matte: bool = False) -> SurfaceKind:
    """Kind of a material's surfaces, which is decided once.

    Args:
        is_matte: the scene is shaded as matte: surfaces are neither glass nor mirrors.
    """
    if material not in _KINDS:
        _KINDS[material] = _decide(material)
    kind = _KINDS[material]
    return kind & _WITHOUT_GLOSS | SurfaceKind.MATTE if is_matte else kind


def _decide(material: Material) -> SurfaceKind:
    kind = NO_KIND
    if material.alpha_mode is AlphaMode.BLEND:
        kind = SurfaceKind.BLENDED
    elif material.alpha_mode is AlphaMode.MASK and material.alpha_cutoff > 0.0:
        kind = SurfaceKind.CUTOUT
    if material.unlit:
        return kind | SurfaceKind.UNLIT | SurfaceKind.MATTE
    strengths = (
        material.metallic, material.specular, material.clearcoat, material.transmission,
        *material.emissive,
    )  # fmt: skip
    if not (any(strengths) or any(texture is not None for texture in material.maps)):
        return kind | SurfaceKind.MATTE
    if material.transmission * (1.0 - material.metallic) > 0.0:
        kind |= _glass(material)
    roughnesses = lobe_roughnesses(material)
    smoothest = min(roughnesses, default=math.inf)
    if smoothest <= MAX_TRACED_ROUGHNESS:
        kind |= SurfaceKind.GLOSSY
    if smoothest <= MIN_ROUGHNESS:
        kind |= SurfaceKind.MIRROR
    has_normal_map = material.normal_map or material.clearcoat_normal_map
    if material.alpha_mode is not AlphaMode.OPAQUE or has_normal_map is not None:
        return kind
    if kind & SurfaceKind.PANE:
        kind |= SurfaceKind.PLANAR_PANE
    elif smoothest <= MAX_MIRRORED_ROUGHNESS:
        kind |= SurfaceKind.PLANAR_MIRROR
        if max(roughnesses) > MIN_ROUGHNESS:
            kind |= SurfaceKind.ROUGH_MIRROR
    if kind & (SurfaceKind.PANE | SurfaceKind.MIRROR):
        kind |= SurfaceKind.SPECULAR
    return kind


def _glass(material: Material) -> SurfaceKind:
    is_thick = material.thickness_m > 0.0
    if material.roughness > MAX_PANE_ROUGHNESS:
        return SurfaceKind.FROSTED_GLASS if is_thick else SurfaceKind.FROSTED_PANE
    if not is_thick:
        return SurfaceKind.PANE
    is_slab = isinstance(material, SlabMaterial)
    return SurfaceKind.PANE | SurfaceKind.SLAB if is_slab else SurfaceKind.GLASS


def lobe_roughnesses(material: Material) -> list[float]:
    """Roughnesses that the gloss and the coat of a material have somewhere."""
    roughnesses = []
    if material.metallic or material.specular:
        roughnesses.append(material.roughness)
        if material.metallic_roughness_map is not None:
            least = float(material.metallic_roughness_map.pixels[..., 1].min()) / 255.0
            roughnesses.append(least * material.roughness)
    if material.clearcoat:
        roughnesses.append(material.clearcoat_roughness)
    return roughnesses


def mask_of(kinds: Sequence[SurfaceKind], asked: SurfaceKind) -> Bools:
    """Mask (n,) of surfaces, by their kinds (n,), that have any of the asked flags."""
    return np.array([bool(kind & asked) for kind in kinds], dtype=np.bool_)


def transmitted(material: Material, asked: SurfaceKind) -> float:
    """Transmitted share of the light that a face does not reflect; 0 if it is of no asked kind."""
    return material.transmission * (1.0 - material.metallic) if kind_of(material) & asked else 0.0


def pane_transmission(material: Material) -> float:
    """Transmitted share of the light that a pane, with all of its faces, does not reflect."""
    share = transmitted(material, SurfaceKind.PANE)
    return share**2 if SurfaceKind.SLAB in kind_of(material) else share


def clear_share(material: Material) -> float:
    """Share of perpendicular light, mean of RGB, that passes a surface of clear glass."""
    once = ((material.ior - 1.0) / (material.ior + 1.0)) ** 2
    passing = pane_transmission(material) + transmitted(material, SurfaceKind.GLASS)
    passing = passing * (1.0 - once) / (1.0 + once)
    return passing * sum(material.base_color[:3]) / 3.0
