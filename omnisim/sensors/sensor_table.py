"""Tables of sensors in a robot file: their names, the keys that all share, and their triggers."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, TypeVar

from pydantic import AfterValidator, Field

from omnisim.core.errors import OpticsError, RobotFileError
from omnisim.core.files.parameters import Coordinate, Level, Name, Number
from omnisim.core.rate import SensorRate
from omnisim.rendering.sensor import Mount, MountingTable, SensorSettings

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    DeviceT = TypeVar("DeviceT", bound=DataclassInstance)


Rate = Annotated[Number, Field(ge=1e-3, le=1e5)]
MAX_JITTER = 0.08  # share of the period: normal numbers reach 5.77, and stamps keep their order
TIMING = ("rate_hz", "phase_s", "jitter_s")

# Names of sensors are those of their folders in a run: no dots, as in the names of its own files.
FOLDER_NAME = re.compile(r"\w[\w -]{0,58}\w|\w")


def folder_name(name: str) -> str:
    """Replace a sensor name's invalid characters with `_`, to make it a valid folder name."""
    return re.sub(r"[^\w -]", "_", name)[:60].strip(" -") or "_"


def _check_folder_name(name: str) -> str:
    if not FOLDER_NAME.fullmatch(name):
        raise ValueError("expected letters, digits, _, and - or blanks between them, at most 60")
    return name


SensorName = Annotated[Name, AfterValidator(_check_folder_name)]


class SensorTable(MountingTable):
    """Mount of a sensor; a subclass adds the sensor's own keys."""

    sensor_class: ClassVar[type[SensorSettings]]

    type: str
    """Type of sensor."""
    name: SensorName
    """Unique name of the sensor and of its folder in a run."""
    position_m: tuple[Coordinate, Coordinate, Coordinate]
    """Position in meters, base frame: of a camera's effective viewpoint or a scan's origin."""
    hides: tuple[Name, ...] = ()
    """Nodes of the body that are invisible to this sensor, such as its own housing."""
    rate_hz: Rate | None = None
    """Measurements per second from the start of the drive. Default: one per step of the drive."""
    phase_s: Level = 0.0
    """Seconds from the start of the drive to the first measurement, with `rate_hz`."""
    jitter_s: Level = 0.0
    """Standard deviation of the measurement times in seconds, at most 8 % of the period."""
    trigger: Name | None = None
    """Name of a trigger: its sensors fire together, at the rate that one of them sets."""

    def mounts(self, folder: Path, source: str) -> tuple[Mount[SensorSettings], ...]:
        """Build the mounts of the table, usually one, without their rate.

        Paths are relative to `folder`, that of the robot file; messages name `source`.

        Raises:
            RobotFileError: the sensor is invalid, or a file is missing.
            SensorFileError: a sensor file is invalid; names file, key, actual and expected value.
        """
        try:
            sensor = self.sensor()
        except OpticsError as reason:
            fault = re.sub(r"^\w+\.", "", str(reason).partition("\n")[0])
            raise RobotFileError(f"{source}: {fault}") from None
        return (Mount(sensor, self.name, self.type, self.base_from_mount, self.hides),)

    def sensor(self) -> SensorSettings:
        """Build the sensor's settings from the table.

        Raises:
            OpticsError: the settings are invalid.
        """
        raise NotImplementedError

    def overriding(self, device: DeviceT) -> DeviceT:
        """Settings of a device, overridden by the values that the table gives."""
        given = {key.name: getattr(self, key.name, None) for key in dataclasses.fields(device)}
        given = {key: value for key, value in given.items() if value is not None}
        return dataclasses.replace(device, **given)


def sensor_rates(
    mounts: Sequence[SensorTable], sources: Sequence[str]
) -> list[tuple[SensorTable, SensorRate | None]]:
    """Pair a robot's sensors with their rates; None: once per step. A trigger's sensors share one.

    `sources` are the names of the sensors in messages.

    Raises:
        RobotFileError: the rates on a trigger differ, or a phase, jitter or trigger has no rate;
            names sensor and key.
    """
    triggers: dict[str, SensorTable] = {}
    for mount, source in zip(mounts, sources, strict=True):
        if mount.trigger is None or mount.rate_hz is None:
            continue
        first = triggers.setdefault(mount.trigger, mount)
        for key in TIMING:
            value, expected = getattr(mount, key), getattr(first, key)
            if value != expected:
                raise RobotFileError(
                    f"{source}: {key} = {value:g}: expected {expected:g}, that of {first.name!r} "
                    f"on trigger {mount.trigger!r}"
                )
    rates: list[tuple[SensorTable, SensorRate | None]] = []
    for mount, source in zip(mounts, sources, strict=True):
        first = mount if mount.trigger is None else triggers.get(mount.trigger, mount)
        if mount.rate_hz is None:
            for key in ("phase_s", "jitter_s"):
                if getattr(mount, key) > 0.0:
                    raise RobotFileError(f"{source}: {key}: requires rate_hz")
            if mount.trigger is not None and first.rate_hz is None:
                raise RobotFileError(
                    f"{source}: trigger = {mount.trigger!r}: expected rate_hz in one of its sensors"
                )
        if first.rate_hz is None:
            rates.append((mount, None))
            continue
        if first.jitter_s > MAX_JITTER / first.rate_hz:
            raise RobotFileError(
                f"{source}: jitter_s = {first.jitter_s:g}: expected at most {MAX_JITTER:g} of the "
                f"period, {MAX_JITTER / first.rate_hz:g} s"
            )
        clock = mount.trigger or f"sensor {mount.name}"
        rate = SensorRate(first.rate_hz, first.phase_s, first.jitter_s, clock)
        rates.append((mount.model_copy(update={"rate_hz": first.rate_hz}), rate))
    return rates
