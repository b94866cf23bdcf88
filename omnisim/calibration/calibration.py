"""What a calibration file says: cameras, where they sit, and how near a fit came.

Poses are named target_from_source, as everywhere: a point of the source, times the matrix, is the
point in the target. A camera's frame is its optical frame (x right, y down, z forward), under its
name; others are called what their format calls them: `imu`, `vehicle`, `world`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, MirroredCamera
from omnisim.errors import CalibrationError


@dataclass(frozen=True, eq=False)
class Pose:
    """Where one frame is in another.

    Attributes:
        target, source: names of the frames.
        target_from_source: (4, 4), metres.
    """

    target: str
    source: str
    target_from_source: NDArray[np.float64]


@dataclass(frozen=True)
class Residual:
    """How far a fitted camera is from the one that it stands for.

    Attributes:
        rms_px, max_px: distances in the picture, over the valid cone.
        theta_max_rad: the cone, from the axis.
        source_model: model of the camera that it stands for.
    """

    rms_px: float
    max_px: float
    theta_max_rad: float
    source_model: str


@dataclass(frozen=True, eq=False)
class CalibratedCamera:
    """One camera of a calibration file.

    Attributes:
        name: what the file calls it.
        camera: its model. A mirror that the file says as a lens is a mirror again, or a
            `MirroredCamera`: its rays are those of the optical frame, not of the file's.
        poses: what the file says of where it is.
        residual: how near it is to the camera it was fitted to, if it was.
        notes: what a reader of the file should know, a sentence each.
        said_as: model of the lens that the file says it by, if there is a file.
    """

    name: str
    camera: CentralCamera
    poses: tuple[Pose, ...] = ()
    residual: Residual | None = None
    notes: tuple[str, ...] = ()
    said_as: str | None = None

    @property
    def mirrored(self) -> bool:
        """Whether it is a mirror by the parameters of a lens."""
        return isinstance(self.camera, MirroredCamera)


@dataclass(frozen=True, eq=False)
class Calibration:
    """The cameras of a calibration file, in its order.

    Attributes:
        cameras: at least one; no two have the same name.
        format: name of the file's format.
        source: the file, for messages.
    """

    cameras: tuple[CalibratedCamera, ...]
    format: str = "omnisim"
    source: str = "calibration"

    @property
    def names(self) -> list[str]:
        """Names of the cameras."""
        return [camera.name for camera in self.cameras]

    @property
    def notes(self) -> list[str]:
        """What a reader of the file should know, a sentence each."""
        several = len(self.cameras) > 1
        return [
            f"{camera.name}: {note}" if several else note
            for camera in self.cameras
            for note in camera.notes
        ]

    def camera(self, name: str | None = None) -> CalibratedCamera:
        """The camera of a name, by default the first.

        Raises:
            CalibrationError: the file has no such camera.
        """
        if name is None:
            return self.cameras[0]
        for camera in self.cameras:
            if camera.name == name:
                return camera
        raise CalibrationError(
            f"{self.source}: no camera {name!r}: want one of " + ", ".join(self.names)
        )

    def only(self, name: str) -> Calibration:
        """The same file with one of its cameras.

        Raises:
            CalibrationError: the file has no such camera.
        """
        return Calibration((self.camera(name),), self.format, self.source)

    def save(self, path: str | Path, format: str, model: str | None = None) -> Calibration:
        """Write a calibration file; see `omnisim.calibration.save_calibration`.

        Raises:
            CalibrationError: the format cannot say one of the cameras, with the reason.
            OutputError: the file cannot be written.
        """
        from omnisim.calibration.save import save_calibration

        return save_calibration(self, path, format, model)


def calibration_of(camera: CentralCamera, name: str = "cam0") -> Calibration:
    """A camera as a calibration, to save it."""
    return Calibration((CalibratedCamera(name, camera),))


def find_pose(poses: Iterable[Pose], target: str, source: str) -> NDArray[np.float64] | None:
    """Pose (4, 4) target_from_source by way of any that are known, or None."""
    poses = list(poses)
    known = {source: np.eye(4)}  # frames with the pose of the source in them
    while target not in known:
        found = False
        for pose in poses:
            if pose.source in known and pose.target not in known:
                known[pose.target] = pose.target_from_source @ known[pose.source]
                found = True
            elif pose.target in known and pose.source not in known:
                known[pose.source] = inverse(pose.target_from_source) @ known[pose.target]
                found = True
        if not found:
            return None
    return known[target]


def inverse(pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """The pose (4, 4) the other way."""
    back = np.eye(4)
    back[:3, :3] = pose[:3, :3].T
    back[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return back
