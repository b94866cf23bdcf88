"""Sensors: from a sensor file to frames, and from a laser scanner to scans."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from omnisim.rendering.camera.omnicamera import OmniCamera
    from omnisim.rendering.renderer import Renderer
    from omnisim.rendering.stage import Stage
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
    "DepthCamera": "depth_camera",
    "DepthRenderer": "depth_renderer",
    "LaserRenderer": "laser_renderer",
    "LaserScanner": "laser_scanner",
    "LidarRenderer": "lidar_renderer",
    "OmniCamera": "omnicamera",
    "PointCloud": "point_cloud",
    "RangeReading": "range_sensor",
    "RangeSensor": "range_sensor",
    "RangeSensorRenderer": "range_sensor",
    "Renderer": "renderer",
    "Scan": "scan",
    "SpinningLidar": "spinning_lidar",
    "Stage": "stage",
}
__all__ = [
    "DepthCamera",
    "DepthRenderer",
    "LaserRenderer",
    "LaserScanner",
    "LidarRenderer",
    "OmniCamera",
    "PointCloud",
    "RangeReading",
    "RangeSensor",
    "RangeSensorRenderer",
    "Renderer",
    "Scan",
    "SpinningLidar",
    "Stage",
]


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
