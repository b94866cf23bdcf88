"""Where pictures to look for landmarks in come from, and how far off what is found is."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import OpticsError, OutputError
from omnisim.experiments.run_data import read_run
from omnisim.localization.sightings import LandmarkMap, expect
from omnisim.perception.landmark_detector import Detection
from omnisim.perception.panorama import CameraMount
from omnisim.poses import wrap_angle
from omnisim.sensors.omnicamera import OmniCamera
from omnisim.sensors.picture_file import read_picture

# What counts as found: farther off, it is something else.
FOUND_WITHIN_RAD = math.radians(3.0)
FOUND_WITHIN_SHARE = 0.25


@dataclass(frozen=True)
class Source:
    """Pictures of one camera.

    Attributes:
        mount: the camera.
        count: how many pictures.
        picture: the one of a step.
        unfinished: what somebody should know of a run that is not whole, or None: it is.
    """

    mount: CameraMount
    count: int
    picture: Callable[[int], NDArray[np.uint8]]
    unfinished: str | None = None


def run_source(folder: Path, scene: str | None = None, camera: str | None = None) -> Source:
    """The pictures of a run.

    Raises:
        OmnisimError: anything that `read_run` refuses.
    """
    run = read_run(folder, scene, camera)
    return Source(run.mount, run.steps, run.picture, run.unfinished)


def picture_source(
    path: Path, height_m: float | None = None, sensor: OmniCamera | None = None
) -> Source:
    """A single picture, which says by what camera it was taken.

    Only how the camera sits on its vehicle is taken from it, not where the vehicle was.

    Args:
        path: of the picture.
        height_m: of the effective viewpoint above the ground, or None: its own z.
        sensor: that it was taken with, on the vehicle, or None: the picture says so itself.

    Raises:
        OutputError: no picture, of floats, or without its camera.
        OpticsError: a height that cannot be.
    """
    taken = read_picture(path, sensor)
    if taken.pixels.dtype != np.uint8:
        raise OutputError(f"{path}: has linear floats: want a picture of 8 bits, .png")
    known = taken.height_m if sensor is None else float(sensor.base_from_optical[2, 3])
    own = known if height_m is None else height_m
    if own is None or not (math.isfinite(own) and own > 0.0):
        raise OpticsError(
            f"{path}: camera {own} m above the ground: want more than 0: pass --height METRES"
        )
    base_from_optical = np.eye(4)
    base_from_optical[:3, :3] = taken.base_from_optical
    if sensor is not None:
        base_from_optical[:3, 3] = sensor.base_from_optical[:3, 3]
    elif taken.world_from_base is not None and taken.world_from_optical is not None:
        arm = taken.world_from_optical[:3, 3] - taken.world_from_base[:3, 3]
        base_from_optical[:3, 3] = taken.world_from_base[:3, :3].T @ arm
    base_from_optical[2, 3] = own
    mount = CameraMount(taken.camera, base_from_optical, taken.covered)
    return Source(mount, 1, lambda _: taken.pixels)


@dataclass(frozen=True)
class Found:
    """One landmark in one picture: where it truly is, and what was found of it.

    Attributes:
        step: of the picture.
        landmark: its name.
        range_m: the true one.
        detection: of it, or None: not found.
        range_error_m, bearing_error_rad: NaN where it was not found.
    """

    step: int
    landmark: str
    range_m: float
    detection: Detection | None
    range_error_m: float = math.nan
    bearing_error_rad: float = math.nan

    @property
    def is_right(self) -> bool:
        """Whether what was found is where the landmark is."""
        if self.detection is None:
            return False
        slack_m = max(FOUND_WITHIN_SHARE * self.range_m, 3.0 * self.detection.range_sigma_m)
        return (
            abs(self.bearing_error_rad) <= FOUND_WITHIN_RAD and abs(self.range_error_m) <= slack_m
        )


def compare(
    detections: Sequence[Sequence[Detection]],
    true_poses: NDArray[np.float64],
    landmarks: LandmarkMap,
    camera_m: tuple[float, float],
) -> list[Found]:
    """What was found of each landmark at each step, against the truth."""
    told = []
    for step, (pose, found) in enumerate(zip(true_poses.tolist(), detections, strict=True)):
        by_name = {detection.landmark: detection for detection in found}
        for name, corners in landmarks.corners_m.items():
            expected = expect(tuple(pose), camera_m, corners)
            range_m, bearing_rad = expected[0], expected[4]
            detection = by_name.get(name)
            if detection is None:
                told.append(Found(step, name, range_m, None))
                continue
            off = wrap_angle(detection.bearing_rad - bearing_rad)
            told.append(Found(step, name, range_m, detection, detection.range_m - range_m, off))
    return told


@dataclass(frozen=True)
class Accuracy:
    """How good a detector is up to some distance.

    Attributes:
        recall: share of what is there that is found.
        precision: share of what is found that is there; by where the landmark truly is, not by
            where it is found.
        bearing_rms_rad, range_rms_share, range_eq2_rms_share: of what is rightly found.
        eq2_mean_m: range by Eq. 2 less that by the exact relation, mean.
        count: how many were rightly found.
    """

    recall: float
    precision: float
    bearing_rms_rad: float
    range_rms_share: float
    range_eq2_rms_share: float
    eq2_mean_m: float
    count: int


def accuracy(found: Sequence[Found], nearest_m: float, farthest_m: float) -> Accuracy:
    """Of what is truly between two distances; NaN where there is nothing to tell from."""
    there = [each for each in found if nearest_m <= each.range_m < farthest_m]
    seen = [each for each in there if each.detection is not None]
    right = [each for each in seen if each.is_right]

    def share(part: int, whole: int) -> float:
        return part / whole if whole else math.nan

    bearings = np.array([each.bearing_error_rad for each in right])
    ranges = np.array([each.range_m for each in right])
    errors = np.array([each.range_error_m for each in right])
    paper = np.array([each.detection.range_eq2_m for each in right if each.detection])
    exact = np.array([each.detection.range_m for each in right if each.detection])
    return Accuracy(
        share(len(right), len(there)),
        share(len(right), len(seen)),
        _rms(bearings),
        _rms(errors / ranges),
        _rms((errors + paper - exact) / ranges),
        float(np.mean(paper - exact)) if len(right) else math.nan,
        len(right),
    )


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else math.nan
