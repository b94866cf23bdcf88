"""Textures of materials on the GPU, each uploaded once, with mip levels."""

from __future__ import annotations

from collections.abc import Collection

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import GraphicsError
from omnisim.gpu.gl_functions import upload_mip_level
from omnisim.scene.masked_mipmaps import masked_mipmaps
from omnisim.scene.mipmaps import mipmaps
from omnisim.scene.model import AlphaMode, Material, Mesh, Texture, Wrap

SRGB8_ALPHA8 = 0x8C43


class MaterialTextures:
    """Textures of the materials that were asked for."""

    def __init__(self, context: moderngl.Context):
        self._context = context
        # by id; the texture is kept so that its id is not used again
        self._textures: dict[tuple[int, float | None], tuple[Texture, moderngl.Texture]] = {}
        self._white = self._upload(np.full((1, 1, 4), 255, dtype=np.uint8), None, "")

    def find(self, material: Material, mesh: Mesh) -> moderngl.Texture:
        """Texture of a material on a mesh; white where either has none.

        Raises:
            GraphicsError: it is larger than the GPU allows.
        """
        texture = material.texture
        if texture is None or mesh.texture_coordinates is None:
            return self._white
        cutoff = material.alpha_cutoff if material.alpha_mode is AlphaMode.MASK else None
        key = (id(texture), cutoff)
        if key not in self._textures:
            uploaded = self._upload(texture.pixels, cutoff, f" of {material.name!r}")
            uploaded.repeat_x = texture.wrap_u is not Wrap.CLAMP_TO_EDGE
            uploaded.repeat_y = texture.wrap_v is not Wrap.CLAMP_TO_EDGE
            self._textures[key] = texture, uploaded
        return self._textures[key][1]

    def keep(self, used: Collection[moderngl.Texture]) -> None:
        """Forget all textures but the used ones."""
        self._textures = {key: pair for key, pair in self._textures.items() if pair[1] in used}

    def _upload(
        self, pixels: NDArray[np.uint8], cutoff: float | None, used_by: str
    ) -> moderngl.Texture:
        height, width = pixels.shape[:2]
        limit = int(self._context.info["GL_MAX_TEXTURE_SIZE"])
        if max(height, width) > limit:
            raise GraphicsError(
                f"a texture{used_by} has {width} × {height} texels: this GPU takes at most {limit}"
            )
        texture = self._context.texture(
            (width, height), 4, np.ascontiguousarray(pixels), internal_format=SRGB8_ALPHA8
        )
        levels = mipmaps(pixels) if cutoff is None else masked_mipmaps(pixels, cutoff)
        upload_levels(texture, levels)
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        return texture


def upload_levels(texture: moderngl.Texture, levels: list[NDArray[np.uint8]]) -> None:
    """Give a texture of format `SRGB8_ALPHA8` its levels 1, 2, … down to one texel.

    moderngl allocates levels only by letting the driver make them.
    """
    texture.use()
    for number, level in enumerate(levels, start=1):
        upload_mip_level(number, SRGB8_ALPHA8, (level.shape[1], level.shape[0]), level.tobytes())
