"""Messages of sensors by topic, as bags and streams have them.

Each function takes a sensor's name, the stamp of its moment in nanoseconds since 1970, and what it
measured as arrays; `of_reading` takes a reading of an instrument. Topics begin with the name, in
ROS's letters. Frames are `<name>_optical_frame` for cameras and `<name>` for all others.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, NonCentralCamera
from omnisim.cameras.calibration import CalibratedCamera
from omnisim.cameras.calibration.encode import encode_exactly
from omnisim.cameras.calibration.formats.ros import CameraInfoLens, Ros
from omnisim.core.arrays import Bytes, Floats
from omnisim.datasets.export.export_format import NANOSECONDS
from omnisim.datasets.export.ros2 import CloudLayout
from omnisim.datasets.export.ros2 import ros_messages as messages
from omnisim.datasets.export.ros2.cloud_layouts import laid_out
from omnisim.ground_truth.frame import Frame
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.renderer import RecordedFrame
from omnisim.rendering.sensor import Mount, Reading, SensorSettings
from omnisim.sensors.depth_camera.depth_camera import DepthCamera, DepthImage
from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner, Scan
from omnisim.sensors.lidar.spinning_lidar import PointCloud, SpinningLidar
from omnisim.sensors.range_sensor.range_sensor import RangeReading, RangeSensor

Messages = dict[str, object]
COMPRESSED = "/image_raw/compressed"
LABELED = ("semantic", "instance")  # channels with numbers of the run's labels


def ros_name(name: str) -> str:
    """Nearest valid ROS name: ASCII letters, digits and _, no digit first."""
    safe = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return f"_{safe}" if safe[0].isdigit() else safe


def optical_frame(name: str) -> str:
    """Frame of a camera: x right, y down, z forward (REP 103)."""
    return f"{ros_name(name)}_optical_frame"


def true_lens(name: str, camera: CentralCamera) -> CameraInfoLens | None:
    """CameraInfo lens that represents a camera exactly; None: ROS has no such model."""
    if isinstance(camera, NonCentralCamera):
        return None
    encoded = encode_exactly(CalibratedCamera(name, camera), Ros(), name)
    return None if encoded is None or encoded.metadata.mirrored else encoded.lens


def camera_messages(
    name: str,
    stamp_ns: int,
    image: Bytes | None,
    channels: Mapping[str, NDArray[Any]],
    lens: CameraInfoLens | None,
) -> Messages:
    """Image (height, width, 3), CameraInfo if ROS has the lens, and ground truth, if recorded."""
    topic, frame = f"/{ros_name(name)}", optical_frame(name)
    found: Messages = {}
    if image is not None:
        found[f"{topic}/image_raw"] = messages.image(stamp_ns, frame, image)
    if lens is not None:
        found[f"{topic}/camera_info"] = messages.camera_info_message(stamp_ns, frame, lens)
    for channel in (*LABELED, "range"):
        if channel in channels:
            found[f"{topic}/{channel}"] = messages.image(stamp_ns, frame, channels[channel])
    return found


def depth_messages(
    name: str, stamp_ns: int, depths_mm: NDArray[np.uint16], lens: CameraInfoLens | None
) -> Messages:
    """Depths (height, width) in millimeters, 0 in holes, and CameraInfo."""
    topic, frame = f"/{ros_name(name)}/depth", optical_frame(name)
    found: Messages = {f"{topic}/image_rect": messages.image(stamp_ns, frame, depths_mm)}
    if lens is not None:
        found[f"{topic}/camera_info"] = messages.camera_info_message(stamp_ns, frame, lens)
    return found


def scan_messages(
    name: str,
    stamp_ns: int,
    angles_rad: Floats,
    ranges_m: Floats,
    limits_m: tuple[float, float],
    period_s: float = 0.0,
) -> Messages:
    """Scan with ranges (beams,) of a laser scanner, see `ros_messages.laser_scan`."""
    frame = ros_name(name)
    scan = messages.laser_scan(stamp_ns, frame, angles_rad, ranges_m, limits_m, period_s)
    return {f"/{frame}/scan": scan}


def cloud_messages(
    name: str,
    end_ns: int,
    points: NDArray[np.void],
    rings: int,
    rate_hz: float,
    layout: CloudLayout = "generic",
) -> Messages:
    """Cloud of a revolution that ends at `end_ns`, stamped with its start, as drivers stamp it.

    A point's time is stamp + `time`; no stamp is before 1970, where `time` is negative instead.

    Raises:
        OutputError: the lidar has more rings than the layout counts.
    """
    first_ns = end_ns - round(NANOSECONDS / rate_hz)
    stamp_ns, frame = max(0, first_ns), ros_name(name)
    times_s = points["time"].astype(np.float64) - (stamp_ns - first_ns) / NANOSECONDS
    records = laid_out(points, stamp_ns, times_s, rings, layout)
    make = messages.livox_cloud if layout == "livox-custom" else messages.point_cloud
    return {f"/{frame}/points": make(stamp_ns, frame, records)}


def range_messages(
    name: str, stamp_ns: int, beam_angle_deg: float, limits_m: tuple[float, float], range_m: float
) -> Messages:
    """Range of a sonar, or with an angle of 0 of an infrared sensor."""
    frame, cone_rad = ros_name(name), math.radians(beam_angle_deg)
    message = messages.range_message(stamp_ns, frame, cone_rad, limits_m, range_m)
    return {f"/{frame}/range": message}


def imu_messages(name: str, stamp_ns: int, values: Sequence[float]) -> Messages:
    """IMU reading (6,): angular rates in rad/s, then specific forces in m/s²."""
    frame = ros_name(name)
    return {f"/{frame}/data_raw": messages.imu(stamp_ns, frame, values[:3], values[3:])}


def of_reading(
    name: str,
    reading: Reading,
    stamp_ns: int,
    *,
    lens: CameraInfoLens | None = None,
    period_s: float = 0.0,
    layout: CloudLayout = "generic",
) -> Messages:
    """Messages of a reading of an instrument, equal to those of a bag of the same run.

    Args:
        name: name of the sensor.
        reading: what the instrument measured.
        stamp_ns: time of the measurement, a revolution's end.
        lens: `true_lens` of the camera or depth camera.
        period_s: time between scans of a laser scanner; 0: unknown.
        layout: layout of lidar clouds.

    Raises:
        OutputError: the lidar has more rings than the layout counts.
        TypeError: a reading of another type.
    """
    match reading:
        case RecordedFrame(frame=frame) | (Frame() as frame):
            return camera_messages(name, stamp_ns, frame.rgb, frame.channels, lens)
        case DepthImage():
            return depth_messages(name, stamp_ns, reading.depths_mm, lens)
        case Scan(scanner=scanner):
            limits_m, ranges_m = (scanner.range_min_m, scanner.range_max_m), reading.ranges_m
            return scan_messages(name, stamp_ns, reading.angles_rad, ranges_m, limits_m, period_s)
        case PointCloud(points=points, lidar=lidar):
            return cloud_messages(name, stamp_ns, points, lidar.rings, lidar.rate_hz, layout)
        case RangeReading(sensor=sensor):
            limits_m = sensor.range_min_m, sensor.range_max_m
            return range_messages(name, stamp_ns, sensor.beam_angle_deg, limits_m, reading.range_m)
    raise TypeError(f"{name}: there is no message for {type(reading).__name__}")


def topics_of(
    mount: Mount[SensorSettings], lens: CameraInfoLens | None, channels: Sequence[str] = ()
) -> dict[str, str]:
    """Topics of a rendered sensor's stream, with the types of their messages."""
    name, image, info = f"/{ros_name(mount.name)}", "sensor_msgs/msg/Image", {}
    if lens is not None:
        place = f"{name}/depth" if isinstance(mount.sensor, DepthCamera) else name
        info = {f"{place}/camera_info": "sensor_msgs/msg/CameraInfo"}
    match mount.sensor:
        case OmniCamera():
            compressed = {f"{name}{COMPRESSED}": "sensor_msgs/msg/CompressedImage"}
            truth = {f"{name}/{channel}": image for channel in channels}
            return {f"{name}/image_raw": image, **compressed, **info, **truth}
        case DepthCamera():
            return {f"{name}/depth/image_rect": image, **info}
        case LaserScanner():
            return {f"{name}/scan": "sensor_msgs/msg/LaserScan"}
        case SpinningLidar():
            return {f"{name}/points": "sensor_msgs/msg/PointCloud2"}
        case RangeSensor():
            return {f"{name}/range": "sensor_msgs/msg/Range"}
    return {}
