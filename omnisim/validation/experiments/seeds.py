"""Monte Carlo runs: odometry and pixel noise, drawn for each seed.

Images do not depend on odometry, so a run is recorded once. Each seed draws the noise of the
odometry and of the pixels, and landmarks are detected again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.core.trajectories.odometry import Odometry, OdometryErrors
from omnisim.perception.landmarks.landmark_detector import Detection, LandmarkDetector
from omnisim.perception.localization.filter import LandmarkMap, Observation
from omnisim.perception.localization.filter_parameters import FilterParameters
from omnisim.perception.localization.track import Interval, Track, localize, mean_interval
from omnisim.robots import simulate_odometry
from omnisim.runs.run_data import RunData

PIXEL_SIGMA = 2.0  # of 255, of each seed's own noise
Progress = Callable[[str, int], Callable[[Iterable[int]], Iterable[int]]]


def detect_with_noise(
    run: RunData, detector: LandmarkDetector, seeds: int, progress: Progress
) -> list[list[list[Detection]]]:
    """Detections of each seed and step, in images with each seed's pixel noise."""
    images = list(run.images())
    detections = []
    for seed in progress(f"images with noise of {seeds} seeds", seeds)(range(seeds)):
        generator = np.random.default_rng([1, seed])
        detections.append([detector(noisy(image, generator)) for image in images])
    return detections


def noisy(image: NDArray[np.uint8], generator: np.random.Generator) -> NDArray[np.uint8]:
    """Image (height, width, 3) with added pixel noise."""
    noise = PIXEL_SIGMA * generator.standard_normal(image.shape, dtype=np.float32)
    return np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)


@dataclass(frozen=True, eq=False)
class SeedRuns:
    """Tracks of all seeds, and their errors.

    Attributes:
        tracks: tracks, one per seed.
        errors_m, reckoned_m: (seeds, steps) position errors of the filter and of odometry alone.
        nees: (seeds, steps) normalized estimation errors squared; NaN without uncertainty.
        nis, nis_degrees: (seeds, steps) normalized innovations squared, and their degrees of
            freedom; NaN and 0 without accepted observations.
    """

    tracks: tuple[Track, ...]
    errors_m: NDArray[np.float64]
    reckoned_m: NDArray[np.float64]
    nees: NDArray[np.float64]
    nis: NDArray[np.float64]
    nis_degrees: NDArray[np.intp]

    @property
    def nees_interval(self) -> Interval:
        """95 % interval of the seeds' mean NEES at a step."""
        return mean_interval(3, len(self.tracks))

    @property
    def nees_by_step(self) -> NDArray[np.float64]:
        """Mean NEES of the seeds (steps,); NaN: no seed has uncertainty."""
        return _mean(self.nees)

    @property
    def nis_by_step(self) -> NDArray[np.float64]:
        """NIS per degree of freedom of all seeds together (steps,)."""
        degrees = self.nis_degrees.sum(axis=0)
        return np.where(degrees > 0, np.nansum(self.nis, axis=0) / np.maximum(degrees, 1), np.nan)

    @property
    def nis_intervals(self) -> list[Interval]:
        """95 % intervals of the NIS per degree of freedom, one per step."""
        return [mean_interval(1, max(int(total), 1)) for total in self.nis_degrees.sum(axis=0)]

    @property
    def gate_opening_steps(self) -> NDArray[np.float64]:
        """Step (seeds,) at which the gate opens; infinite: it never opens."""
        steps = [track.gate_opening_step for track in self.tracks]
        return np.array([math.inf if step is None else step for step in steps])


def run_seeds(
    run: RunData,
    wheels: OdometryErrors,
    observations: Sequence[Sequence[Sequence[Observation]]],
    parameters: FilterParameters,
    covariance: ArrayLike | None = None,
    prepare: Callable[[Odometry], Odometry] = lambda odometry: odometry,
) -> SeedRuns:
    """Localize a run once per seed.

    Args:
        run: run with ground truth.
        wheels: errors of the odometry; each seed has its own noise.
        observations: observations by seed and step.
        parameters: parameters of the filter.
        covariance: (3, 3) covariance of the start pose; None: from the parameters.
        prepare: function that changes each seed's odometry before the filter runs.
    """
    assert run.truth is not None
    truth = run.true_poses
    assert truth is not None
    landmarks = LandmarkMap.of_scene(run.landmarks)
    tracks = []
    for seed, seen in enumerate(observations):
        odometry = prepare(simulate_odometry(run.truth, wheels, seed))
        tracks.append(
            localize(odometry, seen, landmarks, parameters, run.mount.position_m, covariance)
        )
    return SeedRuns(
        tuple(tracks),
        np.array([track.errors_m(truth) for track in tracks]),
        np.array([track.reckoned_errors_m(truth) for track in tracks]),
        np.array([track.nees(truth) for track in tracks]),
        np.array([[each.nis for each in track.estimates] for track in tracks]),
        np.array([[each.nis_degrees for each in track.estimates] for track in tracks]),
    )


def in_field_of_view(
    observations: Sequence[Sequence[Observation]], field_of_view_rad: float
) -> list[list[Observation]]:
    """Observations of each step within a horizontal field of view, centered on the front."""
    half = 0.5 * field_of_view_rad
    return [[seen for seen in step if abs(seen.bearing_rad) <= half] for step in observations]


def _mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean of the finite values along the first axis."""
    known = np.isfinite(values)
    count = known.sum(axis=0)
    total = np.where(known, values, 0.0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
