"""Trajectories of rigs: poses of a file, in any frame, as poses of the rig's body.

| file | posed frame |
| --- | --- |
| TUM, EuRoC | the rig's body (its IMU), or the first camera where the rig has no body |
| KITTI | the first camera, or one that looks ahead in the place of the first mirror; the world's |
| | axes are the first pose's: x right, y down, z ahead |
| nerfstudio's transforms.json | the camera |
| CSV with headings | the rig's body, or a vehicle on which the first camera looks ahead |

A camera's frame is its optical one: x right, y down, z forward.
Source: TUM RGB-D and EuRoC MAV data sets, KITTI odometry benchmark, nerfstudio's data conventions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from omnisim.cameras.calibration import load_calibration
from omnisim.cameras.calibration.calibrated_camera import WORLD
from omnisim.cameras.calibration.calibration import Rig
from omnisim.core.arrays import Floats
from omnisim.core.coordinate_frames import BASE_FROM_OPTICAL_LOOKING_AHEAD
from omnisim.core.errors import TrajectoryError, did_you_mean
from omnisim.core.poses import inverse, pose_from_rotation
from omnisim.core.trajectories import Trajectory, parse_trajectory
from omnisim.core.trajectories.formats.parsed_trajectory import Axes, check_printed_times

BODY, CAMERA = "body", "camera"
NERFSTUDIO = "nerfstudio"
OPTICAL_AXES = "x right, y down, z forward"
AHEAD = pose_from_rotation(BASE_FROM_OPTICAL_LOOKING_AHEAD, np.zeros(3))  # base from optical
UNTIMED_HZ = 1.0  # poses per second of a file without times, by default


class RigPoses(NamedTuple):
    """Poses of a rig's body in the scene."""

    world_from_body: Floats  # (n, 4, 4) poses
    names: tuple[str, ...] | None  # (n,) image file of each pose, or None if the file has no names
    times_s: Floats | None  # (n,) times, or None if the file has none


@dataclass(frozen=True, eq=False)
class RigRoute:
    """Poses for moving a rig."""

    path: Path  # file of the poses
    # posed frame: "body", "camera" (the first), a camera's name, or None: by the file's format
    frame: str | None = None
    # axes of the file's world, or None: KITTI's in a KITTI file, else the world's
    axes: Axes | None = None
    rate_hz: float | None = None  # poses per second of a file without times, or None: 1
    # (4, 4) pose of the file's origin in the scene, with z up
    world_from_file: Floats = field(default_factory=lambda: np.eye(4))

    def read(self, rig: Rig, print_note: Callable[[str], None]) -> tuple[Trajectory, bool]:
        """Trajectory of the rig's body in the scene, and True if its times are known.

        Known times are the file's, or follow from the rate.

        Raises:
            OmnisimError: the file cannot be read, or the rig lacks the frame.
        """
        poses, _, times_s = self.read_poses(rig, print_note)
        if times_s is not None and self.rate_hz is not None:
            raise TrajectoryError(f"{self.path}: has times of its own: expected no --rate")
        is_timed = times_s is not None or self.rate_hz is not None
        if times_s is None:
            if self.rate_hz is None:
                print_note(f"{self.path}: has no times: 1 pose per second; --rate sets another")
            rate_hz = UNTIMED_HZ if self.rate_hz is None else self.rate_hz
            if not 1e-9 < rate_hz < 1e9:
                raise TrajectoryError(f"--rate: expected a finite number above 0, got {rate_hz:g}")
            times_s = np.arange(len(poses)) / rate_hz
        trajectory = Trajectory(times_s, poses)
        try:
            check_printed_times(trajectory.times_s)
        except TrajectoryError as reason:
            raise TrajectoryError(f"{self.path}: {reason}") from None
        return trajectory, is_timed

    def read_poses(self, rig: Rig, print_note: Callable[[str], None]) -> RigPoses:
        """Poses of the rig's body in the scene, with the names and times that the file has.

        Raises:
            OmnisimError: the file cannot be read, or the rig lacks the frame.
        """
        poses = self._parse(rig)
        frame = self._frame(rig, poses.format)
        body_from_posed, label = _posed_frame(rig, frame, self.path)
        moved = self.world_from_file @ poses.upright() @ inverse(body_from_posed)
        if self.frame is None:
            axes = ", in KITTI's axes" if poses.axes == "kitti" else ""
            print_note(f"{self.path}: poses of {label}{axes}; --trajectory-frame sets another")
        return RigPoses(moved, poses.names, poses.times_s)

    def _parse(self, rig: Rig) -> _FilePoses:
        if self.path.suffix.lower() == ".json":
            if self.axes is not None:
                raise TrajectoryError(f"{self.path}: --axes: expected a text file of poses")
            return _nerfstudio_poses(self.path, rig)
        parsed = parse_trajectory(self.path, axes="world")
        axes = self.axes or ("kitti" if parsed.format == "kitti" else "world")
        if parsed.format == "csv" and axes != "world":
            raise TrajectoryError(f"{self.path}: --axes: expected world, got {axes}")
        return _FilePoses(parsed.format, parsed.times_s, parsed.world_from_base, axes, parsed.names)

    def _frame(self, rig: Rig, file_format: str) -> str | None:
        """Name of the posed frame; None: a camera that looks ahead, as KITTI's do."""
        if self.frame is not None:
            return self.frame
        if file_format == "kitti":
            return None
        if file_format == NERFSTUDIO:
            return CAMERA
        return BODY if rig.has_body or file_format == "csv" else CAMERA


@dataclass(frozen=True, eq=False)
class _FilePoses:
    """Poses in their file's own axes."""

    format: str  # format of the file
    times_s: Floats | None  # (n,) times, or None
    file_from_posed: Floats  # (n, 4, 4) poses of the posed frame
    axes: Axes  # axes of the file's world
    names: tuple[str, ...] | None  # (n,) image file of each pose, or None

    def upright(self) -> Floats:
        """Poses (n, 4, 4) in a world with z up."""
        if self.axes == "world":
            return self.file_from_posed
        return AHEAD @ self.file_from_posed


def _posed_frame(rig: Rig, frame: str | None, path: Path) -> tuple[Floats, str]:
    """Pose (4, 4) of a frame on the rig's body, and a description of the frame."""
    if frame in (BODY, rig.body) and rig.has_body:
        return np.eye(4), f"the rig's {rig.body}"
    if not rig.cameras:
        raise TrajectoryError(f"{path}: --trajectory-frame: expected {BODY}, got no camera")
    first = rig.cameras[0]
    optical_from_rig = inverse(pose_from_rotation(first.model.rig_from_optical, np.zeros(3)))
    body_from_rig = first.body_from_camera @ optical_from_rig  # upright, x forward
    if frame is None:
        is_lens = np.array_equal(first.model.rig_from_optical, BASE_FROM_OPTICAL_LOOKING_AHEAD)
        place = "" if is_lens else "a camera that looks ahead from the position of "
        return body_from_rig @ AHEAD, f"{place}{first.name} ({OPTICAL_AXES})"
    if frame == BODY:
        return body_from_rig, f"a vehicle (x forward, y left, z up) with {first.name} on it"
    cameras = {camera.name: camera for camera in rig.cameras}
    chosen = first if frame == CAMERA else cameras.get(frame)
    if chosen is None:
        hint = did_you_mean(frame, dict.fromkeys((BODY, CAMERA, *cameras)))
        raise TrajectoryError(f"{path}: --trajectory-frame {frame!r}: {hint}")
    return chosen.body_from_camera, f"{chosen.name} ({OPTICAL_AXES})"


def _nerfstudio_poses(path: Path, rig: Rig) -> _FilePoses:
    """Poses of the frames of one camera, the only one of `rig`."""
    calibration = load_calibration(path, NERFSTUDIO)
    camera = calibration.cameras[0]
    if len(calibration.cameras) > 1:
        names = [camera.name for camera in rig.cameras]
        if len(names) > 1 or names[0] not in calibration.names:
            raise TrajectoryError(
                f"{path}: expected frames of one camera, got {len(calibration.cameras)} cameras "
                "with intrinsics of their own: --camera-name selects one"
            )
        camera = calibration.camera(names[0])
    poses = [pose for pose in camera.poses if pose.target == WORLD]
    if not poses:
        raise TrajectoryError(f"{path}: frames: expected frames with a transform_matrix, got none")
    matrices = np.array([pose.target_from_source for pose in poses])
    return _FilePoses(NERFSTUDIO, None, matrices, "world", tuple(pose.source for pose in poses))
