"""Simulation: vehicles with sensors, driven along paths through scenes."""

from omnisim.robots.vehicle import Vehicle
from omnisim.sensors.laser_scanner.mounted_scanner import MountedScanner
from omnisim.sensors.omnicamera.mounted_omnicamera import MountedCamera

__all__ = ["MountedCamera", "MountedScanner", "Vehicle"]
