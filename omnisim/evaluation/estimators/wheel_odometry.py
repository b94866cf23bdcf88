"""Dead reckoning by the wheels."""

from __future__ import annotations

from pathlib import Path

from omnisim.core.errors import EstimatorError
from omnisim.core.trajectories import Trajectory
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.estimator import Estimator


class WheelOdometry(Estimator):
    """Dead reckoning by the recorded wheel readings, from the true start."""

    title = "wheel odometry"
    alignment = "none"
    is_level = True

    def estimate(self, run: Recording, work: Path) -> Trajectory:
        """Poses of the base at the steps."""
        if run.odometry is None:
            raise EstimatorError("the run has no wheels")
        return run.odometry.dead_reckoned()
