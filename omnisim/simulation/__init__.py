"""Simulation: vehicles with sensors, driven along paths through scenes."""

from omnisim.simulation.vehicle import MountedCamera, MountedScanner, Vehicle

__all__ = ["MountedCamera", "MountedScanner", "Vehicle"]
