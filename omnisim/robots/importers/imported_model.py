"""Robot files made of models: their tables, and the sensor files beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import SceneError
from omnisim.core.files.toml_file import toml_text
from omnisim.core.poses import roll_pitch_yaw_from_rotation
from omnisim.scene import Scene, read_scene
from omnisim.scene.space.enclosure import enclosing_nodes
from omnisim.sensors.sensor_names import folder_name

_FARTHEST_M = 1e6


@dataclass(frozen=True)
class ImportedModel:
    """Text of a robot file and of the sensor files beside it.

    Attributes:
        name: of the model.
        text: TOML.
        sensor_files: TOML by the names of the files.
        notices: one line each.
    """

    name: str
    text: str
    sensor_files: dict[str, str]
    notices: tuple[str, ...]


class ImportedSensor(NamedTuple):
    """Table of `[[sensors]]`.

    Attributes:
        name: its own in the model.
        pose: (4, 4) file_from_sensor.
        values: keys beside name and pose.
        sensor_file: text of the camera's sensor file; empty: it has none.
        notices: one line for each thing that is left out.
    """

    name: str
    pose: NDArray[np.float64]
    values: dict[str, Any]
    sensor_file: str = ""
    notices: tuple[str, ...] = ()


def imported_model(
    name: str,
    source: Path,
    output: Path,
    table: dict[str, Any],
    sensors: Sequence[ImportedSensor],
    body: Scene | None,
    notices: Sequence[str],
    base_m: NDArray[np.float64] | None = None,
) -> ImportedModel:
    """Make a robot file of a table without names and sensors.

    Args:
        name: of the model.
        source: its file.
        output: the robot file that it is for.
        table: other keys.
        sensors: that it has.
        body: in the file's frame, or None.
        notices: one line each.
        base_m: (3,) of the base in the file's frame; by default its origin.
    """
    files: dict[str, str] = {}
    offset_m = np.zeros(3) if base_m is None else -base_m
    whole = {
        "name": folder_name(name).lower(),
        "title": name,
        **table,
        "sensors": [_table(one, body, output.stem, files, offset_m) for one in sensors],
    }
    lines = [f"# Model {name!r} of {source.name}.", *(f"# {notice}" for notice in notices)]
    text = "\n".join(lines) + "\n" + toml_text(whole)
    return ImportedModel(name, text, files, tuple(notices))


def _table(
    sensor: ImportedSensor,
    body: Scene | None,
    stem: str,
    files: dict[str, str],
    offset_m: NDArray[np.float64],
) -> dict[str, Any]:
    values = dict(sensor.values)
    if sensor.sensor_file:
        name = f"{stem}-{sensor.name}.toml"
        files[name] = sensor.sensor_file
        values["file"] = name
    origin_m = sensor.pose[:3, 3]
    # what is farther away is refused with the robot file
    if body is not None and values["type"] != "imu" and np.abs(origin_m).max() < _FARTHEST_M:
        # simulators do not draw a housing from its inside
        hides = enclosing_nodes(body, origin_m)
        values |= {"hides": hides} if hides else {}
    angles = np.degrees(roll_pitch_yaw_from_rotation(sensor.pose[:3, :3]))
    roll, pitch, yaw = (round(float(angle), 9) + 0.0 for angle in angles)
    return {
        "name": sensor.name,
        "type": values.pop("type"),
        "position_m": [round(float(value), 9) + 0.0 for value in sensor.pose[:3, 3] + offset_m],
        "roll_deg": roll,
        "pitch_deg": pitch,
        "yaw_deg": yaw,
        **values,
    }


def load_body(path: Path, resources: Sequence[str | Path], notices: list[str]) -> Scene | None:
    """Model as it is drawn; None, with a notice, where it cannot be."""
    try:
        return read_scene(path, resources=resources, animation="none")
    except SceneError as reason:
        notices.append(f"body: left out: {reason}")
        return None


def footprint(body: Scene, base_m: NDArray[np.float64] | None = None) -> dict[str, float]:
    """Footprint around the body, about the base in its frame, by default its origin."""
    low, high = body.bounds_m() - (np.zeros(3) if base_m is None else base_m)
    length, width = (2.0 * float(max(-low[axis], high[axis])) for axis in (0, 1))
    sizes = {"length_m": length, "width_m": width, "height_m": max(float(high[2]), 0.01)}
    return {key: round(value, 6) for key, value in sizes.items()}  # bounds are of float32
