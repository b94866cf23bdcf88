"""Settings of a bake."""

from __future__ import annotations

from dataclasses import dataclass

from omnisim.core.short_repr import counted
from omnisim.scene.light.emissive_light import is_bright
from omnisim.scene.model import Scene

# Texels of an atlas without a given texel width: minutes on two cores at the default samples.
DEFAULT_TEXELS = 3 << 16
FINE_TEXELS = 3 << 19  # 9 MB of half floats, half of that in the file
DEFAULT_SAMPLES = 128
DEFAULT_BOUNCES = 16


@dataclass(frozen=True)
class BakeSettings:
    """Settings of a bake; equal settings and scenes produce equal bytes.

    Attributes:
        texel_m: width of a texel near the vehicles; None: chosen by the scene's area, so that the
            atlas has `texels`.
        samples: gathering rays per texel.
        bounces: reflections of light between lamps and the texel; 0: direct light only.
        seed: seed of the random numbers.
        texels: maximum number of texels in the atlas, if `texel_m` is None.
    """

    texel_m: float | None = None
    samples: int = DEFAULT_SAMPLES
    bounces: int = DEFAULT_BOUNCES
    seed: int = 0
    texels: int = DEFAULT_TEXELS


# Notices on emissive surfaces that must be baked to light a scene.


def emission_notes(scene: Scene) -> list[str]:
    """Notices on bright emissive materials of a scene without baked light."""
    shapes = (scene, *(one.shape for one in scene.objects))
    shining = sum(is_bright(material) for shape in shapes for material in shape.materials)
    if not shining or scene.lighting.is_matte or scene.lighting.baked is not None:
        return []
    return [
        f"{counted(shining, 'emissive material')} brighter than white: "
        "lights other surfaces only once baked, see omnisim bake"
    ]
