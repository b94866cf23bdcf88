"""Registry of the formats that runs are exported to; each is imported when it is used."""

from __future__ import annotations

from importlib import import_module
from typing import NamedTuple

from omnisim.errors import OutputError, did_you_mean
from omnisim.exporting.export_format import ExportFormat


class FormatEntry(NamedTuple):
    """Place of a format's class.

    Attributes:
        module: below `omnisim.exporting`.
        class_name: in it.
    """

    module: str
    class_name: str


FORMATS = {
    "ros2-mcap": FormatEntry("ros2.bag_format", "Ros2Mcap"),
    "ros2-sqlite": FormatEntry("ros2.bag_format", "Ros2Sqlite"),
    "kitti360": FormatEntry("formats.kitti360", "Kitti360"),
    "tum": FormatEntry("formats.tum", "Tum"),
    "euroc": FormatEntry("formats.euroc", "Euroc"),
    "nerfstudio": FormatEntry("formats.nerfstudio", "Nerfstudio"),
    "colmap": FormatEntry("formats.colmap", "Colmap"),
    "colmap-binary": FormatEntry("formats.colmap", "ColmapBinary"),
    "tartanair": FormatEntry("formats.tartanair", "Tartanair"),
}
EXTRAS = {"ros2-mcap": "ros", "ros2-sqlite": "ros"}


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
    found = getattr(import_module(f"omnisim.exporting.{entry.module}"), entry.class_name)()
    assert isinstance(found, ExportFormat)
    return found
