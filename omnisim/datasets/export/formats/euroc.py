"""EuRoC MAV, also the layout of TUM VI: cameras, IMU and true states, stamped in nanoseconds.

    mav0/cam0/data.csv, data/<ns>.png, sensor.yaml      a folder per camera
    mav0/imu0/data.csv, sensor.yaml                     readings, and their noise
    mav0/state_groundtruth_estimate0/data.csv           poses of the body

The body is the IMU, or the vehicle's base if the run has no IMU. `sensor.yaml` has the models of
Kalibr, from the same laboratory: `pinhole` with `radial-tangential` or `equidistant`, `omni`,
`eucm`, `ds`. States are at the stamps of all sensors, with the true velocities and the biases of
the last IMU reading; biases are 0 without an IMU, or if the run did not record any.

Source: Burri et al., The EuRoC micro aerial vehicle datasets (2016), and its files.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from omnisim.cameras.calibration.documents import parse_yaml
from omnisim.cameras.calibration.formats.kalibr import Kalibr, sensor_lines
from omnisim.core.arrays import Floats
from omnisim.core.errors import RunError
from omnisim.core.files.atomic_file import write_text
from omnisim.core.poses import inverse
from omnisim.core.trajectories.formats import euroc
from omnisim.datasets.export.export_format import ExportFormat, ExportSettings, PrintNote
from omnisim.datasets.export.formats.tum import write_lines
from omnisim.datasets.export.lens_camera import LensCamera
from omnisim.datasets.export.recording import ImuReadings, Recording
from omnisim.sensors.imu.imu import Imu

IMAGES = "#timestamp [ns],filename"
_UNITS = (("w", "rad s^-1"), ("a", "m s^-2"))
READINGS = "#timestamp [ns]," + ",".join(
    f"{letter}_RS_S_{axis} [{unit}]" for letter, unit in _UNITS for axis in "xyz"
)
_DEVICES = ("gyroscope", "accelerometer")
NOISE = (
    "rate_hz",
    *(f"{device}_{key}" for device in _DEVICES for key in ("noise_density", "random_walk")),
)


class Euroc(ExportFormat):
    """EuRoC MAV data set."""

    name = "euroc"
    has_clocks = True
    sensors = (Imu,)

    def write(
        self, recording: Recording, folder: Path, settings: ExportSettings, print_note: PrintNote
    ) -> Iterator[int]:
        """Write the data set, step by step."""
        root = folder / "mav0"
        root.mkdir()
        cameras = [LensCamera.of(camera, print_note) for camera in recording.cameras]
        imus = recording.sensors(Imu)
        if len(imus) > 1:
            print_note(f"the body is the first IMU, {imus[0]}: {', '.join(imus[1:])} left out")
        base_from_body = recording.base_from_imu(imus[0]) if imus else np.eye(4)
        body = f"IMU {imus[0]}" if imus else "base of the vehicle: x forward, y left, z up"
        write_text(root / "body.yaml", f"comment: {body}\n")
        readings = recording.imu_readings(imus[0]) if imus else None
        states = root / "state_groundtruth_estimate0"
        _write_states(states, recording, base_from_body, readings, settings)
        if imus and readings is not None:
            _write_imu(root / "imu0", recording, imus[0], readings, settings)
        clocks = []
        for index, camera in enumerate(cameras):
            folder = root / f"cam{index}"
            body_from_lens = inverse(base_from_body) @ camera.base_from_lens
            stamps_ns = settings.stamps_ns(recording.times_s(camera.name), recording.run.path)
            _begin_camera(folder, camera, body_from_lens, stamps_ns, print_note)
            clocks.append((camera, folder / "data", stamps_ns))
        for step in range(recording.steps):
            for camera, own, stamps_ns in clocks:
                for index in recording.indices_at(camera.name, step):
                    camera.copy_image(index, own / f"{stamps_ns[index]}.png")
            yield step + 1


def _begin_camera(
    folder: Path,
    camera: LensCamera,
    body_from_lens: Floats,
    stamps_ns: list[int],
    print_note: PrintNote,
) -> None:
    """Write a camera's list of images and its calibration."""
    (folder / "data").mkdir(parents=True)
    write_lines(folder / "data.csv", iter([IMAGES, *(f"{ns},{ns}.png" for ns in stamps_ns)]))
    lens = camera.encode(Kalibr(), print_note)
    lines = sensor_lines(lens, body_from_lens, f"comment: {camera.name}")
    intervals_s = np.diff(stamps_ns) * 1e-9
    if len(intervals_s):
        lines.insert(-5, f"rate_hz: {1.0 / np.median(intervals_s):.6g}")
    write_lines(folder / "sensor.yaml", iter(lines))


def _write_states(
    folder: Path,
    recording: Recording,
    base_from_body: Floats,
    readings: ImuReadings | None,
    settings: ExportSettings,
) -> None:
    """Write the true states of the body."""
    folder.mkdir()
    times_s, biases = recording.state_times_s, None
    states = recording.states(times_s).at_mount(base_from_body)
    if readings is not None and readings.biases is not None:
        last = np.searchsorted(readings.times_s, times_s, side="right") - 1
        biases = readings.biases[np.maximum(last, 0)]
    stamps_ns = settings.stamps_ns(times_s, recording.run.path)
    lines = euroc.state_lines(stamps_ns, states.world_from_base, states.velocity_mps, biases)
    write_lines(folder / "data.csv", lines)
    text = ["sensor_type: visual-inertial", "comment: ground truth", *_pose_lines(np.eye(4))]
    write_lines(folder / "sensor.yaml", iter(text))


def _write_imu(
    folder: Path, recording: Recording, name: str, readings: ImuReadings, settings: ExportSettings
) -> None:
    folder.mkdir()
    source = recording.run.path / name
    rows = zip(settings.stamps_ns(readings.times_s, source), readings.values.tolist(), strict=True)
    printed = (",".join([str(ns), *(f"{value:.9f}" for value in row)]) for ns, row in rows)
    write_lines(folder / "data.csv", itertools.chain((READINGS,), printed))
    parameters = parse_yaml(recording.imu_parameters(name), str(source))
    try:
        noise = [f"{key}: {float(parameters[key])!r}" for key in NOISE]
    except (KeyError, TypeError, ValueError):
        raise RunError(f"{source}: sensor.yaml: expected {', '.join(NOISE)}") from None
    lines = ["sensor_type: imu", f"comment: {name}", *_pose_lines(np.eye(4)), *noise]
    write_lines(folder / "sensor.yaml", iter(lines))


def _pose_lines(pose: Floats) -> list[str]:
    """Lines of the key T_BS with a sensor's pose on the body, readable as YAML and by OpenCV."""
    return ["T_BS:", "  cols: 4", "  rows: 4", f"  data: {_numbers(pose.ravel().tolist())}"]


def _numbers(values: list[float]) -> str:
    return f"[{', '.join(repr(float(value) + 0.0) for value in values)}]"
