"""Rigs: the cameras of a calibration on the body that carries them.

A calibration states poses pair by pair: a camera in the one before, a camera at the IMU. The rig
chains them to poses on one body: the frame that the file names beside its cameras (`imu`,
`vehicle`, `base`), or the first camera where it names none. A pose in the world is no mounting.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, summary
from omnisim.cameras.calibration.calibrated_camera import NamedPose, find_pose
from omnisim.cameras.calibration.calibration import Calibration
from omnisim.core.errors import CalibrationError, did_you_mean
from omnisim.core.poses import inverse, rotation_angles
from omnisim.core.short_repr import short_repr

WORLD = "world"
# Extrinsics of two ways along a chain that are further apart are of different calibrations.
MAX_GAP_M, MAX_GAP_RAD = 1e-3, 1e-3


@dataclass(frozen=True, eq=False)
class RigCamera:
    """Camera on a rig.

    Attributes:
        name: of the camera in its file.
        model: the camera.
        body_from_camera: (4, 4) pose of its optical frame (x right, y down, z forward).
        time_shift_s: from the camera's stamps to the times of the IMU.
    """

    name: str
    model: CentralCamera
    body_from_camera: NDArray[np.float64]
    time_shift_s: float = 0.0

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name), summary(self.model))


@dataclass(frozen=True, eq=False)
class Rig:
    """Cameras on one body.

    Attributes:
        body: name of the body's frame: another than a camera's, or the first camera.
        cameras: at least one, in the order of the file.
    """

    body: str
    cameras: tuple[RigCamera, ...]

    def __repr__(self) -> str:
        return short_repr(self, f"on {self.body}", *(camera.name for camera in self.cameras))

    @property
    def has_body(self) -> bool:
        """True for a body of its own, which is no camera."""
        return self.body not in [camera.name for camera in self.cameras]

    def only(self, name: str) -> Rig:
        """Rig of one of its cameras, on the same body.

        Raises:
            CalibrationError: there is no camera of that name.
        """
        names = [camera.name for camera in self.cameras]
        if name not in names:
            raise CalibrationError(f"camera {name!r}: {did_you_mean(name, names)}")
        return Rig(self.body, (self.cameras[names.index(name)],))

    @classmethod
    def of(cls, calibration: Calibration, name: str | None = None) -> Rig:
        """Rig of all cameras of a calibration.

        Args:
            calibration: with the extrinsics of its cameras.
            name: of the camera that is needed, or None: all. Others may lack extrinsics then, and
                it may itself: it is a rig of its own then.

        Raises:
            CalibrationError: a camera whose pose on the body is not in the file, or two ways to a
                pose that contradict each other.
        """
        names = calibration.names
        poses = [
            pose
            for camera in calibration.cameras
            for pose in camera.poses
            if WORLD not in (pose.target, pose.source)
        ]
        _check_consistent(poses, calibration.source)
        frames = [frame for pose in poses for frame in (pose.target, pose.source)]
        body = next((frame for frame in frames if frame not in names), names[0])
        cameras = []
        for camera in calibration.cameras:
            pose = find_pose(poses, body, camera.name)
            if pose is not None:
                cameras.append(RigCamera(camera.name, camera.camera, pose, camera.time_shift_s))
            elif name is None:
                raise CalibrationError(
                    f"{calibration.source}: {camera.name}: expected its pose from {body}, got no "
                    "extrinsics: --camera-name takes one camera"
                )
            elif name == camera.name:
                return cls.of(calibration.only(name))
        if name is not None:
            calibration.camera(name)  # or there is none
        return cls(body, tuple(cameras))


def _check_consistent(poses: list[NamedPose], source: str) -> None:
    """Refuse a pose that contradicts the way that the others give."""
    for index, pose in enumerate(poses):
        around = find_pose(poses[:index], pose.target, pose.source)
        if around is None:
            continue
        gap = inverse(around) @ pose.target_from_source
        gap_m = float(np.linalg.norm(gap[:3, 3]))
        gap_rad = abs(float(rotation_angles(np.eye(3)[None], gap[None, :3, :3])[0]))
        if gap_m > MAX_GAP_M or gap_rad > MAX_GAP_RAD:
            raise CalibrationError(
                f"{source}: {pose.target} from {pose.source}: expected the pose that the other "
                f"extrinsics chain to, got one {1000.0 * gap_m:.3g} mm and "
                f"{math.degrees(gap_rad):.3g}° away"
            )
