"""Settings of a bake."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from omnisim.core.short_repr import counted
from omnisim.scene.light.lighting import is_bright
from omnisim.scene.model import Scene

# Texels of an atlas without a given texel width: minutes on two cores at the default samples.
DEFAULT_TEXELS = 3 << 16
FINE_TEXELS = 3 << 19  # 9 MB of half floats, half of that in the file
DEFAULT_SAMPLES = 128


@dataclass(frozen=True)
class BakeSettings:
    """Settings of a bake; equal settings and scenes produce equal bytes."""

    texel_m: Annotated[float, Field(ge=1e-4, le=100.0)] | None = None
    """Width of a texel near the starts and paths; distant texels are coarser. Default: from
    the scene's area, so that the bake takes minutes."""
    samples: Annotated[int, Field(ge=1, le=65536)] = DEFAULT_SAMPLES
    """Number of rays per texel."""
    bounces: Annotated[int, Field(ge=0, le=1000)] = 16
    """Number of light bounces between surfaces; 0: direct light only."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    """Seed of the rays."""
    texels: int = DEFAULT_TEXELS
    """Maximum number of texels in the atlas, if `texel_m` is None."""


def emission_notes(scene: Scene) -> list[str]:
    """Notices on bright emissive materials of a scene without baked light."""
    shapes = (scene, *(moving.shape for moving in scene.objects))
    shining = sum(is_bright(material) for shape in shapes for material in shape.materials)
    if not shining or scene.lighting.is_matte or scene.lighting.baked is not None:
        return []
    return [
        f"{counted(shining, 'emissive material')} brighter than white: "
        "lights other surfaces only once baked, see omnisim bake"
    ]
