"""Frame at the first camera's center, tracked by estimators without scale."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.datasets.export.recording import Recording


def camera_center_from_base(run: Recording) -> NDArray[np.float64]:
    """Pose (4, 4) of the base in a frame at the first camera's center, with the base's axes."""
    center_from_base = np.eye(4)
    if run.cameras:
        center_from_base[:3, 3] = -run.cameras[0].mount.base_from_optical[:3, 3]
    return center_from_base
