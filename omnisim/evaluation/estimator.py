"""Contract of estimators."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from omnisim.core.trajectories import Trajectory
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.trajectory_alignment import AlignmentKind


class Estimator(ABC):
    """Method that estimates the trajectory of a robot's base from a run's sensors.

    A subclass has a module of its own in `omnisim.evaluation.estimators`, and a line in
    `ESTIMATORS`.

    Attributes:
        title: name for people, with the sensors that it uses.
        package: package on the index that it needs; "": none.
        module: module of that package.
        alignment: what the method cannot know: "se3": where its world is, "sim3": its scale, too;
            "none": it starts at the true pose.
        is_level: the method knows which way is down.
    """

    title: ClassVar[str]
    package: ClassVar[str] = ""
    module: ClassVar[str] = ""
    alignment: ClassVar[AlignmentKind] = "se3"
    is_level: ClassVar[bool] = False

    @abstractmethod
    def estimate(self, run: Recording, work: Path) -> Trajectory:
        """Estimate poses of the base, or of `base_from_tracked`, in a world of the method's own.

        Args:
            run: finished run.
            work: empty folder for intermediate files.

        Raises:
            EstimatorError: the run lacks a sensor, or the method found no trajectory.
        """

    def base_from_tracked(self, run: Recording) -> NDArray[np.float64]:
        """Pose (4, 4), on the base, of the frame whose poses are estimated: by default the base.

        A method that cannot know the scale cannot move poses of its camera to the base either: the
        lever arm has another scale than its world. It returns poses of the camera's center, with
        the base's axes.

        Args:
            run: run with the true calibration.
        """
        return np.eye(4)
