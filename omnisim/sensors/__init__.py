"""Sensors on vehicles: one folder per sensor, with its settings, instrument, reading and table.

`omnisim.rendering.camera` reads the sensor files of cameras. A new sensor needs a folder here and
its table in `sensor_registry.py`.
"""

from typing import TYPE_CHECKING

from omnisim.core.lazy_names import lazy_names

if TYPE_CHECKING:
    from omnisim.sensors.depth_camera.depth_camera import DepthCamera, DepthImage, DepthRenderer
    from omnisim.sensors.laser_scanner.laser_scanner import LaserRenderer, LaserScanner, Scan
    from omnisim.sensors.lidar.spinning_lidar import LidarRenderer, PointCloud, SpinningLidar
    from omnisim.sensors.range_sensor.range_sensor import (
        RangeReading,
        RangeSensor,
        RangeSensorRenderer,
    )

# Module of each name, imported at first use.
_MODULES = {
    "DepthCamera": "depth_camera.depth_camera",
    "DepthImage": "depth_camera.depth_camera",
    "DepthRenderer": "depth_camera.depth_camera",
    "LaserRenderer": "laser_scanner.laser_scanner",
    "LaserScanner": "laser_scanner.laser_scanner",
    "LidarRenderer": "lidar.spinning_lidar",
    "PointCloud": "lidar.spinning_lidar",
    "RangeReading": "range_sensor.range_sensor",
    "RangeSensor": "range_sensor.range_sensor",
    "RangeSensorRenderer": "range_sensor.range_sensor",
    "Scan": "laser_scanner.laser_scanner",
    "SpinningLidar": "lidar.spinning_lidar",
}
__all__ = [
    "DepthCamera",
    "DepthImage",
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

__getattr__ = lazy_names(__name__, _MODULES)
