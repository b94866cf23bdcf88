"""glTF materials from arrays: textured, masked, plain, metal, glass, see-through."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image
from trimesh.visual.material import PBRMaterial

Color = tuple[float, float, float]


def textured(
    name: str,
    image: np.ndarray,
    roughness: float = 0.9,
    factor: Color = (1.0, 1.0, 1.0),
    lossless: bool = False,
) -> PBRMaterial:
    """Opaque, from a picture (height, width, 3) of sRGB values in [0, 1].

    It is stored as JPEG, or as PNG where `lossless`.
    """
    pixels = (np.clip(image, 0, 1) * 255 + 0.5).astype(np.uint8)
    picture = Image.fromarray(pixels)
    if not lossless:
        # The exporter stores an image as JPEG only where it was read from one.
        encoded = io.BytesIO()
        picture.save(encoded, format="JPEG", quality=92, subsampling=0)
        encoded.seek(0)
        picture = Image.open(encoded)
    return PBRMaterial(
        name=name,
        baseColorTexture=picture,
        baseColorFactor=_bytes((*factor, 1.0)),
        metallicFactor=0.0,
        roughnessFactor=roughness,
    )


def masked(name: str, image: np.ndarray) -> PBRMaterial:
    """With holes, seen from both sides, from a picture (height, width, 4), stored as PNG."""
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


def plain(name: str, color: Color, roughness: float = 0.9) -> PBRMaterial:
    """One opaque color, linear RGB."""
    return PBRMaterial(
        name=name,
        baseColorFactor=_bytes((*color, 1.0)),
        metallicFactor=0.0,
        roughnessFactor=roughness,
    )


def metal(name: str, color: Color, roughness: float) -> PBRMaterial:
    """Bare metal that reflects in one color, linear RGB."""
    return PBRMaterial(
        name=name,
        baseColorFactor=_bytes((*color, 1.0)),
        metallicFactor=1.0,
        roughnessFactor=roughness,
    )


def glass(
    name: str, color: Color = (1.0, 1.0, 1.0), roughness: float = 0.0, is_pane: bool = True
) -> PBRMaterial:
    """Glass that tints light in linear RGB at each surface; its extensions make it transparent.

    A pane has two sides; a body of thick glass has a front, and an inside.
    """
    return PBRMaterial(
        name=name,
        baseColorFactor=_bytes((*color, 1.0)),
        metallicFactor=0.0,
        roughnessFactor=roughness,
        doubleSided=is_pane or None,
    )


def see_through(
    name: str, color: tuple[float, float, float, float], roughness: float
) -> PBRMaterial:
    """One blended color, linear RGBA."""
    return PBRMaterial(
        name=name,
        baseColorFactor=_bytes(color),
        metallicFactor=0.0,
        roughnessFactor=roughness,
        alphaMode="BLEND",
    )


def _bytes(color: tuple[float, ...]) -> np.ndarray:
    return np.round(np.array(color) * 255).astype(np.uint8)
