"""Filter of the noise of gathered light, within charts and surfaces that are about as bright."""

from __future__ import annotations

from omnisim.baking.bake import BakedPatches
from omnisim.baking.patches import Patches
from omnisim.baking.sampling import Floats


def denoised(patches: Patches, baked: BakedPatches) -> Floats:
    """Gathered light (p, 3) of patches without most of its noise."""
    return baked.gathered
