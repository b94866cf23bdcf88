"""Results of the paper's two experiments, over seeds of the noise of odometry and pixels.

Images do not depend on odometry, so a run is recorded once. Each seed draws the noise of the
odometry and of the pixels, and landmarks are detected again.

The paper's authors picked landmarks in the images of the real robot by hand, since their classifier
had too many false positives. Only in this picking do observations come from the true pose; the
filter gets the range and bearing of the picked pixels and nothing else.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.arrays import Bytes, Floats, Indices
from omnisim.core.poses import wrap_angle
from omnisim.core.trajectories.odometry import Odometry, OdometryErrors
from omnisim.perception.landmarks.color_model import Training, pixel_rates
from omnisim.perception.landmarks.landmark_detector import Detection, LandmarkDetector
from omnisim.perception.localization.filter import (
    FilterParameters,
    LandmarkMap,
    Observation,
    predict_measurement,
    read_parameters,
)
from omnisim.perception.localization.track import (
    Interval,
    Track,
    localize,
    mean_interval,
    observation_from_detection,
)
from omnisim.perception.unwarping import CameraMount
from omnisim.robots import simulate_odometry
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.run_data import RunData, RunLabels
from omnisim.validation.experiments.recordings import Progress, with_wrong_start

PIXEL_SIGMA = 2.0  # of 255, of each seed's own noise
REAL_PARAMETERS = Path(__file__).with_name("real_setting.toml")
SEEDS = 20


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


def noisy(image: Bytes, generator: np.random.Generator) -> Bytes:
    """Image (height, width, 3) with added pixel noise."""
    noise = PIXEL_SIGMA * generator.standard_normal(image.shape, dtype=np.float32)
    return np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)


@dataclass(frozen=True, eq=False)
class SeedRuns:
    """Tracks of all seeds, and their errors."""

    tracks: tuple[Track, ...]  # tracks, one per seed
    # (seeds, steps) position errors of the filter and of odometry alone
    errors_m: Floats
    reckoned_m: Floats
    # (seeds, steps) normalized estimation errors squared; NaN without uncertainty
    nees: Floats
    # (seeds, steps) normalized innovations squared, and their degrees of freedom; NaN and 0 without
    # accepted observations
    nis: Floats
    nis_degrees: Indices

    @property
    def nees_interval(self) -> Interval:
        """95 % interval of the seeds' mean NEES at a step."""
        return mean_interval(3, len(self.tracks))

    @property
    def nees_by_step(self) -> Floats:
        """Mean NEES of the seeds (steps,); NaN: no seed has uncertainty."""
        known = np.isfinite(self.nees)
        count, total = known.sum(axis=0), np.where(known, self.nees, 0.0).sum(axis=0)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)

    @property
    def nis_by_step(self) -> Floats:
        """NIS per degree of freedom of all seeds together (steps,)."""
        degrees = self.nis_degrees.sum(axis=0)
        return np.where(degrees > 0, np.nansum(self.nis, axis=0) / np.maximum(degrees, 1), np.nan)

    @property
    def nis_intervals(self) -> list[Interval]:
        """95 % intervals of the NIS per degree of freedom, one per step."""
        return [mean_interval(1, max(int(total), 1)) for total in self.nis_degrees.sum(axis=0)]

    @property
    def gate_opening_steps(self) -> Floats:
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


@dataclass(frozen=True)
class Hand:
    """Noise and limits of picking by hand."""

    sigma_px: float = 1.5  # standard deviation of a picked point, along both image axes
    farthest_m: float = 3.5  # maximum distance of a pickable landmark
    # maximum angle below the horizon; the vehicle hides nearer landmarks
    steepest_rad: float = math.radians(58.0)


def pick_landmarks(
    pose: Floats,
    mount: CameraMount,
    landmarks: LandmarkMap,
    hand: Hand,
    generator: np.random.Generator,
) -> list[Observation]:
    """Pick the feet (corners on the ground) of the landmarks that are visible from a true pose.

    A wide landmark's range is that of its nearest foot; its bearing is the middle of its two
    outermost feet.

    Args:
        pose: (3,) x, y, yaw of the base.
        mount: camera on the vehicle.
        landmarks: landmarks at their true positions.
        hand: noise and limits.
        generator: random numbers of the noise.
    """
    observations = []
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    base_from_world = np.array([[cosine, sine], [-sine, cosine]])
    for name, corners in landmarks.corners_m.items():
        # from below the effective viewpoint, along the vehicle's axes
        offsets = (np.array(corners) - pose[:2]) @ base_from_world.T - mount.position_m
        distances = np.linalg.norm(offsets, axis=1)
        nearest = int(distances.argmin())
        steep_rad = math.atan2(mount.height_m, float(distances[nearest]))
        if distances[nearest] > hand.farthest_m or steep_rad > hand.steepest_rad:
            continue
        x, y = offsets.sum(axis=0)  # directions relative to that of the sum
        about = np.arctan2(x * offsets[:, 1] - y * offsets[:, 0], offsets @ (x, y))
        outer = sorted({int(about.argmin()), int(about.argmax())})
        picked = _pick(mount, offsets[[nearest, *outer]], hand, generator)
        if picked is None:
            continue
        range_m, bearings = float(picked[0][0]), picked[1]
        middle = wrap_angle(bearings[1] + 0.5 * wrap_angle(bearings[-1] - bearings[1]))
        range_sigma_m, bearing_sigma_rad = _sigmas(mount, range_m, hand.sigma_px)
        sigmas = range_sigma_m, bearing_sigma_rad / math.sqrt(len(outer))
        observations.append(Observation((name,), range_m, middle, *sigmas))
    return observations


def _pick(
    mount: CameraMount, offsets: Floats, hand: Hand, generator: np.random.Generator
) -> tuple[Floats, Floats] | None:
    """Ranges and bearings of picked points on the ground; None: a point is outside the image."""
    rotation = mount.base_from_optical[:3, :3]
    rays = np.column_stack((offsets, np.full(len(offsets), -mount.height_m)))
    pixels = mount.camera.pixel_from_ray(rays @ rotation)
    noisy = pixels.positions_px + hand.sigma_px * generator.standard_normal((len(offsets), 2))
    picked = mount.camera.ray_from_pixel(noisy)
    level = picked.directions @ rotation.T
    below = level[:, 2] < 0.0
    if not np.all(pixels.valid & picked.valid & below):
        return None
    ranges = mount.height_m * np.hypot(level[:, 0], level[:, 1]) / -level[:, 2]
    return ranges, np.arctan2(level[:, 1], level[:, 0])


def _sigmas(mount: CameraMount, range_m: float, sigma_px: float) -> tuple[float, float]:
    """Standard deviations, in m and rad, of range and bearing of a point picked with `sigma_px`."""
    step = 1e-4
    rotation = mount.base_from_optical[:3, :3]
    theta = math.atan2(range_m, mount.height_m)
    rays = [
        (math.sin(angle) * math.cos(yaw), math.sin(angle) * math.sin(yaw), -math.cos(angle))
        for angle, yaw in ((theta, 0.0), (theta + step, 0.0), (theta, step))
    ]
    picked, outward, sideways = mount.camera.pixel_from_ray(np.array(rays) @ rotation).positions_px
    by_theta = (range_m**2 + mount.height_m**2) / mount.height_m
    return (
        sigma_px * step * by_theta / float(np.linalg.norm(outward - picked)),
        sigma_px * step / float(np.linalg.norm(sideways - picked)),
    )


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
        poses = run.true_poses
        assert poses is not None
        landmarks = LandmarkMap.of_scene(run.landmarks)
        self.matches = compare(self.detections, poses, landmarks, run.mount.position_m)
        labels = RunLabels(run, trained.model.colors)
        track = progress(f"pixels: {run.folder.path.name}", run.steps)
        self.pixels = pixel_rates(trained.model, labels.pixels(track))
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
        landmarks, poses = LandmarkMap.of_scene(run.landmarks), run.true_poses
        assert poses is not None
        generators = (np.random.default_rng([3, seed]) for seed in range(SEEDS))
        picked = [
            [pick_landmarks(pose, run.mount, landmarks, Hand(), generator) for pose in poses]
            for generator in generators
        ]
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


def observations_from_detections(
    detections: Sequence[Sequence[Detection]], parameters: FilterParameters
) -> list[list[Observation]]:
    """Observations for the filter from the detections of each step."""
    return [
        [observation_from_detection(each, parameters.measurement) for each in step]
        for step in detections
    ]


# Accuracy of a landmark detector: recall, precision and errors by distance.


# Maximum errors of a true positive.
FOUND_WITHIN_RAD = math.radians(3.0)
FOUND_WITHIN_SHARE = 0.25


@dataclass(frozen=True)
class DetectionMatch:
    """Landmark in one image, with its detection."""

    step: int  # step of the image
    landmark: str  # name of the landmark
    range_m: float  # true range
    detection: Detection | None  # detection of the landmark; None: not detected
    # detected minus true values; NaN without a detection
    range_error_m: float = math.nan
    bearing_error_rad: float = math.nan

    @property
    def is_right(self) -> bool:
        """True if the detection is close enough to the landmark."""
        if self.detection is None:
            return False
        slack_m = max(FOUND_WITHIN_SHARE * self.range_m, 3.0 * self.detection.range_sigma_m)
        return (
            abs(self.bearing_error_rad) <= FOUND_WITHIN_RAD and abs(self.range_error_m) <= slack_m
        )


def compare(
    detections: Sequence[Sequence[Detection]],
    true_poses: Floats,
    landmarks: LandmarkMap,
    camera_m: tuple[float, float],
) -> list[DetectionMatch]:
    """Match detections of each step with the landmarks at the true pose.

    Args:
        true_poses: (steps, 3) x, y, yaw of the base.
        landmarks: landmarks at their true positions.
        camera_m: position (x, y) of the camera in the base frame.
    """
    matches = []
    for step, (pose, of_step) in enumerate(zip(true_poses.tolist(), detections, strict=True)):
        by_name = {detection.landmark: detection for detection in of_step}
        for name, corners in landmarks.corners_m.items():
            expected = predict_measurement(tuple(pose), camera_m, corners)
            range_m, bearing_rad = expected[0], expected[4]
            detection = by_name.get(name)
            if detection is None:
                matches.append(DetectionMatch(step, name, range_m, None))
                continue
            range_error_m = detection.range_m - range_m
            off_rad = wrap_angle(detection.bearing_rad - bearing_rad)
            matches.append(DetectionMatch(step, name, range_m, detection, range_error_m, off_rad))
    return matches


@dataclass(frozen=True)
class Accuracy:
    """Accuracy of a detector in a range interval."""

    recall: float  # true positives as a share of landmarks
    precision: float  # true positives as a share of detections
    bearing_rms_rad: float  # RMS bearing error of true positives
    # RMS range errors of true positives as shares of the true range, by the exact relation and by
    # Eq. 2
    range_rms_share: float
    range_eq2_rms_share: float
    eq2_mean_m: float  # mean of the range by Eq. 2 minus the range by the exact relation
    count: int  # number of true positives


def accuracy(matches: Sequence[DetectionMatch], nearest_m: float, farthest_m: float) -> Accuracy:
    """Accuracy for landmarks with true ranges in an interval; NaN without landmarks."""
    present = [each for each in matches if nearest_m <= each.range_m < farthest_m]
    seen = [each for each in present if each.detection is not None]
    right = [each for each in seen if each.is_right]

    def share(part: int, whole: int) -> float:
        return part / whole if whole else math.nan

    bearings = np.array([each.bearing_error_rad for each in right])
    ranges = np.array([each.range_m for each in right])
    errors = np.array([each.range_error_m for each in right])
    paper = np.array([each.detection.range_eq2_m for each in right if each.detection])
    exact = np.array([each.detection.range_m for each in right if each.detection])
    shares = share(len(right), len(present)), share(len(right), len(seen))
    rms = _rms(bearings), _rms(errors / ranges), _rms((errors + paper - exact) / ranges)
    eq2_m = float(np.mean(paper - exact)) if right else math.nan
    return Accuracy(*shares, *rms, eq2_m, len(right))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else math.nan
