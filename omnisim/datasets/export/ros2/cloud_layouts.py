"""Layouts of lidar clouds in messages, by the drivers that publish them.

| layout | fields, in the order of the bytes | bytes per point |
| --- | --- | --- |
| `generic` | x y z intensity ring time, azimuth range instance return | 36 |
| `velodyne` | x y z intensity ring time | 22 |
| `ouster` | x y z, intensity t reflectivity ring ambient, range | 48 |
| `ouster-u8` | the same with an 8-bit ring, which LIO-SAM and FAST-LIO read | 48 |
| `livox` | x y z intensity tag line timestamp | 26 |
| `livox-custom` | CustomMsg: offset_time x y z reflectivity tag line | 19 |

Scales of a white surface that is met perpendicularly, whose intensity is 1 in a run. Glints are
above it, up to 255, and 65535 photons; that these are linear, too, is an assumption.

| field | white |
| --- | --- |
| `generic`'s intensity | 1 |
| `velodyne`'s intensity, `ouster`'s reflectivity | 100 |
| `livox`'s intensity and reflectivity | 150 |
| `ouster`'s intensity, the signal in photons | 1e5 / range² (an assumption) |

Source: velodyne_pointcloud/pointcloudXYZIRT.cpp (branch ros2), ouster_ros/os_point.h (ros2),
livox_ros_driver2/src/comm/comm.h, src/lddc.cpp and msg; Velodyne, VLP-16 User Manual, 63-9243 Rev.
D, section 6.1; Ouster, Firmware User Manual, Calibrated Reflectivity; Livox, Mid-360 User Manual,
point cloud data.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats
from omnisim.core.errors import OutputError
from omnisim.datasets.export.export_format import NANOSECONDS
from omnisim.datasets.export.ros2 import CloudLayout

SIGNAL_M2 = 1e5  # photons of a white surface, times squared range: an assumption


def _xyz(**others: str) -> dict[str, str]:
    return {"x": "<f4", "y": "<f4", "z": "<f4", **others}


def _ouster(ring: str) -> np.dtype[np.void]:
    """Struct of 16-byte alignment, with PCL's fourth coordinate as padding."""
    others = {"reflectivity": "<u2", "ring": ring, "ambient": "<u2", "range": "<u4"}
    fields = _xyz(intensity="<f4", t="<u4", **others)
    names, formats, offsets = [*fields], [*fields.values()], [0, 4, 8, 16, 20, 24, 26, 28, 32]
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": 48})


_VELODYNE = _xyz(intensity="<f4", ring="<u2", time="<f4")
_OURS = {"azimuth": "<f4", "range": "<f4", "instance": "<u4", "return": "<u2"}
_CUSTOM = _xyz(reflectivity="u1", tag="u1", line="u1")
_TYPES: dict[CloudLayout, np.dtype[np.void]] = {
    "generic": np.dtype([*(_VELODYNE | _OURS).items()]),
    "velodyne": np.dtype([*_VELODYNE.items()]),
    "ouster": _ouster("<u2"),
    "ouster-u8": _ouster("u1"),
    "livox": np.dtype([*_xyz(intensity="<f4", tag="u1", line="u1", timestamp="<f8").items()]),
    # aligned as in the message's bytes
    "livox-custom": np.dtype([("offset_time", "<u4"), *_CUSTOM.items()], align=True),
}


def laid_out(
    points: NDArray[np.void], stamp_ns: int, times_s: Floats, rings: int, layout: CloudLayout
) -> NDArray[np.void]:
    """Points (n,) of a lidar in a layout, in the same order.

    Args:
        points: (n,) points of type `POINT` of `omnisim.sensors.lidar.point_files`, or
            `PLAIN_POINT`, whose intensity and return become 0 and 1.
        stamp_ns: stamp of the message.
        times_s: (n,) times of the points since the stamp.
        rings: number of the lidar's rings.
        layout: name of the layout.

    Raises:
        OutputError: the lidar has more rings than the layout counts.
    """
    kind, given = _TYPES[layout], points.dtype.names or ()
    limit = 65_536 if "ring" in (kind.fields or ()) and kind["ring"] == np.uint16 else 256
    if rings > limit:
        raise OutputError(f"--cloud-layout {layout}: expected at most {limit} rings, got {rings}")
    cloud = np.zeros(len(points), dtype=kind)
    since_ns = np.rint(NANOSECONDS * times_s)
    shares, returns = np.zeros(len(points)), np.ones(len(points), dtype=np.uint16)
    if "intensity" in given:
        shares, returns = points["intensity"].astype(np.float64), points["return"]
    values: dict[str, NDArray[Any]] = {name: points[name] for name in given} | {"time": times_s}
    if layout == "generic":
        values["return"] = returns
    elif layout == "velodyne":
        values["intensity"] = _levels(shares, 100.0)
    elif layout.startswith("ouster"):
        ranges_m = points["range"].astype(np.float64)
        values["ring"] = rings - 1 - points["ring"].astype(np.int64)  # Ouster's 0 is the highest
        values["reflectivity"] = _levels(shares, 100.0)
        values["range"] = np.rint(1e3 * ranges_m)
        photons = SIGNAL_M2 * shares / np.maximum(ranges_m, 1e-3) ** 2
        values["intensity"] = np.rint(photons).clip(0.0, 65535.0)
        values["t"] = since_ns.clip(0.0)
    else:
        values["line"], values["tag"] = points["ring"], (returns - 1) << 4
        values["intensity"] = values["reflectivity"] = _levels(shares, 150.0)
        values["offset_time"], values["timestamp"] = since_ns.clip(0.0), stamp_ns + since_ns
    for name in values.keys() & set(kind.names or ()):
        cloud[name] = values[name]
    return cloud


def _levels(shares: Floats, white: float) -> Floats:
    """Levels of 8 bits (n,) of intensities relative to a white surface, which has `white`."""
    return np.rint(white * shares).clip(0.0, 255.0)
