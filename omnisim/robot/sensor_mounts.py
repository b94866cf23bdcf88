"""Sensors of a robot file and their mounts.

The tables of `[[sensors]]`, by `type`. What they describe is built where sensors are known, in
`omnisim.simulation`; here they are numbers and names.
"""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

from omnisim import poses
from omnisim.errors import RobotFileError, did_you_mean
from omnisim.parameters import Number, Table, parse_table

# A sensor's name is that of its folder in a run. No dots: the run's own files have some.
FOLDER_NAME = re.compile(r"\w[\w -]{0,58}\w|\w")


def folder_name(name: str) -> str:
    """Nearest valid name of a sensor: `_` replaces invalid characters."""
    return re.sub(r"[^\w -]", "_", name)[:60].strip(" -") or "_"


def _check_folder_name(name: str) -> str:
    if not FOLDER_NAME.fullmatch(name):
        raise ValueError("expected letters, digits, _, and - or blanks between them, at most 60")
    return name


def _check_resolution(resolution_deg: float) -> float:
    if resolution_deg not in (1.0, 0.5, 0.25):
        raise ValueError("expected 1, 0.5 or 0.25")
    return resolution_deg


Name = Annotated[str, Field(min_length=1, strict=True)]
SensorName = Annotated[Name, AfterValidator(_check_folder_name)]
# No robot is larger; metres, not millimetres.
Coordinate = Annotated[Number, Field(ge=-1000.0, le=1000.0)]
Positive = Annotated[Number, Field(gt=0.0)]
Level = Annotated[Number, Field(ge=0.0)]
Seed = Annotated[int, Field(ge=0, le=2**32 - 1, strict=True)]


class SensorMount(Table):
    """Keys of all sensors."""

    type: str
    """Kind of sensor."""
    name: SensorName
    """Name of the sensor and of its folder in a run, distinct."""
    position_m: tuple[Coordinate, Coordinate, Coordinate]
    """Metres in the base frame: of a camera's effective viewpoint or a scan's origin."""
    roll_deg: Number = 0.0
    """Degrees about x."""
    pitch_deg: Number = 0.0
    """Degrees about y; more than 0: nose down."""
    yaw_deg: Number = 0.0
    """Degrees about z, counter-clockwise seen from above."""
    hides: tuple[Name, ...] = ()
    """Nodes of the body that this sensor does not see, such as its own housing."""

    @property
    def base_from_mount(self) -> NDArray[np.float64]:
        """Pose (4, 4) of the sensor in the base frame."""
        return poses.pose(self.position_m, self.roll_deg, self.pitch_deg, self.yaw_deg)


class OmniCameraMount(SensorMount):
    """Camera of a sensor file."""

    type: Literal["omnicamera"]
    file: Name | None = None
    """Sensor file, relative to this file; left out: the paper's camera."""


class Lms200Mount(SensorMount):
    """SICK LMS200, with the errors of one device."""

    type: Literal["lms200"]
    resolution_deg: Annotated[Number, AfterValidator(_check_resolution)] = 0.5
    """Degrees between beams: 1 or 0.5 over 180°, or 0.25 over 100°."""
    mode: Literal["mm", "cm"] = "mm"
    """Range and step: "mm" to 8.19 m by 1 mm, "cm" to 81.9 m by 1 cm."""
    noise: Annotated[bool, Field(strict=True)] = True
    """True: with the device's errors."""
    seed: Seed = 0
    """Seed of the device: its errors follow from it."""


class RangeScannerMount(SensorMount):
    """Range scanner as USARSim's configuration has it; by default its SICK LMS200."""

    type: Literal["usarsim_range_scanner"]
    scan_fov_rad: Annotated[Number, Field(gt=0.0, le=6.2832)] = 3.14159
    """Radians from the first beam to the last: USARSim's ScanFov."""
    resolution_rad: Positive = 0.01745
    """Radians between beams: USARSim's Resolution."""
    max_range_m: Positive = 20.0
    """Metres; farther hits are out of range: USARSim's MaxRange."""
    min_range_m: Level = 0.0
    """Metres; nearer hits are too near: USARSim's MinRange."""
    noise_share: Level = 0.001
    """Standard deviation as a share of the range: USARSim's Noise."""
    seed: Seed = 0
    """Seed of the device: its noise follows from it."""


MOUNT_TYPES: dict[str, type[SensorMount]] = {
    "omnicamera": OmniCameraMount,
    "lms200": Lms200Mount,
    "usarsim_range_scanner": RangeScannerMount,
}


def parse_mounts(tables: tuple[dict[str, Any], ...], source: str) -> tuple[SensorMount, ...]:
    """Check the tables of `[[sensors]]`; `source` names the file in messages.

    Raises:
        RobotFileError: an unknown type or key, a value that makes no sense, or a name again.
    """
    mounts: list[SensorMount] = []
    for index, table in enumerate(tables):
        name, kind = table.get("name"), table.get("type")
        where = (
            f"{source}: sensor {name!r}" if isinstance(name, str) else f"{source}: sensors.{index}"
        )
        if "type" not in table:
            raise RobotFileError(
                f"{where}: type: missing; expected one of {', '.join(MOUNT_TYPES)}"
            )
        if not isinstance(kind, str) or kind not in MOUNT_TYPES:
            hint = did_you_mean(str(kind), MOUNT_TYPES)
            raise RobotFileError(f"{where}: type = {kind!r}: unknown sensor type; {hint}")
        mount = parse_table(table, MOUNT_TYPES[kind], RobotFileError, where)
        if any(mount.name == other.name for other in mounts):
            raise RobotFileError(f"{where}: a second sensor of this name: expected each name once")
        mounts.append(mount)
    return tuple(mounts)
