"""Calibrated cameras: model, poses and fit residuals.

Poses are named target_from_source: the matrix maps points from the source frame to the target
frame. A camera's frame is its optical frame (x right, y down, z forward) and has the camera's name.
Other frames keep the names of the format: `imu`, `vehicle`, `world`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from omnisim.cameras import CentralCamera, MirroredCamera, check_central, summary
from omnisim.core.arrays import Bools, Floats
from omnisim.core.poses import inverse, rotation_angles
from omnisim.core.short_repr import short_repr

# Tolerance between two chains of extrinsics; beyond it they contradict each other.
MAX_GAP_M, MAX_GAP_RAD = 1e-3, 1e-3
WORLD = "world"
OPTICS = "optics"  # frame of the optical system to which a central camera was fitted


@dataclass(frozen=True, eq=False)
class NamedPose:
    """Pose (4, 4) target_from_source of one named frame in another, in meters."""

    target: str
    source: str
    target_from_source: Floats

    def __repr__(self) -> str:
        return short_repr(self, f"{self.target} from {self.source}")


@dataclass(frozen=True)
class Residuals:
    """Reprojection residuals of a fitted camera: image distances from the source camera."""

    rms_px: float  # root mean square, weighted evenly over the pixels that both cameras see
    max_px: float  # maximum, including the edge
    theta_max_rad: float  # largest angle from the lens axis that both cameras see
    source_model: str
    # residuals of points by their distance from the viewpoint; only if the source, or the optics to
    # which it was fitted, is non-central
    at_distances: tuple[CentralError, ...] = ()


@dataclass(frozen=True, eq=False)
class CalibratedCamera:
    """One camera of a calibration file.

    Attributes:
        name, file_model: camera name and lens model in the file, if there is a file.
        camera: camera model. A mirror that the file describes by a lens becomes a mirror model
            again, or a `MirroredCamera`: rays are in the optical frame, not in the file's.
        poses, time_shift_s: camera poses in the file, and offset from camera timestamps to IMU
            timestamps.
        residuals: residuals of the fit, if the camera was fitted.
        notes: notes for the user, one sentence each.

    Raises:
        OpticsError: the camera is non-central, and no calibration file can hold it.
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
        """True for a mirror that the file describes by a lens."""
        return isinstance(self.camera, MirroredCamera)


def find_pose(poses: Iterable[NamedPose], target: str, source: str) -> Floats | None:
    """Pose (4, 4) target_from_source, chained from known poses, or None."""
    links = [(pose.target, pose.source, pose.target_from_source) for pose in poses]
    links = [link for a, b, pose in links for link in ((a, b, pose), (b, a, inverse(pose)))]
    known = {source: np.eye(4)}  # pose of the source in each frame
    while target not in known:
        reached = {a: pose @ known[b] for a, b, pose in links if b in known and a not in known}
        if not reached:
            return None
        known.update(reached)
    return known[target]


def pose_contradiction(poses: Sequence[NamedPose]) -> str | None:
    """Description of a pose that contradicts the chain of the other poses on the rig, or None."""
    rig_poses = [pose for pose in poses if WORLD not in (pose.target, pose.source)]
    for index, pose in enumerate(rig_poses):
        around = find_pose(rig_poses[:index], pose.target, pose.source)
        if around is None:
            continue
        gap = inverse(around) @ pose.target_from_source
        gap_m = float(np.linalg.norm(gap[:3, 3]))
        gap_rad = abs(float(rotation_angles(np.eye(3)[None], gap[None, :3, :3])[0]))
        if gap_m > MAX_GAP_M or gap_rad > MAX_GAP_RAD:
            return (
                f"{pose.target} from {pose.source}: expected the pose that the other extrinsics "
                f"chain to, got one {1000.0 * gap_m:.3g} mm and {math.degrees(gap_rad):.3g}° away"
            )
    return None


class CentralError(NamedTuple):
    """Error of a central approximation over an image, for points at one distance."""

    distance_m: float  # from the viewpoint; may be infinite
    mean_px: float
    median_px: float
    percentile_99_px: float
    max_px: float
    left_out: float  # share of the rays whose points the central model cannot see

    @property
    def at(self) -> str:
        """Distance as text."""
        return f"{self.distance_m:g} m" if math.isfinite(self.distance_m) else "infinity"

    def __str__(self) -> str:
        if math.isnan(self.percentile_99_px):
            return f"not shown at {self.at}"
        off_px = self.percentile_99_px
        return f"{'0.00' if off_px < 0.005 else f'{off_px:.2g}'} px at {self.at}"

    @classmethod
    def of(cls, distance_m: float, errors_px: Floats, valid: Bools) -> CentralError:
        """Statistics over the valid errors (n,) of points at a distance; NaN if none is valid."""
        seen = errors_px[valid]
        if len(seen) == 0:
            return cls(distance_m, math.nan, math.nan, math.nan, math.nan, 1.0)
        median, high = np.percentile(seen, (50.0, 99.0))
        left_out = float(1.0 - valid.mean())
        mean, most = float(seen.mean()), float(seen.max())
        return cls(distance_m, mean, float(median), float(high), most, left_out)
