"""Point clouds of a run's first lidar, by revolution."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import EstimatorError
from omnisim.core.poses import inverse
from omnisim.core.trajectories import Trajectory
from omnisim.datasets.export.recording import Recording
from omnisim.sensors.lidar.spinning_lidar import SpinningLidar

Floats = NDArray[np.float64]


class LidarSweep(NamedTuple):
    """Revolution of a lidar.

    Attributes:
        points_m: (n, 3) points, each in the lidar's frame at the point's own time.
        share: (n,) time of each point, from 0 at the start of the revolution to 1 at its end.
        range_min_m, range_max_m: range limits of the lidar.
    """

    points_m: Floats
    share: Floats
    range_min_m: float
    range_max_m: float


class LidarSweeps:
    """Revolutions of a run's first lidar.

    Raises:
        EstimatorError: the run has no lidar, or fewer than three revolutions.
    """

    def __init__(self, run: Recording):
        names = run.sensors(SpinningLidar)
        if not names:
            raise EstimatorError("the run has no lidar")
        self._run, self._name = run, names[0]
        self.times_s = run.times_s(self._name)
        if len(self.times_s) < 3:
            raise EstimatorError(f"{len(self.times_s)} revolutions: expected at least 3")

    def __iter__(self) -> Iterator[LidarSweep]:
        for index in range(len(self.times_s)):
            cloud = self._run.cloud(self._name, index)
            header = cloud.header
            share = cloud.points["time"].astype(np.float64) * header.number("rate_hz")
            limits = header.number("range_min_m"), header.number("range_max_m")
            yield LidarSweep(cloud.points_m, np.clip(share, 0.0, 1.0), *limits)

    def trajectory(self, world_from_lidar: list[Floats]) -> Trajectory:
        """Trajectory of the base, from the lidar's poses at the ends of the revolutions."""
        lidar_from_base = inverse(self._run.base_from_lidar(self._name))
        return Trajectory(self.times_s, np.stack(world_from_lidar) @ lidar_from_base)
