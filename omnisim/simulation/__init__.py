"""Simulation: vehicles with sensors, driven along paths through scenes."""

from omnisim.simulation.sensors import MountedCamera, MountedScanner
from omnisim.simulation.vehicle import Vehicle

__all__ = ["MountedCamera", "MountedScanner", "Vehicle"]
