"""Calibrated cameras: model, poses, and residuals of a fit.

Poses are named target_from_source: a point of the source, times the matrix, is the point in the
target. A camera's frame is its optical frame (x right, y down, z forward), under its name; others
have their format's names: `imu`, `vehicle`, `world`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, MirroredCamera, check_central, summary
from omnisim.cameras.central_error import CentralError
from omnisim.core.poses import inverse
from omnisim.core.short_repr import short_repr

OPTICS = "optics"  # frame of the optical system that a central camera was fitted to


@dataclass(frozen=True, eq=False)
class NamedPose:
    """Pose of one frame in another.

    Attributes:
        target, source: names of the frames.
        target_from_source: (4, 4), meters.
    """

    target: str
    source: str
    target_from_source: NDArray[np.float64]

    def __repr__(self) -> str:
        return short_repr(self, f"{self.target} from {self.source}")


@dataclass(frozen=True)
class Residuals:
    """Reprojection residuals of a fitted camera: distances in the image from its source's.

    Attributes:
        rms_px: root mean square, evenly over the pixels that both cameras see.
        max_px: largest, on the edge too.
        theta_max_rad: largest angle from the lens's axis that both see.
        source_model: model of the source.
        at_distances: residuals for points at distances from the viewpoint, where the source, or
            what that was fitted to, has none and a point's pixel depends on its distance.
    """

    rms_px: float
    max_px: float
    theta_max_rad: float
    source_model: str
    at_distances: tuple[CentralError, ...] = ()


@dataclass(frozen=True, eq=False)
class CalibratedCamera:
    """One camera of a calibration file.

    Attributes:
        name: of the camera in the file.
        camera: its model. A mirror that the file describes by a lens is a mirror again, or a
            `MirroredCamera`: its rays are those of the optical frame, not of the file's.
        poses: of the camera, as the file has them.
        residuals: of the fit, if the camera is one.
        notes: for the reader of the file, a sentence each.
        file_model: model of the lens in the file, if there is a file.
        time_shift_s: from the camera's stamps to the times of the IMU.

    Raises:
        OpticsError: a camera without one viewpoint, which no calibration file holds.
    """

    name: str
    camera: CentralCamera
    poses: tuple[NamedPose, ...] = ()
    residuals: Residuals | None = None
    notes: tuple[str, ...] = ()
    file_model: str | None = None
    time_shift_s: float = 0.0

    def __post_init__(self) -> None:
        check_central(self.camera, "calibration")

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name), summary(self.camera))

    @property
    def mirrored(self) -> bool:
        """True for a mirror by the parameters of a lens."""
        return isinstance(self.camera, MirroredCamera)


def find_pose(poses: Iterable[NamedPose], target: str, source: str) -> NDArray[np.float64] | None:
    """Pose (4, 4) target_from_source, chained from known ones, or None."""
    links = [(pose.target, pose.source, pose.target_from_source) for pose in poses]
    links = [link for a, b, pose in links for link in ((a, b, pose), (b, a, inverse(pose)))]
    known = {source: np.eye(4)}  # pose of the source in each frame
    while target not in known:
        reached = {a: pose @ known[b] for a, b, pose in links if b in known and a not in known}
        if not reached:
            return None
        known.update(reached)
    return known[target]
