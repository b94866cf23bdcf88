"""Manifest of a run: provenance, and what may change when the run resumes."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, ConfigDict, Field

from omnisim.core.errors import RunError, did_you_mean
from omnisim.core.files.parameters import Table, parse_table
from omnisim.ground_truth.channel_files import ChannelFormat
from omnisim.rendering.sensor import SensorSettings
from omnisim.scene import Scene, read_scene
from omnisim.sensors.sensor_registry import SENSOR_TYPES
from omnisim.sensors.sensor_table import SensorName

MANIFEST_FORMAT = 2
RAYS = "embreex "  # prefix of the ray-casting back end's name
LONG = 16  # length from which a list is compared value by value
# Recorded only: a run may resume with other versions or locations of these. The last ones follow
# from the run's poses.
FOR_THE_RECORD = (
    "libraries",
    "scene.file",
    "scene.resources",
    "path.name",
    "path.poses",
    "path.length_m",
    "path.duration_s",
    "path.follows_floor",
    "path.contacts",
    "physics.motion",
    "physics.slip",
)
# Numbers computed on another processor differ in their last bits, or more after cancellation.
# Settings written by a person differ by more.
ROUNDING = 1e-9


class _OpenTable(Table):
    """Table that keeps unknown keys unchanged."""

    model_config = ConfigDict(extra="allow", strict=True, str_strip_whitespace=False)


class _Scene(_OpenTable):
    name: str
    file: str
    up_axis: str | None
    meters_per_unit: float | None = None
    resources: tuple[str, ...] = Field(default=(), strict=False)
    contents: str

    def load(self, moved_to: str | None = None) -> Scene:
        """Load the run's scene, from its original or new location.

        Raises:
            SceneError: the scene cannot be read.
        """
        return read_scene(moved_to or self.file, self.up_axis, self.meters_per_unit, self.resources)


class _Named(_OpenTable):
    name: str


def _check_type(kind: str) -> str:
    if kind not in SENSOR_TYPES:
        raise ValueError(f"unknown sensor type; {did_you_mean(kind, SENSOR_TYPES)}")
    return kind


class _Sensor(_OpenTable):
    type: Annotated[str, AfterValidator(_check_type)]
    measurements: int | None = Field(default=None, ge=1, le=10**9)  # for a sensor with its own rate


class Manifest(_OpenTable):
    """Manifest keys required by readers."""

    format: Literal[2]
    scene: _Scene
    robot: _Named
    path: _Named
    steps: int = Field(ge=1, le=10**9)
    sensors: dict[SensorName, _Sensor]
    channels: tuple[str, ...] = Field(default=(), strict=False)
    channel_format: ChannelFormat = Field(default=ChannelFormat.AUTO, strict=False)
    boxes_3d: bool = False
    is_rig: bool = False

    @property
    def cameras(self) -> list[str]:
        """Names of the cameras; cameras have ground truth."""
        return [name for name in self.sensors if self.sensor_class(name).has_ground_truth]

    def sensor_class(self, name: str) -> type[SensorSettings]:
        """Class of a sensor."""
        return SENSOR_TYPES[self.sensors[name].type].sensor_class

    @property
    def title(self) -> str:
        """Title from robot, scene and path."""
        return f"{self.robot.name} in {self.scene.name}, {self.path.name}"


def parse_manifest(content: dict[str, Any], source: str) -> Manifest:
    """Check a manifest.

    Raises:
        RunError: the manifest is invalid; names the first invalid key, in one line.
    """
    try:
        return parse_table(content, Manifest, RunError, source)
    except RunError as faults:
        raise RunError(str(faults).partition("\n")[0]) from None


def read_manifest(path: Path) -> dict[str, Any] | None:
    """Content of a manifest file, or None: the file does not exist.

    Raises:
        RunError: the file is damaged.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except OSError as reason:
        raise RunError(f"{path}: cannot be read: {reason.strerror}") from None
    except (ValueError, RecursionError):
        raise RunError(f"{path}: is damaged: not JSON") from None
    if not isinstance(content, dict) or "steps" not in content:
        raise RunError(f"{path}: is damaged: not the manifest of a run")
    return content


def first_difference(old: dict[str, Any], new: dict[str, Any], at: str = "") -> str:
    """Describe the first key with different values; empty if all are equal.

    A missing table counts as empty, so that the message names a key in it instead of the table. It
    also names the values of long lists by their indices. `at` is the path of the table in the
    manifest, with a final dot.
    """
    for key in dict.fromkeys((*new, *old)):
        if f"{at}{key}" in FOR_THE_RECORD:
            continue
        before, after = _by_key(old.get(key)), _by_key(new.get(key))
        if isinstance(before, dict | None) and isinstance(after, dict | None):
            difference = first_difference(before or {}, after or {}, f"{at}{key}.")
            if difference:
                return difference
        elif not _equal(f"{at}{key}", before, after):
            return f"{at}{key} was {before!r}, is {after!r}"
    return ""


def _equal(key: str, before: Any, after: Any) -> bool:
    """Compare values: numbers up to rounding, renderers by their back ends alone."""
    if key == "renderer":  # OpenGL's also names driver and processor, which barely affect images
        return str(before).startswith(RAYS) == str(after).startswith(RAYS)
    if isinstance(before, list) and isinstance(after, list):
        return len(before) == len(after) and all(
            _equal(key, one, other) for one, other in zip(before, after, strict=True)
        )
    if isinstance(before, float) and isinstance(after, float):
        return math.isclose(before, after, rel_tol=ROUNDING, abs_tol=ROUNDING**2)
    return bool(before == after)


def _by_key(value: Any) -> Any:
    """Table by index from a list of tables, or from a list too long for a message."""
    if isinstance(value, list) and (len(value) > LONG or any(isinstance(v, dict) for v in value)):
        return {str(number): item for number, item in enumerate(value)}
    return value
