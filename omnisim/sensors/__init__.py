"""Sensors: from a sensor file to frames."""

from omnisim.sensors.omnicamera import OmniCamera
from omnisim.sensors.renderer import Renderer

__all__ = ["OmniCamera", "Renderer"]
