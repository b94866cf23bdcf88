"""Sensors on vehicles, a folder each: what they measure, their tables and their files.

A sensor is a folder here and its entry in `sensor_registry.py`.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from omnisim.sensors.depth_camera.depth_camera import DepthCamera
    from omnisim.sensors.depth_camera.depth_renderer import DepthRenderer
    from omnisim.sensors.laser_scanner.laser_renderer import LaserRenderer
    from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner
    from omnisim.sensors.laser_scanner.scan import Scan
    from omnisim.sensors.lidar.lidar_renderer import LidarRenderer
    from omnisim.sensors.lidar.point_cloud import PointCloud
    from omnisim.sensors.lidar.spinning_lidar import SpinningLidar
    from omnisim.sensors.range_sensor.range_sensor import (
        RangeReading,
        RangeSensor,
        RangeSensorRenderer,
    )

# Modules of the names, imported at first use: a camera alone needs neither scenes nor OpenGL.
_MODULES = {
    "DepthCamera": "depth_camera.depth_camera",
    "DepthRenderer": "depth_camera.depth_renderer",
    "LaserRenderer": "laser_scanner.laser_renderer",
    "LaserScanner": "laser_scanner.laser_scanner",
    "LidarRenderer": "lidar.lidar_renderer",
    "PointCloud": "lidar.point_cloud",
    "RangeReading": "range_sensor.range_sensor",
    "RangeSensor": "range_sensor.range_sensor",
    "RangeSensorRenderer": "range_sensor.range_sensor",
    "Scan": "laser_scanner.scan",
    "SpinningLidar": "lidar.spinning_lidar",
}
__all__ = [
    "DepthCamera",
    "DepthRenderer",
    "LaserRenderer",
    "LaserScanner",
    "LidarRenderer",
    "PointCloud",
    "RangeReading",
    "RangeSensor",
    "RangeSensorRenderer",
    "Scan",
    "SpinningLidar",
]


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
