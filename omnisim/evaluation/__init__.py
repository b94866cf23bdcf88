"""Evaluation of estimators on recorded runs, whose truth is known.

An estimator is an adapter to a method that finds a robot's trajectory from a run's sensors: other
people's odometry and SLAM, or dead reckoning. Each runs in a process of its own.
"""

from omnisim.evaluation.estimator import Estimator
from omnisim.evaluation.estimator_registry import ESTIMATORS, estimator_named
from omnisim.evaluation.trajectory_alignment import Alignment, align
from omnisim.evaluation.trajectory_errors import TrajectoryErrors, trajectory_errors

__all__ = [
    "ESTIMATORS",
    "Alignment",
    "Estimator",
    "TrajectoryErrors",
    "align",
    "estimator_named",
    "trajectory_errors",
]
