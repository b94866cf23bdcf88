"""The two settings of quality that are raced everywhere."""

from __future__ import annotations

import dataclasses

from omnisim.sensors import OmniCamera

_DEFAULT = OmniCamera()
# Captured pixels and texels to a side of a pixel.
SETTINGS = {
    "fast": {"supersampling": 2, "texels_per_pixel": 1.0},
    "default": {
        "supersampling": _DEFAULT.supersampling,
        "texels_per_pixel": _DEFAULT.texels_per_pixel,
    },
}


def at_setting(camera: OmniCamera, setting: str) -> OmniCamera:
    """The same camera, at one of `SETTINGS`."""
    return dataclasses.replace(camera, **SETTINGS[setting])
