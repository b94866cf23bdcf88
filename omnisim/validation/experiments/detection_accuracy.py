"""Accuracy of a landmark detector: recall, precision and errors by distance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.poses import wrap_angle
from omnisim.perception.landmarks.landmark_detector import Detection
from omnisim.perception.localization.filter import LandmarkMap, predict_measurement

# Maximum errors of a true positive.
FOUND_WITHIN_RAD = math.radians(3.0)
FOUND_WITHIN_SHARE = 0.25


@dataclass(frozen=True)
class DetectionMatch:
    """Landmark in one image, with its detection."""

    step: int  # step of the image
    landmark: str  # name of the landmark
    range_m: float  # true range
    detection: Detection | None  # detection of the landmark; None: not detected
    # detected minus true values; NaN without a detection
    range_error_m: float = math.nan
    bearing_error_rad: float = math.nan

    @property
    def is_right(self) -> bool:
        """True if the detection is close enough to the landmark."""
        if self.detection is None:
            return False
        slack_m = max(FOUND_WITHIN_SHARE * self.range_m, 3.0 * self.detection.range_sigma_m)
        return (
            abs(self.bearing_error_rad) <= FOUND_WITHIN_RAD and abs(self.range_error_m) <= slack_m
        )


def compare(
    detections: Sequence[Sequence[Detection]],
    true_poses: Floats,
    landmarks: LandmarkMap,
    camera_m: tuple[float, float],
) -> list[DetectionMatch]:
    """Match detections of each step with the landmarks at the true pose.

    Args:
        true_poses: (steps, 3) x, y, yaw of the base.
        landmarks: landmarks at their true positions.
        camera_m: position (x, y) of the camera in the base frame.
    """
    matches = []
    for step, (pose, of_step) in enumerate(zip(true_poses.tolist(), detections, strict=True)):
        by_name = {detection.landmark: detection for detection in of_step}
        for name, corners in landmarks.corners_m.items():
            expected = predict_measurement(tuple(pose), camera_m, corners)
            range_m, bearing_rad = expected[0], expected[4]
            detection = by_name.get(name)
            if detection is None:
                matches.append(DetectionMatch(step, name, range_m, None))
                continue
            range_error_m = detection.range_m - range_m
            off_rad = wrap_angle(detection.bearing_rad - bearing_rad)
            matches.append(DetectionMatch(step, name, range_m, detection, range_error_m, off_rad))
    return matches


@dataclass(frozen=True)
class Accuracy:
    """Accuracy of a detector in a range interval."""

    recall: float  # true positives as a share of landmarks
    precision: float  # true positives as a share of detections
    bearing_rms_rad: float  # RMS bearing error of true positives
    # RMS range errors of true positives as shares of the true range, by the exact relation and by
    # Eq. 2
    range_rms_share: float
    range_eq2_rms_share: float
    eq2_mean_m: float  # mean of the range by Eq. 2 minus the range by the exact relation
    count: int  # number of true positives


def accuracy(matches: Sequence[DetectionMatch], nearest_m: float, farthest_m: float) -> Accuracy:
    """Accuracy for landmarks with true ranges in an interval; NaN without landmarks."""
    present = [each for each in matches if nearest_m <= each.range_m < farthest_m]
    seen = [each for each in present if each.detection is not None]
    right = [each for each in seen if each.is_right]

    def share(part: int, whole: int) -> float:
        return part / whole if whole else math.nan

    bearings = np.array([each.bearing_error_rad for each in right])
    ranges = np.array([each.range_m for each in right])
    errors = np.array([each.range_error_m for each in right])
    paper = np.array([each.detection.range_eq2_m for each in right if each.detection])
    exact = np.array([each.detection.range_m for each in right if each.detection])
    shares = share(len(right), len(present)), share(len(right), len(seen))
    rms = _rms(bearings), _rms(errors / ranges), _rms((errors + paper - exact) / ranges)
    eq2_m = float(np.mean(paper - exact)) if right else math.nan
    return Accuracy(*shares, *rms, eq2_m, len(right))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else math.nan
