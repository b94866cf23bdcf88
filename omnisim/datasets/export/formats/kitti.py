"""KITTI's odometry benchmark: rectified pinholes, deskewed point clouds, poses of camera 0.

    sequences/00/image_2/000000.png         the first pinhole; image_3: the second one
    sequences/00/velodyne/000000.bin        x, y, z, reflectance (0: unknown) as float32
    sequences/00/calib.txt                  P0 to P3 (3 × 4), Tr from the lidar to camera 0
    sequences/00/times.txt                  seconds since the first step
    poses/00.txt                            poses of camera 0 in its frame at the first step

Camera 0 is the first pinhole, x right, y down, z forward: P2 = P0. Without a pinhole, camera 0 is
at the lidar's origin and looks along the lidar's x. As in the benchmark, point clouds are
compensated for motion: all points are in the lidar's frame at the end of the revolution.

Source: Geiger et al., Are we ready for autonomous driving? (2012); the benchmark's development kit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import scipy  # its submodules load when first used

from omnisim.cameras import PerspectiveCamera
from omnisim.core.arrays import Floats
from omnisim.core.errors import OutputError
from omnisim.core.poses import inverse
from omnisim.core.trajectories import Trajectory
from omnisim.datasets.export.export_format import ExportFormat, ExportSettings, PrintNote
from omnisim.datasets.export.formats.kitti360 import LIDAR_FROM_CAMERA
from omnisim.datasets.export.formats.tum import write_lines
from omnisim.datasets.export.lens_camera import LensCamera
from omnisim.datasets.export.recording import RecordedCamera, Recording, StoredCloud
from omnisim.sensors.lidar.spinning_lidar import SpinningLidar

SEQUENCE = "00"
IMAGES = ("image_2", "image_3")
PARALLEL = 1e-6  # maximum angle in radians between axes of rectified cameras


class Kitti(ExportFormat):
    """Sequence of the KITTI odometry benchmark."""

    name = "kitti"
    sensors = (SpinningLidar,)
    dates_stamps = False

    def supported_cameras(
        self, cameras: Sequence[RecordedCamera], print_note: PrintNote
    ) -> Sequence[RecordedCamera]:
        """The first two pinholes: other cameras do not set the pace of the frames either."""
        pinholes = [
            camera for camera in cameras if isinstance(camera.mount.camera, PerspectiveCamera)
        ]
        held = pinholes[: len(IMAGES)]
        left_out = [camera.name for camera in cameras if camera not in held]
        if left_out:
            print_note(f"kitti holds two pinholes: {', '.join(left_out)} left out")
        return held

    def write(
        self, recording: Recording, folder: Path, settings: ExportSettings, print_note: PrintNote
    ) -> Iterator[int]:
        """Write the sequence, step by step."""
        cameras = [LensCamera.of(camera, print_note) for camera in recording.cameras]
        for camera, name in zip(cameras, IMAGES, strict=False):
            print_note(f"{camera.name} is {name}")
        lidars = recording.sensors(SpinningLidar)
        if not cameras and not lidars:
            names = ", ".join(recording.run.manifest.cameras)
            raise OutputError(
                f"{recording.run.path}: expected a camera that is a pinhole, or a lidar, for "
                f"{self.name}, got {names}"
            )
        if len(lidars) > 1:
            print_note(f"velodyne is {lidars[0]}: {', '.join(lidars[1:])} left out")
        base_from_lidar = recording.base_from_lidar(lidars[0]) if lidars else None
        if cameras:  # pose of camera 0
            base_from_camera = cameras[0].base_from_lens
        else:
            assert base_from_lidar is not None
            base_from_camera = base_from_lidar @ LIDAR_FROM_CAMERA
        sequence = folder / "sequences" / SEQUENCE
        images = dict(zip(IMAGES, cameras, strict=False))
        for name in (*images, *(["velodyne"] if lidars else [])):
            (sequence / name).mkdir(parents=True)
        calibration = _calibration(recording, cameras, base_from_camera, base_from_lidar)
        write_lines(sequence / "calib.txt", iter(calibration))
        if not cameras:
            print_note(
                f"calib.txt: no pinhole: camera 0 is at the position of {lidars[0]}, with a focal "
                "length of 1 px"
            )
        if not lidars:
            print_note(f"calib.txt: no lidar: Tr is that of one at {cameras[0].name}")
        times_s = recording.truth.times_s - recording.truth.times_s[0]
        write_lines(sequence / "times.txt", (f"{time_s:.9e}" for time_s in times_s))
        world_from_camera = recording.truth.world_from_base @ base_from_camera
        poses = inverse(world_from_camera[0]) @ world_from_camera
        (folder / "poses").mkdir()
        lines = (_numbers(pose[:3]) for pose in poses)
        write_lines(folder / "poses" / f"{SEQUENCE}.txt", lines)
        for step in range(recording.steps):
            for name, camera in images.items():
                camera.copy_image(step, sequence / name / f"{step:06d}.png")
            if base_from_lidar is not None:
                cloud = recording.cloud(lidars[0], step)
                points = np.zeros((len(cloud.points), 4), dtype="<f4")
                points[:, 3] = cloud.reflectances
                points[:, :3] = deskewed_points_m(cloud, recording.fine_truth, base_from_lidar)
                (sequence / "velodyne" / f"{step:06d}.bin").write_bytes(points.tobytes())
            yield step + 1


def _calibration(
    recording: Recording,
    cameras: list[LensCamera],
    base_from_camera: Floats,
    base_from_lidar: Floats | None,
) -> Iterator[str]:
    """Lines of calib.txt: P0 and P2 are the first pinhole's, P1 and P3 the last one's."""
    projections = [np.eye(3, 4)]
    for index, camera in enumerate(cameras):
        lens, lens_from_camera = camera.lens, inverse(camera.base_from_lens) @ base_from_camera
        assert isinstance(lens, PerspectiveCamera)
        if np.abs(lens_from_camera[:3, :3] - np.eye(3)).max() > PARALLEL:
            raise OutputError(
                f"{recording.run.path}: expected parallel pinholes, as KITTI's rectified ones are, "
                f"got {cameras[0].name}, {camera.name}: --camera-name selects one"
            )
        focal, (u, v) = lens.focal_length_px, lens.principal_point_px
        matrix = np.array([[focal, 0.0, u], [0.0, focal, v], [0.0, 0.0, 1.0]])
        shift = np.column_stack((np.eye(3), lens_from_camera[:3, 3]))
        projections[index:] = [matrix @ shift]
    left, right = projections[0], projections[-1]
    for name, projection in zip(("P0", "P1", "P2", "P3"), (left, right) * 2, strict=True):
        yield f"{name}: {_numbers(projection)}"
    camera_from_lidar = inverse(LIDAR_FROM_CAMERA)
    if base_from_lidar is not None:
        camera_from_lidar = inverse(base_from_camera) @ base_from_lidar
    yield f"Tr: {_numbers(camera_from_lidar[:3])}"


def _numbers(values: Floats) -> str:
    return " ".join(f"{value + 0.0:.12e}" for value in values.ravel().tolist())


# Point clouds without the skew of a moving lidar, as in data sets of vehicles.


def deskewed_points_m(cloud: StoredCloud, truth: Trajectory, base_from_lidar: Floats) -> Floats:
    """Points (n, 3) in the lidar's frame at the revolution's end, as if all were measured then.

    Assumes straight, uniform motion between successive poses: the pose at the revolution's start,
    the true poses of the base, with the lidar (4, 4) on it, and the pose at its end.

    Raises:
        RunError: the header lacks poses or times.
    """
    header = cloud.header
    end_s = header.number("time_s")
    start_s = end_s - 1.0 / header.number("rate_hz")
    within = (truth.times_s > start_s) & (truth.times_s < end_s)
    lidar_from_world = inverse(header.pose("world_from_lidar"))
    knots_s = np.concatenate(([start_s], truth.times_s[within], [end_s])) - start_s
    start, end = header.pose("world_from_lidar_at_start"), header.pose("world_from_lidar")
    knots = lidar_from_world @ np.stack(
        [start, *(truth.world_from_base[within] @ base_from_lidar), end]
    )
    times_s = cloud.points["time"].astype(np.float64)
    rotations = scipy.spatial.transform.Rotation.from_matrix(knots[:, :3, :3])
    turned = scipy.spatial.transform.Slerp(knots_s, rotations)(np.clip(times_s, 0.0, knots_s[-1]))
    shifts = [np.interp(times_s, knots_s, knots[:, axis, 3]) for axis in range(3)]
    return turned.apply(cloud.points_m) + np.stack(shifts, axis=-1)
