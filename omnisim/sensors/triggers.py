"""Triggers, which fire several sensors together, and the rates of all sensors."""

from __future__ import annotations

from collections.abc import Sequence

from omnisim.core.errors import RobotFileError
from omnisim.sensors.rate import SensorRate
from omnisim.sensors.sensor_mount import SensorMount

MAX_JITTER = 0.08  # share of the period: normal numbers reach 5.77, and stamps keep their order
TIMING = ("rate_hz", "phase_s", "jitter_s")


def sensor_rates(
    mounts: Sequence[SensorMount], sources: Sequence[str]
) -> list[tuple[SensorMount, SensorRate | None]]:
    """Pair sensors with their rates; None: once per step. Sensors of a trigger share a rate.

    Args:
        mounts: sensors of one robot.
        sources: names of the sensors in messages.

    Raises:
        RobotFileError: the rates on a trigger differ, or a phase, jitter or trigger has no rate;
            names sensor and key.
    """
    triggers: dict[str, SensorMount] = {}
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
    return [_timed(*one, triggers) for one in zip(mounts, sources, strict=True)]


def _timed(
    mount: SensorMount, source: str, triggers: dict[str, SensorMount]
) -> tuple[SensorMount, SensorRate | None]:
    first = mount if mount.trigger is None else triggers.get(mount.trigger, mount)
    if mount.rate_hz is None:
        for key in ("phase_s", "jitter_s"):
            if getattr(mount, key) > 0.0:
                raise RobotFileError(f"{source}: {key}: expected with rate_hz")
        if mount.trigger is not None and first.rate_hz is None:
            raise RobotFileError(
                f"{source}: trigger = {mount.trigger!r}: expected a sensor of it with rate_hz"
            )
    if first.rate_hz is None:
        return mount, None
    if first.jitter_s > MAX_JITTER / first.rate_hz:
        raise RobotFileError(
            f"{source}: jitter_s = {first.jitter_s:g}: expected at most {MAX_JITTER:g} of the "
            f"period, {MAX_JITTER / first.rate_hz:g} s"
        )
    rate = SensorRate(
        first.rate_hz, first.phase_s, first.jitter_s, mount.trigger or f"sensor {mount.name}"
    )
    return mount.model_copy(update={"rate_hz": first.rate_hz}), rate
