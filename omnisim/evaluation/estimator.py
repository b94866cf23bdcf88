"""Contract of estimators, and the base of those that track a camera."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import ClassVar

import numpy as np

from omnisim.cameras import CentralCamera
from omnisim.core.arrays import Floats
from omnisim.core.poses import inverse
from omnisim.core.trajectories import Trajectory
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.trajectory_errors import AlignmentKind


class Estimator(ABC):
    """Method that estimates a robot's trajectory, or a camera's model, from a run's sensors.

    Each subclass has its own module in `omnisim.evaluation.estimators`, and an entry in
    `ESTIMATORS`.
    """

    title: ClassVar[str]  # display name, with the required sensors
    package: ClassVar[str] = ""  # name of the required Python package; "": none
    module: ClassVar[str] = ""  # module of that package
    extra: ClassVar[str] = "estimators"  # extra of omnisim that installs the package
    # unknowns of the estimate's world: "se3": its pose; "sim3": its scale, too; "none": the method
    # starts at the true pose
    alignment: ClassVar[AlignmentKind] = "se3"
    is_level: ClassVar[bool] = False  # True if the method observes the direction of gravity
    # True if a failure recurs: it is then kept, and not tried again
    is_repeatable: ClassVar[bool] = True
    # length of a path below which the error in percent says little
    min_path_m: ClassVar[float] = 0.0

    @abstractmethod
    def estimate(self, run: Recording, work: Path) -> Trajectory | CentralCamera:
        """Estimate poses of the tracked frame in a world of its own, or the first camera's model.

        Args:
            run: finished run.
            work: empty folder for intermediate files.

        Raises:
            EstimatorError: the run lacks a sensor, or the method yields no estimate.
        """

    def base_from_tracked(self, run: Recording) -> Floats:
        """Pose (4, 4) of the tracked frame in the base frame; by default the identity.

        Without the scale, a method cannot transfer poses from its camera to the base: the lever arm
        is in meters, its world is not. Such a method tracks the camera's center, with the base's
        axes.

        Args:
            run: run with the true calibration.
        """
        return np.eye(4)


class CameraTracker(Estimator):
    """Estimator that tracks the first camera's center; if it knows the scale, the base."""

    alignment: ClassVar[AlignmentKind] = "sim3"

    def base_from_tracked(self, run: Recording) -> Floats:
        """Frame at the first camera's center, with the base's axes; if the scale is known: base."""
        return inverse(self.tracked_from_base(run))

    def tracked_from_base(self, run: Recording) -> Floats:
        """Pose (4, 4) of the base in the tracked frame."""
        tracked_from_base = np.eye(4)
        if self.alignment == "sim3" and run.cameras:
            tracked_from_base[:3, 3] = -run.cameras[0].mount.base_from_optical[:3, 3]
        return tracked_from_base
