"""Where robots and sensors meet: what a robot file describes, as objects that can be driven."""

from omnisim.simulation.vehicle import MountedCamera, MountedScanner, Vehicle

__all__ = ["MountedCamera", "MountedScanner", "Vehicle"]
