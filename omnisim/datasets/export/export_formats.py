"""Registry of the formats that runs are exported to; each is imported when it is used."""

from __future__ import annotations

from importlib import import_module
from typing import NamedTuple

from omnisim.core.errors import OutputError, did_you_mean
from omnisim.datasets.export.export_format import ExportFormat


class FormatEntry(NamedTuple):
    """Place of a format's class, and what is said of it before it is imported.

    Attributes:
        title: contents and readers, for lists.
        module: below `omnisim.datasets.export`.
        class_name: in it.
        extra: that it needs, or None.
    """

    title: str
    module: str
    class_name: str
    extra: str | None = None


FORMATS = {
    "ros2-mcap": FormatEntry(
        "ROS 2 bag in an MCAP file: ROS 2, Foxglove, Rerun", "ros2.bag_format", "Ros2Mcap", "ros"
    ),
    "ros2-sqlite": FormatEntry(
        "ROS 2 bag in an SQLite file: ROS 2 before Iron", "ros2.bag_format", "Ros2Sqlite", "ros"
    ),
    "kitti": FormatEntry(
        "KITTI odometry: pinholes, deskewed point clouds, poses", "formats.kitti", "Kitti"
    ),
    "kitti360": FormatEntry(
        "KITTI-360: fisheyes, pinholes, lidar, poses", "formats.kitti360", "Kitti360"
    ),
    "tum": FormatEntry("TUM RGB-D: images, depths of a pinhole, poses", "formats.tum", "Tum"),
    "euroc": FormatEntry(
        "EuRoC MAV and TUM VI: cameras, IMU, true states", "formats.euroc", "Euroc"
    ),
    "nerfstudio": FormatEntry(
        "nerfstudio: transforms.json, images, points", "formats.nerfstudio", "Nerfstudio"
    ),
    "colmap": FormatEntry(
        "COLMAP: reconstruction as text, images, points", "formats.colmap", "Colmap"
    ),
    "colmap-binary": FormatEntry(
        "COLMAP: reconstruction in binary files, images, points",
        "formats.colmap",
        "ColmapBinary",
    ),
    "tartanair": FormatEntry(
        "TartanAir V2: images, depths, classes, poses", "formats.tartanair", "Tartanair"
    ),
}


def check_format(name: str) -> str:
    """Name of a format.

    Raises:
        OutputError: there is none of that name.
    """
    if name not in FORMATS:
        raise OutputError(f"--to {name}: {did_you_mean(name.lower(), FORMATS)}")
    return name


def format_named(name: str) -> ExportFormat:
    """Format of a name.

    Raises:
        OutputError: there is none of that name.
    """
    entry = FORMATS[check_format(name)]
    found = getattr(import_module(f"omnisim.datasets.export.{entry.module}"), entry.class_name)()
    assert isinstance(found, ExportFormat)
    return found
