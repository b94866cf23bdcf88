"""Sensors: from a sensor file to frames, and from a laser scanner to scans."""

from omnisim.sensors.laser_renderer import LaserRenderer
from omnisim.sensors.laser_scanner import LaserScanner
from omnisim.sensors.omnicamera import OmniCamera
from omnisim.sensors.renderer import Renderer
from omnisim.sensors.scan import Scan
from omnisim.sensors.stage import Stage

__all__ = ["LaserRenderer", "LaserScanner", "OmniCamera", "Renderer", "Scan", "Stage"]
