"""Classes of the effects, each imported when it is needed."""

from __future__ import annotations

from importlib import import_module
from typing import Any

# Modules of the effects in this package: an ideal camera needs none of them.
EFFECT_MODULES = {
    "Bayer": "bayer",
    "ChromaticAberration": "chromatic_aberration",
    "Defocus": "defocus",
    "Dirt": "dirt",
    "Encoding": "encoding",
    "Exposure": "exposure",
    "Jpeg": "jpeg",
    "Noise": "noise",
    "PointSpread": "point_spread",
    "Reflectance": "reflectance",
    "Shutter": "shutter",
    "Vignetting": "vignetting",
    "WhiteBalance": "white_balance",
}


def effect_classes() -> dict[str, Any]:
    """Classes of all effects by name."""
    return {
        name: getattr(import_module(f"{__package__}.{module}"), name)
        for name, module in EFFECT_MODULES.items()
    }
