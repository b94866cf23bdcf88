"""Errors of the calibration that estimators read; the recorded drive has the true calibration.

The estimators read a copy of the run's folder. In it, the files of miscalibrated sensors are
replaced, and all others are links. So the user's commands and exports see the same errors as
adapters.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from omnisim.core.arrays import Floats
from omnisim.core.errors import EstimatorError, OutputError
from omnisim.core.files.atomic_file import write_text
from omnisim.core.files.parameters import Number, Point, Table
from omnisim.core.poses import inverse, pose
from omnisim.datasets.export.recording import START, Recording
from omnisim.rendering.camera.omnicamera import CALIBRATION
from omnisim.runs.run_folder import TIMES, write_state
from omnisim.sensors.imu.imu import BIASES, PARAMETERS, READINGS
from omnisim.sensors.lidar.point_files import write_points
from omnisim.sensors.lidar.spinning_lidar import SpinningLidar

_FOCAL = ("focal_length_px", "focal_lengths_px")
_EXTRINSICS = ("offset_m", "roll_deg", "pitch_deg", "yaw_deg")


class CalibrationComparison(Table):
    """Error of a sensor's calibration, as the estimators read it."""

    focal_scale: Annotated[Number, Field(ge=0.5, le=2.0)] = 1.0
    """Factor of a camera's focal lengths."""
    offset_m: Point = (0.0, 0.0, 0.0)
    """Shift of the sensor's position in the base frame, meters."""
    roll_deg: Number = 0.0
    """Rotation about the sensor's x, degrees; of a camera: about that of its optical frame."""
    pitch_deg: Number = 0.0
    """Rotation about the sensor's y, degrees."""
    yaw_deg: Number = 0.0
    """Rotation about the sensor's z, degrees; of a camera: about its axis."""
    time_offset_s: Annotated[Number, Field(ge=-1.0, le=1.0)] = 0.0
    """Delay of the sensor's stamps, seconds."""

    def wrong(self, base_from_sensor: Floats) -> Floats:
        """Extrinsics (4, 4) with the error, from the true ones."""
        turned: Floats = base_from_sensor @ pose(
            (0.0, 0.0, 0.0), roll_deg=self.roll_deg, pitch_deg=self.pitch_deg, yaw_deg=self.yaw_deg
        )
        turned[:3, 3] += self.offset_m
        return turned

    @property
    def moves(self) -> bool:
        """True if the extrinsics are wrong."""
        return bool(self.model_dump(exclude_defaults=True).keys() & set(_EXTRINSICS))


def write_given_run(
    run: Recording, errors: Mapping[str, CalibrationComparison], folder: Path
) -> None:
    """Write the run for the estimators: links, and changed files of miscalibrated sensors.

    Args:
        run: finished run.
        errors: errors by the name of the sensor.
        folder: output folder, whose contents are replaced.

    Raises:
        EstimatorError: a sensor has no focal length or no stamps to change.
        OutputError: the folder cannot be written.
    """
    source = run.run.path.absolute()
    try:
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        for path in source.iterdir():
            if path.name not in errors:
                (folder / path.name).symlink_to(path)
        for name in errors:
            (folder / name).mkdir()
            for path in (source / name).iterdir():
                (folder / name / path.name).symlink_to(path)
    except OSError as reason:
        raise OutputError(f"{folder}: cannot be written: {reason.strerror}") from None
    for name, error in errors.items():
        _write_sensor(run, name, error, folder / name)


def _write_sensor(run: Recording, name: str, error: CalibrationComparison, folder: Path) -> None:
    """Replace the files of a miscalibrated sensor."""
    is_camera, is_imu = (folder / CALIBRATION).exists(), (folder / PARAMETERS).exists()
    if error.focal_scale != 1.0 and not is_camera:
        raise EstimatorError(f"{name}: focal_scale: expected a camera")
    if is_camera and (error.moves or error.focal_scale != 1.0):
        _rewrite(folder / CALIBRATION, lambda text: _wrong_camera(text, name, error))
    if is_imu and error.moves:
        _rewrite(folder / PARAMETERS, lambda text: _wrong_imu(text, run.base_from_imu(name), error))
    shift_s = error.time_offset_s
    if shift_s:
        tables = [folder / file for file in (TIMES, READINGS, BIASES)]
        if not any(path.exists() for path in tables):
            raise EstimatorError(f"{name}: time_offset_s: expected a sensor with a rate_hz")
        for path in tables:
            if path.exists():
                _rewrite(path, lambda text: _later(text, shift_s))
        if is_imu:  # its integral starts at the state of its first reading, whatever its stamp
            first_s = float(run.times_s(name)[0])
            write_state(folder / START, first_s + shift_s, run.states(np.array([first_s])))
    if name in run.sensors(SpinningLidar):
        if error.moves or shift_s:
            _wrong_lidar(run, name, error, folder)
    elif error.moves and not (is_camera or is_imu):
        raise EstimatorError(f"{name}: extrinsics: expected a camera, an IMU or a lidar")


def _rewrite(path: Path, change: Callable[[str], str]) -> None:
    """Replace a link by a changed copy of its target."""
    text = change(path.read_text(encoding="utf-8"))
    path.unlink()
    write_text(path, text)


def _wrong_camera(text: str, name: str, error: CalibrationComparison) -> str:
    content: dict[str, Any] = json.loads(text)
    if error.focal_scale != 1.0:
        known = [key for key in _FOCAL if key in content["camera"]]
        if not known:
            raise EstimatorError(f"{name}: focal_scale: its model has no focal length")
        scaled = error.focal_scale * np.asarray(content["camera"][known[0]], dtype=np.float64)
        content["camera"][known[0]] = scaled.tolist()
    base_from_optical = np.array(content["base_from_optical"], dtype=np.float64)
    content["base_from_optical"] = error.wrong(base_from_optical).tolist()
    return json.dumps(content, indent=2) + "\n"


def _wrong_imu(text: str, base_from_imu: Floats, error: CalibrationComparison) -> str:
    numbers = ", ".join(f"{number:.17g}" for number in error.wrong(base_from_imu).ravel())
    return re.sub(r"(?m)^  data: \[.*\]$", f"  data: [{numbers}]", text, count=1)


def _later(text: str, shift_s: float) -> str:
    """CSV table with the times in its first column shifted by `shift_s`."""
    first, *lines = text.splitlines()
    changed = []
    for line in lines:
        time, comma, rest = line.partition(",")
        changed.append(f"{float(time) + shift_s:.9f}{comma}{rest}")
    return "\n".join((first, *changed)) + "\n"


def _wrong_lidar(run: Recording, name: str, error: CalibrationComparison, folder: Path) -> None:
    """Replace poses and times in the headers of all clouds; the points are unchanged."""
    suffix = f".{(run.run.manifest.sensors[name].model_extra or {})['file_format']}"
    base_from_lidar = run.base_from_lidar(name)
    base_from_wrong = error.wrong(base_from_lidar)
    lidar_from_wrong = inverse(base_from_lidar) @ base_from_wrong
    late_s = run.times_s(name) + error.time_offset_s
    for index, world_from_base in enumerate(run.states(late_s).world_from_base):
        cloud = run.cloud(name, index)
        end_from_start = inverse(cloud.header.pose("world_from_lidar")) @ cloud.header.pose(
            "world_from_lidar_at_start"
        )
        world_from_end = world_from_base @ base_from_wrong
        world_from_start = (
            world_from_end @ inverse(lidar_from_wrong) @ end_from_start @ lidar_from_wrong
        )
        changes = {
            "time_s": float(late_s[index]),
            "world_from_lidar_at_start": world_from_start.tolist(),
            "world_from_lidar": world_from_end.tolist(),
        }
        path = folder / run.run.file(name, index, suffix).name
        path.unlink()
        write_points(path, cloud.points, world_from_end, {**cloud.header.values, **changes})
