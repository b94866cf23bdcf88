"""The two settings of quality that are raced everywhere."""

from __future__ import annotations

from omnisim.sensors import OmniCamera
from omnisim.sensors.quality import QUALITIES

# Captured pixels and texels to a side of a pixel.
SETTINGS = {name: QUALITIES[name]._asdict() for name in ("fast", "default")}


def at_setting(camera: OmniCamera, setting: str) -> OmniCamera:
    """The same camera, at one of `SETTINGS`."""
    return camera.with_quality(setting)
