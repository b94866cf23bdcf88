"""Results of the paper's two experiments."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from omnisim.perception.landmarks.color_model import PixelRates, Training, pixel_rates
from omnisim.perception.landmarks.landmark_detector import Detection, LandmarkDetector
from omnisim.perception.localization.filter import LandmarkMap, Observation
from omnisim.perception.localization.filter_parameters import FilterParameters, read_parameters
from omnisim.perception.localization.localize import observation_from_detection
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.run_data import RunData, RunLabels
from omnisim.validation.experiments.detection_accuracy import DetectionMatch, compare
from omnisim.validation.experiments.hand_picking import Hand, pick_landmarks
from omnisim.validation.experiments.real_setting import with_wrong_start
from omnisim.validation.experiments.seeds import Progress, detect_with_noise, run_seeds

REAL_PARAMETERS = Path(__file__).with_name("real_setting.toml")
SEEDS = 20


class Experiment:
    """Detections and pixel rates of a run.

    Args:
        run: run with labels and ground truth.
        trained: trained color model.
        robot: name of the run's robot.
        progress: reports progress over the steps.
    """

    def __init__(self, run: RunData, trained: Training, robot: str, progress: Progress):
        self.run = run
        self.detector = LandmarkDetector(trained.model, run.landmarks, run.mount)
        self.detections, self.milliseconds = _timed(run, self.detector, progress)
        self.matches = _compared(run, self.detections)
        self.pixels = _pixel_rates(run, trained, progress)
        self.odometry_errors = Vehicle.load(robot).odometry


class SimulationExperiment(Experiment):
    """Experiment 1, with the tracks of all seeds."""

    def __init__(
        self, run: RunData, trained: Training, parameters: FilterParameters, progress: Progress
    ):
        super().__init__(run, trained, "p2at", progress)
        self.parameters = parameters
        noisy = detect_with_noise(run, self.detector, SEEDS, progress)
        self.observations = [observations_from_detections(each, parameters) for each in noisy]
        self.seeds = run_seeds(run, self.odometry_errors, self.observations, parameters)


class RealExperiment(Experiment):
    """Experiment 2, with the tracks of all seeds of three variants.

    `seeds` has landmarks picked by hand and the parameters of the real setting. `honest` has the
    same landmarks and experiment 1's parameters. `automatic` has detected landmarks and the true
    start.
    """

    def __init__(
        self, run: RunData, trained: Training, parameters: FilterParameters, progress: Progress
    ):
        super().__init__(run, trained, "superscout", progress)
        self.parameters = read_parameters(REAL_PARAMETERS)
        picked = [_picked(run, seed) for seed in range(SEEDS)]
        errors, certain = self.odometry_errors, np.zeros((3, 3))
        self.seeds = run_seeds(run, errors, picked, self.parameters, certain, with_wrong_start)
        self.honest = run_seeds(run, errors, picked, parameters, certain, with_wrong_start)
        automatic = observations_from_detections(self.detections, parameters)
        self.automatic = run_seeds(run, errors, [automatic] * SEEDS, parameters)


def _timed(
    run: RunData, detector: LandmarkDetector, progress: Progress
) -> tuple[list[list[Detection]], float]:
    """Detections of all steps, and the median time per image in milliseconds.

    The time is that of this thread only.
    """
    detections, times = [], []
    for step in progress(f"landmarks: {run.folder.path.name}", run.steps)(range(run.steps)):
        image = run.image(step)
        start = time.thread_time()
        detections.append(detector(image))
        times.append(time.thread_time() - start)
    return detections, 1e3 * float(np.median(times))


def _compared(run: RunData, detections: Sequence[Sequence[Detection]]) -> list[DetectionMatch]:
    poses = run.true_poses
    assert poses is not None
    landmarks = LandmarkMap.of_scene(run.landmarks)
    return compare(detections, poses, landmarks, run.mount.position_m)


def _pixel_rates(run: RunData, trained: Training, progress: Progress) -> PixelRates:
    labels = RunLabels(run, trained.model.colors)
    track = progress(f"pixels: {run.folder.path.name}", run.steps)
    return pixel_rates(trained.model, labels.pixels(track))


def observations_from_detections(
    detections: Sequence[Sequence[Detection]], parameters: FilterParameters
) -> list[list[Observation]]:
    """Observations for the filter from the detections of each step."""
    return [
        [observation_from_detection(each, parameters.measurement) for each in step]
        for step in detections
    ]


def _picked(run: RunData, seed: int) -> list[list[Observation]]:
    """Observations of each step of a run, by simulated picking of landmarks by hand."""
    generator = np.random.default_rng([3, seed])
    landmarks = LandmarkMap.of_scene(run.landmarks)
    poses = run.true_poses
    assert poses is not None
    return [pick_landmarks(pose, run.mount, landmarks, Hand(), generator) for pose in poses]
