"""The two quality settings of all benchmarks."""

from __future__ import annotations

from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.camera.quality import QUALITIES

# Samples and texels along each side of a pixel.
SETTINGS = {name: QUALITIES[name]._asdict() for name in ("fast", "default")}


def at_setting(camera: OmniCamera, setting: str) -> OmniCamera:
    """Camera at a quality setting, a key of `SETTINGS`."""
    return camera.with_quality(setting)
