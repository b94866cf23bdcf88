"""The estimates of a whole run, and what can be told of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.localization.consistency import nees, pose_errors
from omnisim.localization.filter import Estimate
from omnisim.localization.parameters import FilterParameters


@dataclass(frozen=True, eq=False)
class Track:
    """The estimates of a run, one a step; the first is the start.

    Attributes:
        estimates: of the filter.
        reckoned: (n, 3) x, y, yaw by the wheels alone.
    """

    estimates: tuple[Estimate, ...]
    reckoned: NDArray[np.float64]

    @property
    def times_s(self) -> NDArray[np.float64]:
        """Of the steps (n,)."""
        return np.array([estimate.time_s for estimate in self.estimates])

    @property
    def poses(self) -> NDArray[np.float64]:
        """x, y, yaw (n, 3)."""
        return np.array([estimate.pose for estimate in self.estimates])

    @property
    def covariances(self) -> NDArray[np.float64]:
        """Of the poses (n, 3, 3)."""
        return np.array([estimate.covariance for estimate in self.estimates])

    def counts(self, accepted: bool) -> NDArray[np.intp]:
        """How many sightings were let through (n,), or were not."""
        return np.array(
            [
                sum((judged.verdict == "accepted") == accepted for judged in estimate.judgements)
                for estimate in self.estimates
            ]
        )

    @property
    def gate_opens(self) -> int | None:
        """The first step at which most of what is seen is let through, or None: at none."""
        accepted, rejected = self.counts(True), self.counts(False)
        steps = np.flatnonzero((accepted > 0) & (accepted >= rejected))
        return int(steps[0]) if len(steps) else None

    def errors_m(self, true_poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance from the true position (n,)."""
        return np.linalg.norm(self.poses[:, :2] - true_poses[:, :2], axis=1)

    def reckoned_errors_m(self, true_poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """The same by the wheels alone."""
        return np.linalg.norm(self.reckoned[:, :2] - true_poses[:, :2], axis=1)

    def nees(self, true_poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Normalised estimation error squared (n,); NaN where there is no doubt at all."""
        return nees(pose_errors(self.poses, true_poses), self.covariances)


def notices(track: Track, parameters: FilterParameters) -> list[str]:
    """What somebody should know: for how long nothing was let through, or nothing was seen."""
    told, limit = [], parameters.measurement.report_after_steps
    first = None
    for k, estimate in enumerate((*track.estimates, None)):
        if estimate is not None and estimate.steps_rejected > 0:
            first = k if first is None else first
            continue
        if first is not None and k - first >= limit:
            told.append(
                f"steps {first} to {k - 1}: none of the landmarks that were seen passed the gate; "
                "the estimate went by the wheels, and its doubt grew"
            )
        first = None
    blind = [k for k, estimate in enumerate(track.estimates) if k and not estimate.judgements]
    if blind:
        shown = ", ".join(map(str, blind[:8])) + (", ..." if len(blind) > 8 else "")
        told.append(f"{len(blind)} of {len(track.estimates) - 1} steps show no landmark: {shown}")
    return told
