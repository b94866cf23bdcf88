"""Decoding of images into textures."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from omnisim.core.arrays import Bytes
from omnisim.scene.parts import AlphaMode, Texture, Wrap

if TYPE_CHECKING:  # slow to import, and scenes need not have textures
    from PIL.Image import Image

MAX_SIDE_PX = 32768
NO_IMAGE = "is not an image that can be read"  # completes a message about an image file


# Formats that Pillow cannot read, by their magic bytes.
_UNSUPPORTED = {b"\xabKTX 20": "KTX 2", b"\xabKTX 11": "KTX"}


def unreadable_image(data: bytes | memoryview) -> str:
    """Reason why an image file cannot be opened: an unsupported or an unknown format."""
    name = _UNSUPPORTED.get(bytes(data[:7]))
    return NO_IMAGE if name is None else f"is a {name} image, which is not supported"


class TextureStore:
    """Textures decoded from images, each image once for all materials.

    Attributes:
        notices: one line for each image that cannot be decoded.
    """

    def __init__(self) -> None:
        self.notices: list[str] = []
        self._textures: dict[tuple[object, ...], Texture | None] = {}
        # by id; holding the image keeps its id from being reused
        self._pixels: dict[int, tuple[Image, Bytes | None]] = {}

    def texture(
        self,
        image: Image,
        used_by: str,
        wraps: tuple[Wrap, Wrap] = (Wrap.REPEAT, Wrap.REPEAT),
        mirrored: tuple[bool, bool] = (False, False),
        is_linear: bool = False,
    ) -> Texture | None:
        """Texture of an image, or None if it cannot be decoded.

        Args:
            image, used_by: opened image, and the name of its material, for notices.
            wraps: wrapping modes along u and v.
            mirrored: True along u or v: append the mirror image along that axis.
            is_linear: True for values, False for sRGB-encoded colors.
        """
        key = (id(image), wraps, mirrored, is_linear)
        if key not in self._textures:
            pixels = self._decode(image, used_by)
            for axis in (1, 0):
                if pixels is not None and mirrored[1 - axis]:
                    pixels = np.concatenate((pixels, np.flip(pixels, axis)), axis)
            self._textures[key] = None if pixels is None else Texture(pixels, *wraps, is_linear)
        return self._textures[key]

    def _decode(self, image: Image, used_by: str) -> Bytes | None:
        if id(image) not in self._pixels:
            pixels = None
            try:
                pixels = rgba8(image)
            except Exception as reason:  # Pillow's readers raise exceptions of any type
                self.notices.append(
                    f"texture of {used_by!r} cannot be decoded ({reason}): its plain color is drawn"
                )
            self._pixels[id(image)] = (image, pixels)
        return self._pixels[id(image)][1]


@contextmanager
def large_textures() -> Iterator[None]:
    """Context that suppresses Pillow's size warning; it still rejects images too large for GPUs."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Image size .* exceeds limit")
        yield


def rgba8(image: Image) -> Bytes:
    """Pixels (height, width, 4) uint8 of an image in any mode; Pillow raises if it is damaged.

    Raises:
        ValueError: the image is larger than any GPU's textures, so damaged or malicious.
    """
    if max(image.size) > MAX_SIDE_PX:
        raise ValueError(f"expected at most {MAX_SIDE_PX} px per side, got {max(image.size)}")
    if image.mode.startswith(("I", "F")):  # 16-bit gray, which Pillow would clip
        gray = np.asarray(image, dtype=np.float64)
        gray = gray / 257.0 if image.mode.startswith("I") else gray * 255.0
        levels = np.clip(np.rint(gray), 0, 255).astype(np.uint8)
        opaque = np.full_like(levels, 255)
        return np.stack((levels, levels, levels, opaque), axis=-1)
    return np.array(image.convert("RGBA"), dtype=np.uint8)


def alpha_mode_of(texture: Texture | None) -> AlphaMode:
    """Alpha mode of a texture, for formats that do not state it.

    Purely binary alpha is a mask, as for leaves and fences; intermediate alpha is glass.
    """
    if texture is None:
        return AlphaMode.OPAQUE
    alpha = texture.pixels[..., 3]
    if not (alpha < 255).any():
        return AlphaMode.OPAQUE
    between = (alpha > 7) & (alpha < 248)
    # leaves have soft edges: up to a tenth of intermediate texels still counts as a mask
    return AlphaMode.MASK if between.mean() < 0.1 else AlphaMode.BLEND
