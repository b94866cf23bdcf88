"""Rendering: from a camera and a scene to frames and ground truth, by OpenGL or by rays."""

from typing import TYPE_CHECKING

from omnisim.core.lazy_names import lazy_names

if TYPE_CHECKING:
    from omnisim.rendering.camera.omnicamera import OmniCamera
    from omnisim.rendering.renderer import Renderer
    from omnisim.rendering.stage import Stage, open_sensor
    from omnisim.rendering.twist import Twist

# Modules of the names, imported at first use: a camera alone needs neither scenes nor OpenGL.
_MODULES = {
    "OmniCamera": "camera.omnicamera",
    "Renderer": "renderer",
    "Stage": "stage",
    "Twist": "twist",
    "open_sensor": "stage",
}
__all__ = ["OmniCamera", "Renderer", "Stage", "Twist", "open_sensor"]

__getattr__ = lazy_names(__name__, _MODULES)
