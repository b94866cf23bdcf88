"""Camera rigs: the cameras of a calibration on the body that carries them.

A calibration gives poses in pairs: a camera relative to the previous one, or to the IMU. The rig
chains them to poses on one body. The body is the frame that the file names beside its cameras
(`imu`, `vehicle`, `base`), or the first camera if there is none. A pose in the world is not a
mounting.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, summary
from omnisim.cameras.calibration.calibrated_camera import (
    WORLD,
    find_pose,
    pose_contradiction,
)
from omnisim.cameras.calibration.calibration import Calibration
from omnisim.core.errors import CalibrationError, did_you_mean
from omnisim.core.short_repr import short_repr


@dataclass(frozen=True, eq=False)
class RigCamera:
    """Camera on a rig.

    Attributes:
        name: camera name in the file.
        model: camera model.
        body_from_camera: (4, 4) pose of its optical frame (x right, y down, z forward).
        time_shift_s: offset from camera timestamps to IMU timestamps.
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
        body: name of the body frame: a frame other than the cameras', or the first camera.
        cameras: cameras of the rig, at least one, in file order.
    """

    body: str
    cameras: tuple[RigCamera, ...]

    def __repr__(self) -> str:
        return short_repr(self, f"on {self.body}", *(camera.name for camera in self.cameras))

    @property
    def has_body(self) -> bool:
        """True if the body is not one of the cameras."""
        return self.body not in [camera.name for camera in self.cameras]

    def only(self, name: str) -> Rig:
        """Rig with only one of the cameras, on the same body.

        Raises:
            CalibrationError: there is no camera of that name.
        """
        names = [camera.name for camera in self.cameras]
        if name not in names:
            raise CalibrationError(f"camera {name!r}: {did_you_mean(name, names)}")
        return Rig(self.body, (self.cameras[names.index(name)],))

    @classmethod
    def of(cls, calibration: Calibration, name: str | None = None) -> Rig:
        """Build a rig from the cameras of a calibration.

        Args:
            calibration: cameras with extrinsics.
            name: name of the only required camera, or None if all are required. The other cameras
                may then lack extrinsics; if the named camera lacks them too, it becomes a rig of
                its own.

        Raises:
            CalibrationError: the file lacks a camera's pose on the body, or two chains of poses
                contradict each other.
        """
        names = calibration.names
        poses = [
            pose
            for camera in calibration.cameras
            for pose in camera.poses
            if WORLD not in (pose.target, pose.source)
        ]
        contradiction = pose_contradiction(poses)
        if contradiction is not None:
            raise CalibrationError(f"{calibration.source}: {contradiction}")
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
            calibration.camera(name)  # raises if it does not exist
        return cls(body, tuple(cameras))
