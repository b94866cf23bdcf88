"""Textures of baked light: the lightmap, and the probes as blocks of four numbers along z."""

from __future__ import annotations

import moderngl
import numpy as np

from omnisim.rendering.opengl.gl.gpu_textures import AnyTexture, texture_2d, texture_3d
from omnisim.rendering.opengl.gl.memory import gpu_allocation
from omnisim.rendering.opengl.gl.uniforms import find_uniform, set_sampler
from omnisim.scene.light.baked_light import BakedLight, Probes

_LIGHTMAP_UNIT, _PROBES_UNIT = 7, 8
_BLOCK = 4  # as in shaders/scene/baked_light.glsl


class BakedTextures:
    """Textures of a scene's baked light.

    Args:
        context: OpenGL context.
        baked: baked light of the scene.

    Raises:
        GraphicsError: larger than the GPU allows.
    """

    def __init__(self, context: moderngl.Context, baked: BakedLight):
        self._lightmap = _lightmap(context, baked)
        self._probes = _probes(context, baked.probes)

    @property
    def units(self) -> dict[int, AnyTexture]:
        """Textures by unit, for connected programs."""
        return {_LIGHTMAP_UNIT: self._lightmap, _PROBES_UNIT: self._probes}


def connect(program: moderngl.Program, baked: BakedLight) -> None:
    """Set the samplers and uniforms of a program that looks up baked light."""
    set_sampler(program, "u_lightmap", _LIGHTMAP_UNIT)
    set_sampler(program, "u_probes", _PROBES_UNIT)
    scale = find_uniform(program, "u_probes_per_m")
    if scale is not None:
        scale.write((1.0 / baked.probes.spacing_m).astype(np.float32))


def _lightmap(context: moderngl.Context, baked: BakedLight) -> moderngl.Texture:
    height, width = baked.irradiance.shape[:2]
    # four numbers per texel, which are fetched faster than three
    texels = np.ones((height, width, 4), dtype=np.float16)
    texels[..., :3] = baked.irradiance
    with gpu_allocation(f"baked light of {width} × {height} texels", "bake it coarser"):
        return texture_2d(context, (width, height), 4, texels, dtype="f2", is_linear=True)


def _probes(context: moderngl.Context, probes: Probes) -> moderngl.Texture3D:
    columns, rows, layers, numbers = probes.texels.shape
    blocks = probes.texels.reshape(columns, rows, layers, numbers // _BLOCK, _BLOCK)
    ordered = np.ascontiguousarray(blocks.transpose(3, 2, 1, 0, 4))
    size = (columns, rows, layers * len(ordered))
    with gpu_allocation(f"{probes.valid.size} probes of baked light", "bake it coarser"):
        return texture_3d(context, size, ordered)
