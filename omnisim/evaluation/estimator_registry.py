"""Registry of estimators by name; a module is imported when its estimator is used."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from omnisim.core.errors import EstimatorError, did_you_mean

if TYPE_CHECKING:
    from omnisim.evaluation.estimator import Estimator

# Module in `omnisim.evaluation.estimators`, and class, by the name on the command line.
ESTIMATORS = {
    "wheels": ("dead_reckoning", "WheelOdometry"),
    "imu": ("dead_reckoning", "ImuIntegration"),
    "kiss-icp": ("lidar_odometry", "KissIcpOdometry"),
    "kiss-icp-skewed": ("lidar_odometry", "SkewedKissIcpOdometry"),
    "colmap": ("colmap_mapping", "ColmapMapping"),
    "colmap-rig": ("colmap_mapping", "ColmapRigMapping"),
    "small-gicp": ("lidar_odometry", "SmallGicpOdometry"),
    "landmarks": ("landmark_localization", "LandmarkLocalization"),
    "orb-slam3": ("orb_slam3", "OrbSlam3"),
    "orb-slam3-imu": ("orb_slam3", "OrbSlam3Inertial"),
    "orb-slam3-stereo": ("orb_slam3", "OrbSlam3Stereo"),
    "orb-slam3-stereo-imu": ("orb_slam3", "OrbSlam3StereoInertial"),
}
# Calibrations, whose names end in a board, such as "measure:8x6:80mm".
CALIBRATIONS = {
    "measure": ("board_calibration", "MeasuredCamera"),
    "cv2-fisheye": ("board_calibration", "OpencvFisheyeCalibration"),
    "cv2-omnidir": ("board_calibration", "OpencvOmnidirCalibration"),
}
COMMAND = "command:"  # prefix of a user's own command


def estimator_named(name: str) -> Estimator:
    """Build an estimator from its name, a calibration and board, or a user's command.

    Args:
        name: such as "kiss-icp", "measure:8x6:80mm" or "command:my_slam {run} {out}".

    Raises:
        EstimatorError: the name is unknown.
        MeasurementError: the description of the board is invalid.
    """
    if name.startswith(COMMAND):
        from omnisim.evaluation.estimators.own_command import OwnCommand

        return OwnCommand(name.removeprefix(COMMAND))
    method, has_board, board = name.partition(":")
    known = CALIBRATIONS if has_board else ESTIMATORS
    if method not in known:
        if method in CALIBRATIONS:
            raise EstimatorError(f"estimator {name!r}: expected a board, as in {name}:8x6:80mm")
        hint = did_you_mean(name, [*ESTIMATORS, *CALIBRATIONS], "there are")
        raise EstimatorError(f"estimator {name!r}: unknown; {hint}, or {COMMAND}…")
    module, cls = known[method]
    make = getattr(import_module(f"omnisim.evaluation.estimators.{module}"), cls)
    return make(board) if has_board else make()
