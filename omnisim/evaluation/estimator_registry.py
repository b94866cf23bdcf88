"""Names of the estimators; a module is imported when its estimator is used."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from omnisim.core.errors import EstimatorError, did_you_mean

if TYPE_CHECKING:
    from omnisim.evaluation.estimator import Estimator

# Module in `omnisim.evaluation.estimators`, and class, by the name on the command line.
ESTIMATORS = {
    "wheels": ("wheel_odometry", "WheelOdometry"),
    "imu": ("imu_integration", "ImuIntegration"),
    "kiss-icp": ("kiss_icp_odometry", "KissIcpOdometry"),
    "kiss-icp-skewed": ("kiss_icp_odometry", "SkewedKissIcpOdometry"),
    "colmap": ("colmap_mapping", "ColmapMapping"),
    "colmap-rig": ("colmap_mapping", "ColmapRigMapping"),
    "small-gicp": ("small_gicp_odometry", "SmallGicpOdometry"),
}
COMMAND = "command:"  # prefix of a user's own command


def estimator_named(name: str) -> Estimator:
    """Estimator of a name in `ESTIMATORS`, or of a command such as "command:my_slam {run} {out}".

    Raises:
        EstimatorError: the name is unknown.
    """
    if name.startswith(COMMAND):
        from omnisim.evaluation.estimators.own_command import OwnCommand

        return OwnCommand(name.removeprefix(COMMAND))
    if name not in ESTIMATORS:
        hint = did_you_mean(name, list(ESTIMATORS), "there are")
        raise EstimatorError(f"estimator {name!r}: unknown; {hint}, or {COMMAND}…")
    module, cls = ESTIMATORS[name]
    estimator: Estimator = getattr(import_module(f"omnisim.evaluation.estimators.{module}"), cls)()
    return estimator
