"""Textures of a stage, from files and package members, each decoded once."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pxr import Ar

from omnisim.core.files.sources import note_file, read_source
from omnisim.scene.files.asset_resolver import AssetResolver
from omnisim.scene.formats.omissions import Omissions
from omnisim.scene.formats.usd.shading.shading import TextureSource
from omnisim.scene.parts import Texture, Wrap
from omnisim.scene.textures import TextureStore, unreadable_image

CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3}
_WRAPS = {"clamp": Wrap.CLAMP_TO_EDGE, "black": Wrap.CLAMP_TO_EDGE}


class TextureFiles:
    """Textures by their sources; each unreadable one is reported once."""

    def __init__(self, assets: AssetResolver, textures: TextureStore, notices: Omissions):
        self._assets, self._textures, self._notices = assets, textures, notices
        self._images: dict[str, Image.Image | None] = {}
        self._packed: dict[object, Texture | None] = {}

    def texture(self, source: TextureSource, material: str) -> Texture | None:
        """Texture of a source, before its scale and bias; None: unreadable."""
        image = self._image(source)
        if image is None:
            return None
        for wrap in set(source.wraps) & {"black"}:
            self._notices.count(f"wrap mode {wrap}: the texture's edge is drawn", "texture")
        s, t = (_WRAPS.get(wrap, Wrap.REPEAT) for wrap in source.wraps)
        mirrored = (source.wraps[0] == "mirror", source.wraps[1] == "mirror")
        return self._textures.texture(image, material, (s, t), mirrored)

    def normals(self, source: TextureSource, material: str) -> Texture | None:
        """Normal map with glTF's encoding, 0 to 255 for −1 to 1; None: unreadable.

        Sources without a scale and a bias are assumed to have this encoding.
        """
        key = ("normals", source)
        if key not in self._packed:
            texture = self.texture(source, material)
            levels = [
                _levels(0.5 * scale, 0.5 * bias + 0.5)
                for scale, bias in zip(source.scale[:3], source.bias[:3], strict=True)
            ]
            plain = np.arange(256)
            is_plain = not any(source.bias) or all(np.array_equal(one, plain) for one in levels)
            if texture is not None and not is_plain:
                pixels = texture.pixels.copy()
                for channel, table in enumerate(levels):
                    pixels[..., channel] = table[pixels[..., channel]]
                texture = replace(texture, pixels=pixels)
            self._packed[key] = None if texture is None else replace(texture, is_linear=True)
        return self._packed[key]

    def packed(
        self,
        planes: dict[int, tuple[TextureSource, str]],
        base: TextureSource | None,
        material: str,
    ) -> Texture | None:
        """Texture with channels of other textures, after their scale and bias.

        Args:
            planes: source and its channel (r, g, b or a), by target channel (0 to 3).
            base: source of the remaining channels; None: 255.
            material: material name, for notices.

        Returns:
            Packed texture; None: no source is readable.
        """
        key = (tuple(sorted(planes.items())), base)
        if key not in self._packed:
            self._packed[key] = self._pack(planes, base, material)
        return self._packed[key]

    def _pack(
        self,
        planes: dict[int, tuple[TextureSource, str]],
        base: TextureSource | None,
        material: str,
    ) -> Texture | None:
        read = {
            channel: (texture, _plane(texture.pixels, source, name))
            for channel, (source, name) in planes.items()
            if (texture := self.texture(source, material)) is not None
        }
        first = None if base is None else self.texture(base, material)
        if not read:
            return first
        like = first or next(iter(read.values()))[0]
        shape = np.max(
            [like.pixels.shape[:2], *(plane.shape for _, plane in read.values())], axis=0
        )
        pixels = np.full((*shape, 4), 255, dtype=np.uint8)
        if first is not None:
            pixels[:] = _resized(first.pixels, shape)
        for channel, (_, plane) in read.items():
            pixels[..., channel] = _resized(plane, shape)
        return replace(like, pixels=pixels)

    def _image(self, source: TextureSource) -> Image.Image | None:
        """Image, not yet decoded; None: missing or in an unknown format."""
        key = source.resolved or source.path
        if key not in self._images:
            self._images[key] = self._open(source)
        return self._images[key]

    def _open(self, source: TextureSource) -> Image.Image | None:
        if not source.path:
            self._notices.count("texture without a file is not drawn", "texture")
            return None
        try:
            data = content_of(source.resolved) or self._assets[source.path]
        except OSError:  # reported by the resolver
            return None
        try:
            return Image.open(io.BytesIO(data))
        except Exception:  # Pillow's readers raise exceptions of any type
            self._assets.faults[source.path] = unreadable_image(data)
            return None


def content_of(resolved: str) -> bytes:
    """Content of a file or package member; empty if unreadable."""
    if not resolved:
        return b""
    package = Ar.SplitPackageRelativePathOuter(resolved)[0]
    if not Path(package).is_file():  # reading a device might never end
        return b""
    if package == resolved:
        return read_source(Path(resolved))
    note_file(Path(package))
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved))
    return b"" if asset is None else bytes(asset.GetBuffer())


def _plane(pixels: NDArray[np.uint8], source: TextureSource, channel: str) -> NDArray[np.uint8]:
    """Levels (height, width) of a channel, after its scale and bias."""
    index = CHANNELS.get(channel, 0)
    scale, bias = source.scale[index], source.bias[index]
    if (scale, bias) == (1.0, 0.0):
        return pixels[..., index]
    plane: NDArray[np.uint8] = _levels(scale, bias)[pixels[..., index]]
    return plane


def _levels(scale: float, bias: float) -> NDArray[np.uint8]:
    """Lookup table (256,) of levels after a scale and a bias."""
    values = np.rint(np.arange(256) * scale + 255.0 * bias)
    levels: NDArray[np.uint8] = np.clip(values, 0, 255).astype(np.uint8)
    return levels


def _resized(pixels: NDArray[np.uint8], shape: NDArray[np.integer]) -> NDArray[np.uint8]:
    """Pixels (height, width, 4), resampled by nearest neighbor to another height and width."""
    if pixels.shape[:2] == tuple(shape):
        return pixels
    rows = np.arange(shape[0]) * pixels.shape[0] // shape[0]
    columns = np.arange(shape[1]) * pixels.shape[1] // shape[1]
    resized: NDArray[np.uint8] = pixels[rows[:, None], columns]
    return resized
