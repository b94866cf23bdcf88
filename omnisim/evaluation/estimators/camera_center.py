"""Base of estimators that track the first camera's center, as those without scale do."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.poses import inverse
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.estimator import Estimator
from omnisim.evaluation.trajectory_errors import AlignmentKind


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
