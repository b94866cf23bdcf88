"""Rendering: from a camera and a scene to frames and ground truth, by OpenGL or by rays."""

from typing import TYPE_CHECKING

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
__all__ = [
    "OmniCamera",
    "Renderer",
    "Stage",
    "Twist",
    "open_sensor",
]


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
