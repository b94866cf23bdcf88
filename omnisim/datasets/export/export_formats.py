"""Registry of export formats; each is imported when it is used."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

from omnisim.core.errors import OutputError, did_you_mean

if TYPE_CHECKING:  # slow to import
    from omnisim.datasets.export.export_format import ExportFormat


class FormatEntry(NamedTuple):
    """Location of a format's class below `omnisim.datasets.export`, before it is imported."""

    title: str  # contents and readers, for lists
    module: str
    class_name: str
    extra: str | None = None  # required extra; None: no extra
    # True: also exports data sets, whose samples become steps of a recording
    takes_samples: bool = False


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
        "KITTI-360: fisheyes, pinholes, lidar, poses", "formats.kitti360", "Kitti360",
        takes_samples=True,
    ),
    "tum": FormatEntry("TUM RGB-D: images, depths of a pinhole, poses", "formats.tum", "Tum"),
    "euroc": FormatEntry(
        "EuRoC MAV and TUM VI: cameras, IMU, true states", "formats.euroc", "Euroc"
    ),
    "nerfstudio": FormatEntry(
        "nerfstudio: transforms.json, images, points", "formats.nerfstudio", "NerfstudioExport",
        takes_samples=True,
    ),
    "colmap": FormatEntry(
        "COLMAP: reconstruction as text, images, points", "formats.colmap", "ColmapExport",
        takes_samples=True,
    ),
    "colmap-binary": FormatEntry(
        "COLMAP: reconstruction in binary files, images, points", "formats.colmap", "ColmapBinary",
        takes_samples=True,
    ),
    "tartanair": FormatEntry(
        "TartanAir V2: images, depths, classes, poses", "formats.tartanair", "Tartanair"
    ),
}  # fmt: skip
# Of data sets.
LAYOUTS = ("coco", "yolo", *(name for name, entry in FORMATS.items() if entry.takes_samples))


def check_format(name: str) -> str:
    """Check the name of a format, and return it.

    Raises:
        OutputError: there is no such format.
    """
    if name not in FORMATS:
        raise OutputError(f"--to {name}: {did_you_mean(name.lower(), FORMATS)}")
    return name


def format_named(name: str) -> ExportFormat:
    """Import a format by its name, and create it.

    Raises:
        OutputError: there is no such format.
    """
    entry = FORMATS[check_format(name)]
    module = import_module(f"omnisim.datasets.export.{entry.module}")
    return getattr(module, entry.class_name)()
