"""Text of a robot file for an imported robot."""

from __future__ import annotations

import json
from dataclasses import dataclass

from omnisim.robots.importers.usarsim.ini import Entry, printable


@dataclass(frozen=True)
class Sensor:
    """Table of `[[sensors]]`.

    Attributes:
        name: its own.
        entry: where it was read.
        kind: its `type`.
        position_m: from the origin of the robot; x forward, y left, z up.
        angles_deg: roll, pitch, yaw.
        comments: where it comes from.
        values: its other keys.
    """

    name: str
    entry: Entry
    kind: str
    position_m: tuple[float, float, float]
    angles_deg: tuple[float, float, float]
    comments: tuple[str, ...]
    values: dict[str, float]


def robot_text(
    section: str, source: str, sensors: list[Sensor], raised_m: float, left_out: list[str]
) -> str:
    """Write a robot file in TOML.

    Args:
        section: that the robot comes from; its class without the package becomes the name.
        source: name of the file that it comes from.
        sensors: in order.
        raised_m: added to all heights.
        left_out: one comment each.
    """
    title = printable(section).rpartition(".")[2]
    lines = [
        f"# [{printable(section)}] of {printable(source)}.",
        "# Base frame: x forward, y left, z up, origin on the ground. Meters and degrees.",
        f"name = {_word(title.lower())}",
        f"title = {_word(title)}",
        '# body = "body.glb"  # its mesh, if there is one',
        "# What it cannot say, and a robot can be driven without: [kinematics], [odometry],",
        "# [footprint]. `omnisim robot list` has robots that say it.",
    ]
    if raised_m:
        lines.append(f"# Heights are {raised_m!r} m more than there.")
    for sensor in sensors:
        x, y, z = sensor.position_m
        lines += ["", "[[sensors]]", *(f"# {printable(comment)}" for comment in sensor.comments)]
        lines += [f"name = {_word(sensor.name)}", f"type = {_word(sensor.kind)}"]
        if sensor.kind == "omnicamera":
            lines.append(
                '# file = "omnicam.toml"  # a sensor file; without one: the paper\'s camera'
            )
        lines.append(f"position_m = {[x, y, round(z + raised_m, 9) + 0.0]}")
        angles = zip(("roll_deg", "pitch_deg", "yaw_deg"), sensor.angles_deg, strict=True)
        lines += [f"{key} = {value!r}" for key, value in angles]
        lines += [f"{key} = {value!r}" for key, value in sensor.values.items()]
    if left_out:
        lines += ["", "# Of the rest of it:", *(f"# {printable(w)}" for w in left_out)]
    return "\n".join(lines) + "\n"


def _word(text: str) -> str:
    """TOML string: its escapes are those of JSON."""
    return json.dumps(printable(text), ensure_ascii=False)
