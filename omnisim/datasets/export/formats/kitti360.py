"""KITTI-360: fisheyes, pinholes, lidar and poses, as its development kit reads them.

    calibration/calib_cam_to_pose.txt, perspective.txt, image_02.yaml, calib_cam_to_velo.txt
    data_2d_raw/<drive>/image_02/data_rgb/0000000000.png, timestamps.txt    fisheyes: 02, 03
    data_2d_raw/<drive>/image_00/data_rect/0000000000.png                   pinholes: 00, 01
    data_2d_semantics/train/<drive>/image_02/semantic/0000000000.png        classes, 8 bits
    data_2d_semantics/train/<drive>/image_02/instance/0000000000.png        1000 class + instance
    data_2d_semantics/train/<drive>/labels.json                             omnisim's
    data_3d_raw/<drive>/velodyne_points/data/0000000000.bin, timestamps.txt
    data_poses/<drive>/poses.txt, cam0_to_world.txt

The body is the GPS/IMU, at the base of the vehicle: x forward, y right, z down; the world's z is
up. Fisheyes are MEI. Classes are the run's own; instances are numbered from 1 in each class. The
drive has the name of KITTI-360's first drive, which the development kit expects. Point clouds are
skewed by the motion, like the data set's raw point clouds. Without cameras, image_00 is at the
lidar's origin and looks along the lidar's x.

Source: KITTI-360's documentation; kitti360scripts: loadCalibration.py, project.py, annotation.py.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from omnisim.cameras import PerspectiveCamera, UnifiedCamera
from omnisim.cameras.calibration.formats.camodocal import Camodocal
from omnisim.cameras.calibration.formats.format import ParsedCamera
from omnisim.core.arrays import Floats, Ints
from omnisim.core.coordinate_frames import BASE_FROM_OPTICAL_LOOKING_AHEAD
from omnisim.core.errors import OutputError, RunError
from omnisim.core.files.atomic_file import write_text
from omnisim.core.files.image_files import write_numbers
from omnisim.core.poses import inverse, pose_from_rotation
from omnisim.core.short_repr import counted, short_repr
from omnisim.datasets.export.export_format import ExportFormat, ExportSettings, PrintNote, date_text
from omnisim.datasets.export.formats.tum import write_lines
from omnisim.datasets.export.lens_camera import LensCamera
from omnisim.datasets.export.recording import Recording
from omnisim.ground_truth.label_names import Labels
from omnisim.runs.run_folder import LABELS
from omnisim.sensors.lidar.spinning_lidar import SpinningLidar

DRIVE = "2013_05_28_drive_0000_sync"
PINHOLES, FISHEYES = ("image_00", "image_01"), ("image_02", "image_03")
LIDAR_FROM_CAMERA = pose_from_rotation(BASE_FROM_OPTICAL_LOOKING_AHEAD, np.zeros(3))
BASE_FROM_IMU = np.diag([1.0, -1.0, -1.0, 1.0])


class Kitti360(ExportFormat):
    """KITTI-360 data set."""

    name = "kitti360"
    sensors = (SpinningLidar,)
    channels = ("semantic", "instance")

    def write(
        self, recording: Recording, folder: Path, settings: ExportSettings, print_note: PrintNote
    ) -> Iterator[int]:
        """Write the data set, step by step."""
        cameras = name_cameras(recording, print_note)
        for name, camera in cameras.items():
            if camera.name != name:
                print_note(f"{camera.name} is {name}")
        lidars = recording.sensors(SpinningLidar)
        if len(lidars) > 1:
            print_note(f"velodyne_points is {lidars[0]}: {', '.join(lidars[1:])} left out")
        stamps_ns = settings.stamps_ns(recording.truth.times_s, recording.run.path)
        _write_calibrations(folder / "calibration", cameras, recording, lidars, print_note)
        _write_poses(folder / "data_poses" / DRIVE, cameras, recording)
        dates = [date_text(stamp) for stamp in stamps_ns]
        raw = folder / "data_2d_raw" / DRIVE
        images = {
            camera: raw / name / ("data_rect" if name in PINHOLES else "data_rgb")
            for name, camera in cameras.items()
        }
        clouds = folder / "data_3d_raw" / DRIVE / "velodyne_points" / "data"
        for data in [*images.values(), *([clouds] if lidars else [])]:
            data.mkdir(parents=True)
            write_lines(data.parent / "timestamps.txt", iter(dates))
        semantics = folder / "data_2d_semantics" / "train" / DRIVE
        labels = LabelImages.of(semantics, cameras, print_note) if cameras else None
        for step in range(recording.steps):
            if labels is not None:
                labels.write(step)
            for camera, data in images.items():
                camera.copy_image(step, data / f"{step:010d}.png")
            if lidars:
                cloud = recording.cloud(lidars[0], step)
                points = np.zeros((len(cloud.points), 4), dtype="<f4")
                for index, axis in enumerate("xyz"):
                    points[:, index] = cloud.points[axis]
                points[:, 3] = cloud.reflectances
                (clouds / f"{step:010d}.bin").write_bytes(points.tobytes())
            yield step + 1


def name_cameras(recording: Recording, print_note: PrintNote) -> dict[str, LensCamera]:
    """Cameras by their names in KITTI-360, pinholes first.

    Raises:
        OutputError: more than two cameras of a kind.
    """
    lenses = [LensCamera.of(camera, print_note) for camera in recording.cameras]
    pinholes = [lens for lens in lenses if isinstance(lens.lens, PerspectiveCamera)]
    fisheyes = [lens for lens in lenses if lens not in pinholes]
    for kind, cameras in (("pinholes", pinholes), ("fisheyes", fisheyes)):
        if len(cameras) > len(PINHOLES):
            names = ", ".join(lens.name for lens in cameras)
            raise OutputError(
                f"{recording.run.path}: expected at most two {kind}, as KITTI-360 has, got "
                f"{names}: --camera-name selects one"
            )
    named = (*zip(PINHOLES, pinholes, strict=False), *zip(FISHEYES, fisheyes, strict=False))
    return dict(named)


def _write_calibrations(
    folder: Path,
    cameras: dict[str, LensCamera],
    recording: Recording,
    lidars: list[str],
    print_note: PrintNote,
) -> None:
    folder.mkdir()
    imu_from_lens = {
        name: inverse(BASE_FROM_IMU) @ camera.base_from_lens for name, camera in cameras.items()
    }
    imu_from_velo = None
    if lidars:
        imu_from_velo = inverse(BASE_FROM_IMU) @ recording.base_from_lidar(lidars[0])
    if imu_from_velo is not None and not cameras:
        imu_from_lens[PINHOLES[0]] = imu_from_velo @ LIDAR_FROM_CAMERA
    first = next(iter(imu_from_lens))
    lines = []
    for name in (*PINHOLES, *FISHEYES):  # the development kit needs all four
        pose = imu_from_lens.get(name, imu_from_lens[first])
        lines.append(f"{name}: {_matrix(pose[:3])}")
    missing = [name for name in (*PINHOLES, *FISHEYES) if name not in cameras]
    if missing:
        place = f"the pose of {first}" if cameras else f"the position of {lidars[0]}"
        print_note(
            f"calib_cam_to_pose.txt: the run has no {', '.join(missing)}: written with {place}, "
            "as the development kit needs all four"
        )
    write_lines(folder / "calib_cam_to_pose.txt", iter(lines))
    lenses = [cameras[name].lens for name in PINHOLES if name in cameras]
    lines = []
    for index, lens in enumerate((lenses * 2)[:2]):  # a single one twice, for the development kit
        assert isinstance(lens, PerspectiveCamera)
        focal, (u, v) = lens.focal_length_px, lens.principal_point_px
        projection = np.array([[focal, 0, u, 0], [0, focal, v, 0], [0, 0, 1, 0]])
        lines += [
            f"S_rect_0{index}: {lens.width_px} {lens.height_px}",
            f"R_rect_0{index}: {_matrix(np.eye(3))}",
            f"P_rect_0{index}: {_matrix(projection)}",
        ]
    if lines:
        write_lines(folder / "perspective.txt", iter(lines))
    for name in (name for name in FISHEYES if name in cameras):
        camera = cameras[name]
        fisheye = camera.encode(Camodocal(), print_note, UnifiedCamera.model_name)
        text = Camodocal().encode([ParsedCamera(name, fisheye)])
        write_text(folder / f"{name}.yaml", text)
        if isinstance(fisheye, UnifiedCamera) and not fisheye.xi:
            print_note(f"{name}.yaml: model PINHOLE, which the development kit does not read")
    if imu_from_velo is not None:
        cam0 = imu_from_lens.get(PINHOLES[0], imu_from_lens[first])
        velo_from_cam0 = inverse(imu_from_velo) @ cam0
        write_text(folder / "calib_cam_to_velo.txt", _matrix(velo_from_cam0[:3]) + "\n")


def _write_poses(folder: Path, cameras: dict[str, LensCamera], recording: Recording) -> None:
    folder.mkdir(parents=True)
    poses = recording.truth.world_from_base
    lines = (f"{step} {_matrix(pose[:3])}" for step, pose in enumerate(poses @ BASE_FROM_IMU))
    write_lines(folder / "poses.txt", lines)
    if PINHOLES[0] in cameras:
        world_from_cam0 = poses @ cameras[PINHOLES[0]].base_from_lens
        lines = (f"{step} {_matrix(pose)}" for step, pose in enumerate(world_from_cam0))
        write_lines(folder / "cam0_to_world.txt", lines)


def _matrix(values: Floats) -> str:
    return " ".join(f"{value + 0.0:.10e}" for value in values.ravel().tolist())


# Images of classes and instances, as in KITTI-360.
#
# Source: kitti360scripts: annotation.py; a global number is 1000 times the class, plus the
# instance.


SEMANTIC, INSTANCE = "semantic", "instance"
MAX_N = 1000  # maximum number of instances per class
MAX_ID = {SEMANTIC: 2**8 - 1, INSTANCE: 2**16 - 1}


@dataclass(frozen=True, eq=False)
class LabelImages:
    """Writer of the labels of all cameras, by their names in KITTI-360, in the folder of the drive.

    `numbers` has by kind (semantic or instance) the number in the images for each ID of the run.
    """

    folder: Path
    cameras: Mapping[str, LensCamera]
    numbers: Mapping[str, Ints]

    def __repr__(self) -> str:
        return short_repr(self, counted(len(self.cameras), "camera"), *self.numbers)

    @classmethod
    def of(
        cls, folder: Path, cameras: Mapping[str, LensCamera], print_note: PrintNote
    ) -> LabelImages | None:
        """Create the folders and the table of labels; None: the run has no labels.

        Raises:
            OutputError: the table of labels is damaged.
        """
        recorded = next(iter(cameras.values())).recorded
        kinds = [kind for kind in (SEMANTIC, INSTANCE) if recorded.has(kind)]
        labels = recorded.labels(0) if kinds else None
        if labels is None:
            return None
        largest_class = max((label.id for label in labels.classes), default=0)
        every = {SEMANTIC: np.arange(largest_class + 1), INSTANCE: _instances(labels)}
        numbers = {}
        for kind in kinds:
            if every[kind].max(initial=0) > MAX_ID[kind]:
                reason = f"{len(every[kind]) - 1} numbers do not fit into their pixels"
                print_note(f"no images of {kind}: {reason}")
            else:
                numbers[kind] = every[kind]
        for name in cameras if numbers else ():
            for kind in numbers:
                (folder / name / kind).mkdir(parents=True)
        if numbers:
            write_text(folder / LABELS, json.dumps(labels.to_json(), indent=2) + "\n")
            print_note(f"classes are the run's own, not those of KITTI-360: {LABELS} names them")
        return cls(folder, cameras, numbers)

    def write(self, step: int) -> None:
        """Write the images of a step.

        Raises:
            RunError: a channel has a number that is not in the table of labels.
            OutputError: a file cannot be read or written.
        """
        for name, camera in self.cameras.items():
            for kind, numbers in self.numbers.items():
                values = camera.recorded.channel(step, kind)
                if values.max(initial=0) >= len(numbers):
                    raise RunError(
                        f"{camera.recorded.image_file(step)}: channel {kind!r}: expected "
                        f"numbers of {LABELS}, got {values.max()}"
                    )
                dtype = np.uint8 if kind == SEMANTIC else np.uint16
                path = self.folder / name / kind / f"{step:010d}.png"
                write_numbers(path, camera.flip(numbers[values]).astype(dtype))


def _instances(labels: Labels) -> Ints:
    """KITTI-360's global number of each instance ID (n + 1,), starting with 0 for no instance.

    Beyond 999 instances of a class, the number is 65536, which fits in no image.
    """
    numbers, counts = [0], dict[int, int]()
    for instance in labels.instances:
        counts[instance.class_id] = number = counts.get(instance.class_id, 0) + 1
        # further instances have no valid number
        numbers.append(instance.class_id * MAX_N + number if number < MAX_N else 1 << 16)
    return np.array(numbers, dtype=np.int64)
