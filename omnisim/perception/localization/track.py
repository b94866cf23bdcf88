"""Estimates of a whole run, and notices about their quality."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.core.short_repr import counted, short_repr
from omnisim.perception.localization.consistency import nees, pose_errors
from omnisim.perception.localization.filter import Estimate
from omnisim.perception.localization.filter_parameters import FilterParameters


@dataclass(frozen=True, eq=False)
class Track:
    """Estimates of a run, one per step; the first is the start.

    Attributes:
        estimates: estimates of the filter.
        reckoned: (n, 3) x, y, yaw by dead reckoning.
    """

    estimates: tuple[Estimate, ...]
    reckoned: NDArray[np.float64]

    def __repr__(self) -> str:
        return short_repr(self, counted(len(self.estimates), "estimate"))

    @property
    def times_s(self) -> NDArray[np.float64]:
        """Times (n,) of the steps."""
        return np.array([estimate.time_s for estimate in self.estimates])

    @property
    def poses(self) -> NDArray[np.float64]:
        """Poses x, y, yaw (n, 3)."""
        return np.array([estimate.pose for estimate in self.estimates])

    @property
    def covariances(self) -> NDArray[np.float64]:
        """Covariances (n, 3, 3) of the poses."""
        return np.array([estimate.covariance for estimate in self.estimates])

    def counts(self, accepted: bool) -> NDArray[np.intp]:
        """Numbers (n,) of accepted, or of rejected, observations."""
        return np.array(
            [
                sum((each.verdict == "accepted") == accepted for each in estimate.associations)
                for estimate in self.estimates
            ]
        )

    @property
    def gate_opening_step(self) -> int | None:
        """First step that accepts at least half of its observations; None: no step does."""
        accepted, rejected = self.counts(True), self.counts(False)
        steps = np.flatnonzero((accepted > 0) & (accepted >= rejected))
        return int(steps[0]) if len(steps) else None

    def errors_m(self, true_poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distances (n,) of the estimates from the true positions."""
        return _distances(self.poses, true_poses)

    def reckoned_errors_m(self, true_poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distances (n,) of dead reckoning from the true positions."""
        return _distances(self.reckoned, true_poses)

    def nees(self, true_poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Normalized estimation error squared (n,); NaN where the covariance is singular."""
        return nees(pose_errors(self.poses, true_poses), self.covariances)


def _distances(poses: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64]:
    distances: NDArray[np.float64] = np.linalg.norm(poses[:, :2] - others[:, :2], axis=1)
    return distances


def notices(track: Track, parameters: FilterParameters) -> list[str]:
    """Notices of long rejection and of steps without observations."""
    texts, limit = [], parameters.measurement.report_after_steps
    first = None
    for k, estimate in enumerate((*track.estimates, None)):
        if estimate is not None and estimate.steps_rejected > 0:
            first = k if first is None else first
            continue
        if first is not None and k - first >= limit:
            texts.append(
                f"steps {first} to {k - 1}: none of the landmarks that were seen passed the gate; "
                "the estimate went by the wheels, and its doubt grew"
            )
        first = None
    blind = [k for k, estimate in enumerate(track.estimates) if k and not estimate.associations]
    if blind:
        shown = ", ".join(map(str, blind[:8])) + (", ..." if len(blind) > 8 else "")
        texts.append(f"{len(blind)} of {len(track.estimates) - 1} steps show no landmark: {shown}")
    return texts
