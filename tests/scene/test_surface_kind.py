"""Kinds of surfaces, by the properties of their materials."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

import omnisim
from omnisim.scene.model import AlphaMode, Material, Texture
from omnisim.scene.parts import SlabMaterial
from omnisim.scene.surface_kind import NO_KIND, SurfaceKind, kind_of, lobe_roughnesses, mask_of

CHROME = Material("chrome", metallic=1.0, roughness=0.0)
SATIN = Material("satin", metallic=1.0, roughness=0.4)
GLASS = Material("glass", specular=1.0, roughness=0.0, transmission=1.0)
MAP = Texture(np.full((2, 2, 4), 128, dtype=np.uint8))
HALF_AS_ROUGH = Texture(np.array([[[0, 255, 0, 255], [0, 127.5, 0, 255]]]).astype(np.uint8))
PLANAR = SurfaceKind.PLANAR_MIRROR
SMOOTH = SurfaceKind.GLOSSY | SurfaceKind.MIRROR
PANE = SMOOTH | SurfaceKind.PANE | SurfaceKind.PLANAR_PANE | SurfaceKind.SPECULAR


@pytest.mark.parametrize(
    ("material", "expected"),
    [
        (Material(), SurfaceKind.MATTE),
        (dataclasses.replace(GLASS, unlit=True), SurfaceKind.UNLIT | SurfaceKind.MATTE),
        (Material(emissive=(1.0, 0.0, 0.0)), NO_KIND),
        (Material(occlusion_map=MAP), NO_KIND),
        (Material(alpha_mode=AlphaMode.MASK), SurfaceKind.CUTOUT | SurfaceKind.MATTE),
        (Material(alpha_mode=AlphaMode.MASK, alpha_cutoff=0.0), SurfaceKind.MATTE),
        (Material(alpha_mode=AlphaMode.BLEND), SurfaceKind.BLENDED | SurfaceKind.MATTE),
        (Material(metallic=1.0, roughness=0.6), NO_KIND),
        (SATIN, SurfaceKind.GLOSSY),
        (CHROME, SMOOTH | PLANAR | SurfaceKind.SPECULAR),
        (
            dataclasses.replace(SATIN, clearcoat=1.0),
            SMOOTH | PLANAR | SurfaceKind.ROUGH_MIRROR | SurfaceKind.SPECULAR,
        ),
        (
            dataclasses.replace(SATIN, roughness=0.3),
            SurfaceKind.GLOSSY | PLANAR | SurfaceKind.ROUGH_MIRROR,
        ),
        (GLASS, PANE),
        (dataclasses.replace(GLASS, metallic=1.0), SMOOTH | PLANAR | SurfaceKind.SPECULAR),
        (
            dataclasses.replace(GLASS, thickness_m=0.1),
            SMOOTH | SurfaceKind.GLASS | PLANAR | SurfaceKind.SPECULAR,
        ),
        (
            SlabMaterial(specular=1.0, roughness=0.0, transmission=1.0, thickness_m=0.1),
            PANE | SurfaceKind.SLAB,
        ),
        (SlabMaterial(specular=1.0, roughness=0.0, transmission=1.0), PANE),
        (
            dataclasses.replace(GLASS, roughness=0.4),
            SurfaceKind.GLOSSY | SurfaceKind.FROSTED_PANE,
        ),
        (
            dataclasses.replace(GLASS, roughness=0.4, thickness_m=0.1),
            SurfaceKind.GLOSSY | SurfaceKind.FROSTED_GLASS,
        ),
    ],
)
def test_kinds_of_materials(material, expected):
    assert kind_of(material) == expected


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({}, True),
        ({"roughness": 0.3}, True),
        ({"roughness": 0.31}, False),
        ({"roughness": 0.5, "clearcoat": 1.0}, True),
        ({"metallic": 0.0}, False),
        ({"metallic": 0.0, "specular": 1.0}, True),
        ({"normal_map": MAP}, False),
        ({"clearcoat_normal_map": MAP}, False),
        ({"unlit": True}, False),
        ({"alpha_mode": AlphaMode.BLEND}, False),
        ({"alpha_mode": AlphaMode.MASK, "alpha_cutoff": 0.0}, False),
    ],
)
def test_materials_of_planar_mirrors(change, expected):
    assert (PLANAR in kind_of(dataclasses.replace(CHROME, **change))) is expected


def test_scenes_shaded_as_matte_have_neither_glass_nor_mirrors():
    fence = dataclasses.replace(CHROME, alpha_mode=AlphaMode.MASK)
    kinds = [kind_of(one, is_matte=True) for one in (CHROME, GLASS, fence)]
    assert kinds == [SurfaceKind.MATTE] * 2 + [SurfaceKind.MATTE | SurfaceKind.CUTOUT]
    assert kind_of(GLASS, is_matte=False) is kind_of(GLASS)


def test_masks_are_of_any_asked_kind():
    kinds = [kind_of(CHROME), kind_of(GLASS), kind_of(SATIN)]
    assert mask_of(kinds, SurfaceKind.PANE | PLANAR).tolist() == [True, True, False]
    assert mask_of([], SurfaceKind.PANE).shape == (0,)


@pytest.mark.parametrize(
    ("material", "expected"),
    [
        (CHROME, [0.0]),
        (SATIN, [0.4]),
        (dataclasses.replace(CHROME, clearcoat=1.0, clearcoat_roughness=0.2), [0.0, 0.2]),
        (Material(roughness=1.0, clearcoat=1.0), [0.0]),
        (dataclasses.replace(SATIN, metallic_roughness_map=HALF_AS_ROUGH), [0.4, 0.2]),
    ],
)
def test_gloss_and_coats_have_roughnesses(material, expected):
    np.testing.assert_allclose(lobe_roughnesses(material), expected, atol=1e-3)


def test_only_kinds_are_asked():
    """Textures read the alpha mode as well, for the mip levels of masks."""
    package = Path(omnisim.__file__).parent
    rooms = "rendering", "sensors", "runs", "apps", "plots", "scene/light", "scene/space"
    field = re.compile(r"\b(material|one)\.(alpha_mode|thickness_m|transmission)\b")
    asking = [
        f"{path.name}: {line.strip()}"
        for room in rooms
        for path in (package / room).rglob("*.py")
        for line in path.read_text().splitlines()
        if field.search(line) and not line.strip().startswith("is_masked = ")
    ]
    assert not asking
