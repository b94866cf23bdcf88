"""The extended Kalman filter of the paper: state (x, y, φ), control (v, δφ), measurement (r, γ).

Each observation of an image is gated against the same prediction, and all accepted observations
update the prediction together: the order of the observations makes no difference.

Source: Schmits & Visser 2008, Eq. 4 to 6; the update in Joseph's form, as in Bar-Shalom, Li,
Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, section 5.2.6.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from omnisim.core.arrays import Floats
from omnisim.core.errors import LocalizationError
from omnisim.core.files.parameters import Number, Parameters
from omnisim.core.files.toml_file import read_toml
from omnisim.core.poses import wrap_angle
from omnisim.scene.model import Landmark

Verdict = Literal["accepted", "gated", "superseded", "singular"]
_EYE = np.eye(3)
_DISTANCE = attrgetter("distance_squared")
# A symmetric matrix is singular if its determinant is below this share of the maximum possible one.
_SINGULAR = 1e-12


class Association(NamedTuple):
    """Data association of one observation with the most likely landmark.

    Accepted; gated: outside the validation gate; superseded: another observation fits this landmark
    better; singular: the innovation covariance has no inverse.
    """

    landmark: str
    range_m: float  # measured
    bearing_rad: float
    range_innovation_m: float  # measured minus expected
    bearing_innovation_rad: float
    distance_squared: float  # squared Mahalanobis distance; infinite: singular
    verdict: Verdict


@dataclass(frozen=True, eq=False)
class Estimate:
    """Belief after a step."""

    time_s: float
    pose: Floats  # (3,) x and y in meters, yaw in radians within ±π
    covariance: Floats  # (3, 3) of the pose
    associations: tuple[Association, ...] = ()  # in the order of the observations
    nis: float = math.nan  # normalized innovation squared of all accepted observations; NaN: none
    nis_degrees: int = 0  # its degrees of freedom
    steps_rejected: int = 0  # successive steps, up to this one, with all observations rejected


class _Hypothesis(NamedTuple):
    """Observation assigned to a landmark."""

    observation: Observation
    landmark: str
    distance_squared: float  # of Mahalanobis; infinite where there is no inverse
    jacobian: tuple[float, ...]  # range by x, y, yaw, then bearing
    variances: tuple[float, float]  # m², rad²
    innovation: tuple[float, float]  # m, rad: measured less expected

    def association(self, verdict: Verdict) -> Association:
        seen = self.observation
        return Association(
            self.landmark, seen.range_m, seen.bearing_rad, *self.innovation,
            self.distance_squared, verdict,
        )  # fmt: skip


class LocalizationFilter:
    """Extended Kalman filter of one robot's pose.

    Args:
        landmarks, parameters: map of the landmarks; noise and gate.
        camera_m: x and y of the effective viewpoint in the base frame.
        time_s, pose: time of the start, and its x, y, yaw (3,).
        covariance: (3, 3) covariance of the start; None: from the parameters.

    Raises:
        LocalizationError: a start that is not finite, or an invalid covariance.
    """

    def __init__(
        self,
        landmarks: LandmarkMap,
        parameters: FilterParameters,
        camera_m: tuple[float, float],
        time_s: float,
        pose: ArrayLike,
        covariance: ArrayLike | None = None,
    ):
        self._landmarks, self._parameters = landmarks, parameters
        self._camera_m = camera_m
        start = np.array(pose, dtype=np.float64)
        if covariance is None:
            sigma_m = parameters.start.position_sigma_m
            sigma_rad = parameters.start.heading_sigma_rad
            covariance = np.diag([sigma_m**2, sigma_m**2, sigma_rad**2])
        prior = np.asarray(covariance, dtype=np.float64)
        if start.shape != (3,) or not np.all(np.isfinite((*start, time_s))):
            raise LocalizationError(
                f"start: expected finite x, y, yaw and time, got {start.tolist()} at {time_s} s"
            )
        if (
            prior.shape != (3, 3)
            or not np.all(np.isfinite(prior))
            or not np.array_equal(prior, prior.T)
            or np.linalg.eigvalsh(prior)[0] < 0.0
        ):
            raise LocalizationError("start: expected a symmetric covariance (3, 3), not negative")
        start[2] = wrap_angle(start[2])
        self.estimate = Estimate(float(time_s), start, prior)

    def step(
        self,
        time_s: float,
        speed_mps: float,
        turn_rad: float,
        observations: Sequence[Observation] = (),
    ) -> Estimate:
        """Predict the pose at a time, and update it with the observations at that time.

        Args:
            time_s: time of the step.
            speed_mps: mean speed along the arc since the previous step, negative backward.
            turn_rad: turn since the previous step.
            observations: observations of the image at `time_s`.

        Raises:
            LocalizationError: a time that does not increase, or readings that are not finite; the
                estimate is then unchanged.
        """
        before = self.estimate
        if not time_s > before.time_s:
            raise LocalizationError(
                f"step: expected a time after {before.time_s:.9g} s, the last step's, "
                f"got {time_s:.9g} s"
            )
        if not (math.isfinite(time_s) and math.isfinite(speed_mps) and math.isfinite(turn_rad)):
            raise LocalizationError(
                f"step: expected finite numbers, got {time_s} s, {speed_mps} m/s and a turn of "
                f"{turn_rad} rad"
            )
        distance_m = speed_mps * (time_s - before.time_s)
        sigma_m, sigma_rad = self._parameters.motion.sigmas(distance_m, turn_rad)
        pose, by_pose, by_control = move(before.pose, distance_m, turn_rad)
        spread = by_control * (sigma_m, sigma_rad)
        covariance = by_pose @ before.covariance @ by_pose.T + spread @ spread.T
        self.estimate = self._update(time_s, pose, covariance, observations)
        return self.estimate

    def _update(
        self, time_s: float, pose: Floats, covariance: Floats, observations: Sequence[Observation]
    ) -> Estimate:
        """Correct a prediction by observations."""
        rejected = self.estimate.steps_rejected
        if not observations:
            return _estimate(time_s, pose, covariance, steps_rejected=rejected)
        hypotheses, verdicts = self._associate(pose, covariance, observations)
        accepted = [h for h, v in zip(hypotheses, verdicts, strict=True) if v == "accepted"]
        if accepted:
            h = np.array([each.jacobian for each in accepted]).reshape(-1, 3)
            r = np.array([each.variances for each in accepted]).reshape(-1)
            nu = np.array([each.innovation for each in accepted]).reshape(-1)
            across = h @ covariance
            s = across @ h.T
            s.flat[:: len(r) + 1] += r
            try:
                weights = np.linalg.inv(s)
            except np.linalg.LinAlgError:  # each is invertible, but not all of them together
                verdicts = ["singular" if v == "accepted" else v for v in verdicts]
                accepted = []
        associations = tuple(h.association(v) for h, v in zip(hypotheses, verdicts, strict=True))
        if not accepted:
            return _estimate(time_s, pose, covariance, associations, rejected + 1)
        gain = across.T @ weights
        kept = _EYE - gain @ h
        corrected = kept @ covariance @ kept.T + (gain * r) @ gain.T
        nis = float(nu @ weights @ nu)
        return _estimate(time_s, pose + gain @ nu, corrected, associations, 0, nis, len(nu))

    def _associate(
        self, pose: Floats, covariance: Floats, observations: Sequence[Observation]
    ) -> tuple[list[_Hypothesis], list[Verdict]]:
        """Gate each observation, and assign the nearest one to each landmark."""
        for observation in observations:
            if not (
                observation.candidates
                and math.isfinite(observation.range_m)
                and math.isfinite(observation.bearing_rad)
                and 0.0 <= observation.range_sigma_m < math.inf
                and 0.0 <= observation.bearing_sigma_rad < math.inf
            ):
                raise LocalizationError(
                    "observation: expected a candidate, finite numbers, and sigmas of 0 or more, "
                    f"got {observation}"
                )
        x, y, yaw = pose.tolist()
        spread = covariance.tolist()
        nearest = [
            min(
                (self._hypothesis(each, name, (x, y, yaw), spread) for name in each.candidates),
                key=_DISTANCE,
            )
            for each in observations
        ]
        holders: dict[str, _Hypothesis] = {}  # by landmark
        for each in nearest:
            holders[each.landmark] = min(holders.get(each.landmark, each), each, key=_DISTANCE)
        gate = self._parameters.measurement.gate
        verdicts: list[Verdict] = []
        for each in nearest:
            if each.distance_squared == math.inf:
                verdicts.append("singular")
            elif each.distance_squared > gate:
                verdicts.append("gated")
            else:
                verdicts.append("accepted" if holders[each.landmark] is each else "superseded")
        return nearest, verdicts

    def _hypothesis(
        self,
        observation: Observation,
        landmark: str,
        pose: tuple[float, float, float],
        covariance: list[list[float]],
    ) -> _Hypothesis:
        """Assign an observation to a landmark, in plain floats: they are faster than NumPy here."""
        range_m, a0, a1, a2, bearing, b0, b1, b2 = predict_measurement(
            pose, self._camera_m, self._landmarks.corners(landmark)
        )
        extra = self._parameters.measurement
        variance_m2 = (
            observation.range_sigma_m**2
            + (extra.range_sigma_share * observation.range_m) ** 2
            + extra.range_sigma_m**2
        )
        variance_rad2 = observation.bearing_sigma_rad**2 + extra.bearing_sigma_rad**2
        (p00, p01, p02), (_, p11, p12), (_, _, p22) = covariance
        # the covariance times the bearing's row of the Jacobian
        q0 = p00 * b0 + p01 * b1 + p02 * b2
        q1 = p01 * b0 + p11 * b1 + p12 * b2
        q2 = p02 * b0 + p12 * b1 + p22 * b2
        # the innovation covariance ((s_mm, s_mr), (s_mr, s_rr))
        s_mr = a0 * q0 + a1 * q1 + a2 * q2
        s_mm = variance_m2 + p00 * a0 * a0 + p11 * a1 * a1 + p22 * a2 * a2
        s_mm += 2.0 * (p01 * a0 * a1 + p02 * a0 * a2 + p12 * a1 * a2)
        s_rr = variance_rad2 + b0 * q0 + b1 * q1 + b2 * q2
        nu_m = observation.range_m - range_m
        nu_rad = wrap_angle(observation.bearing_rad - bearing)
        determinant = s_mm * s_rr - s_mr * s_mr
        distance = math.inf
        if determinant > _SINGULAR * s_mm * s_rr:
            weighted = s_rr * nu_m * nu_m - 2.0 * s_mr * nu_m * nu_rad + s_mm * nu_rad**2
            distance = weighted / determinant
        return _Hypothesis(
            observation, landmark, distance, (a0, a1, a2, b0, b1, b2),
            (variance_m2, variance_rad2), (nu_m, nu_rad),
        )  # fmt: skip


def _estimate(
    time_s: float,
    pose: Floats,
    covariance: Floats,
    associations: tuple[Association, ...] = (),
    steps_rejected: int = 0,
    nis: float = math.nan,
    nis_degrees: int = 0,
) -> Estimate:
    """Estimate with its yaw wrapped and its covariance symmetric."""
    pose[2] = wrap_angle(pose[2])
    symmetric = 0.5 * (covariance + covariance.T)
    return Estimate(time_s, pose, symmetric, associations, nis, nis_degrees, steps_rejected)


# Measurement model of landmarks: range and bearing, the paper's m = (r, γ).
#
# A slim landmark, such as a beacon, is a point: its axis. A wide landmark, such as a goal, has
# corners: its bearing is the middle between the two corners that are outermost as seen by the
# camera, and its range is that of the nearest corner. An image shows both range and bearing, and
# neither requires the landmark's orientation.


# Minimum distance for a bearing: the camera would be inside the landmark.
NEAREST_M = 1e-6


@dataclass(frozen=True)
class Observation:
    """Measurement of one landmark in one image."""

    # names of the possible landmarks; one if the colors are unambiguous
    candidates: tuple[str, ...]
    range_m: float  # along the ground from below the effective viewpoint
    bearing_rad: float  # counter-clockwise from the vehicle's front
    range_sigma_m: float
    bearing_sigma_rad: float


Corners = tuple[tuple[float, float], ...]  # x and y of a landmark's corners in the world, meters


class LandmarkMap:
    """Map of landmarks: (n, 2) corners in the world by name; a single corner for a point.

    Raises:
        LocalizationError: no landmark, or corners that are not finite.
    """

    def __init__(self, corners_m: Mapping[str, ArrayLike]):
        if not corners_m:
            raise LocalizationError("landmarks: expected at least one to localize by")
        self.corners_m: dict[str, Corners] = {}
        for name, corners in corners_m.items():
            given = np.atleast_2d(np.asarray(corners, dtype=np.float64))
            if given.ndim != 2 or given.shape[1] != 2 or not np.all(np.isfinite(given)):
                raise LocalizationError(f"landmark {name!r}: expected finite corners (x, y)")
            self.corners_m[name] = tuple((x, y) for x, y in given.tolist())

    @classmethod
    def of_scene(
        cls, landmarks: Iterable[Landmark], offsets_m: Mapping[str, ArrayLike] | None = None
    ) -> LandmarkMap:
        """Build the map of a scene's landmarks; errors (2,) by name are added to positions."""
        offsets, corners = offsets_m or {}, {}
        for landmark in landmarks:
            offset = np.asarray(offsets.get(landmark.name, 0.0), dtype=np.float64)
            middle = np.array(landmark.position_m[:2]) + offset
            half = 0.5 * np.array(landmark.footprint_m)
            if landmark.is_slim:
                corners[landmark.name] = middle[None]
            else:
                signs = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
                corners[landmark.name] = middle + signs * half
        return cls(corners)

    def corners(self, name: str) -> Corners:
        """Corners of a landmark.

        Raises:
            LocalizationError: the map does not have it.
        """
        try:
            return self.corners_m[name]
        except KeyError:
            raise LocalizationError(
                f"landmark {name!r}: not on the map, which has {', '.join(self.corners_m)}"
            ) from None


def predict_measurement(
    pose: tuple[float, float, float], camera_m: tuple[float, float], corners_m: Corners
) -> tuple[float, ...]:
    """Predict range and bearing of a landmark from a pose (x, y, yaw), with their Jacobian.

    Gives the range in meters and its derivatives by x, y and yaw; then the bearing in radians, not
    wrapped, and its derivatives. The camera is the effective viewpoint in the base frame. Computes
    in plain floats: for one landmark at a time NumPy takes ten times as long.
    """
    x, y, yaw = pose
    cosine, sine = math.cos(yaw), math.sin(yaw)
    arm_x = cosine * camera_m[0] - sine * camera_m[1]
    arm_y = sine * camera_m[0] + cosine * camera_m[1]
    offsets = [(corner_x - x - arm_x, corner_y - y - arm_y) for corner_x, corner_y in corners_m]
    near_x, near_y = min(offsets, key=lambda offset: offset[0] * offset[0] + offset[1] * offset[1])
    distance = max(math.hypot(near_x, near_y), NEAREST_M)
    unit_x, unit_y = near_x / distance, near_y / distance
    if len(offsets) == 1:
        bearing, right, left = math.atan2(near_y, near_x), offsets[0], offsets[0]
    else:
        # directions relative to their sum, so that none wraps around
        sum_x, sum_y = (sum(axis) for axis in zip(*offsets, strict=True))
        turns = [
            (math.atan2(sum_x * dy - sum_y * dx, sum_x * dx + sum_y * dy), (dx, dy))
            for dx, dy in offsets
        ]
        (low, right), (high, left) = min(turns), max(turns)
        bearing = math.atan2(sum_y, sum_x) + 0.5 * (low + high)
    by_x = by_y = 0.0
    for dx, dy in (right, left):
        squared = max(dx * dx + dy * dy, NEAREST_M**2)
        by_x += 0.5 * dy / squared
        by_y -= 0.5 * dx / squared
    return (
        distance, -unit_x, -unit_y, unit_x * arm_y - unit_y * arm_x,
        bearing - yaw, by_x, by_y, by_y * arm_x - by_x * arm_y - 1.0,
    )  # fmt: skip


# Motion model of a planar pose from wheel readings, and its Jacobians.


# Below, an arc's chord equals its length to rounding: the next term of the series is 1e-18.
_STRAIGHT_RAD = 1e-8


def move(pose: Floats, distance_m: float, turn_rad: float) -> tuple[Floats, Floats, Floats]:
    """Follow an arc from a pose (x, y, yaw); the paper's v times the step's duration, and δφ.

    Gives the new pose (3,), yaw not wrapped, and its Jacobians (3, 3) by the pose and (3, 2) by
    distance (negative backward) and turn.

    Source: the arcs of `omnisim.core.trajectories.odometry`, which dead reckoning follows.
    """
    x, y, yaw = pose.tolist()
    half = 0.5 * turn_rad
    if abs(half) < _STRAIGHT_RAD:
        chord, slope = 1.0, -half / 3.0
    else:
        chord = math.sin(half) / half
        slope = (math.cos(half) - chord) / half  # derivative of the chord by half the turn
    along = yaw + half
    cosine, sine = math.cos(along), math.sin(along)
    dx, dy = distance_m * chord * cosine, distance_m * chord * sine
    by_turn = 0.5 * distance_m
    by_pose = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
    by_control = np.array(
        [
            [chord * cosine, by_turn * (slope * cosine - chord * sine)],
            [chord * sine, by_turn * (slope * sine + chord * cosine)],
            [0.0, 1.0],
        ]
    )
    return np.array([x + dx, y + dy, yaw + turn_rad]), by_pose, by_control


# Parameters of the filter, from a TOML file. `default.toml` explains each.
#
# The paper does not publish any of them: all values are our choices.


DEFAULT = Path(__file__).with_name("default.toml")

# Beyond any sensible value, and far below the overflow of a float's square.
_MAX_NUMBER = 1e12
NotNegative = Annotated[Number, Field(ge=0.0, le=_MAX_NUMBER)]
Positive = Annotated[Number, Field(gt=0.0, le=_MAX_NUMBER)]


@dataclass(frozen=True, kw_only=True)
class StartNoise(Parameters, name="start"):
    """Standard deviations of the first pose."""

    position_sigma_m: NotNegative
    """Standard deviation of x and of y in meters; 0: known exactly."""
    heading_sigma_rad: NotNegative
    """Standard deviation of the heading in degrees; 0: known exactly."""


@dataclass(frozen=True, kw_only=True)
class MotionNoise(Parameters, name="motion"):
    """Noise of the wheels.

    The error from white noise grows with the square root of the distance, the error from systematic
    errors with the distance. A filter with three states cannot estimate systematic errors; it
    treats them as noise of each step.
    """

    distance_sigma_m_per_sqrt_m: NotNegative
    """Standard deviation of the distance after 1 m, meters."""
    distance_sigma_share: NotNegative
    """Standard deviation of a step's distance, as a share of the distance: wrong wheel size."""
    turn_sigma_rad_per_sqrt_m: NotNegative
    """Standard deviation of the heading after 1 m, degrees."""
    turn_sigma_rad_per_sqrt_rad: NotNegative
    """Standard deviation of the heading after a turn of 1 rad, degrees."""
    turn_sigma_rad_per_m: NotNegative
    """Standard deviation of the heading per meter driven, degrees: wheels of unequal size."""
    turn_sigma_share: NotNegative
    """Standard deviation of a step's turn, as a share of the turn: skidding wheels."""

    def sigmas(self, distance_m: float, turn_rad: float) -> tuple[float, float]:
        """Standard deviations of a step's distance in meters and its turn in radians."""
        driven, turned = abs(distance_m), abs(turn_rad)
        distance = math.hypot(
            self.distance_sigma_m_per_sqrt_m * math.sqrt(driven), self.distance_sigma_share * driven
        )
        turn = math.hypot(
            self.turn_sigma_rad_per_sqrt_m * math.sqrt(driven),
            self.turn_sigma_rad_per_sqrt_rad * math.sqrt(turned),
            self.turn_sigma_rad_per_m * driven,
            self.turn_sigma_share * turned,
        )
        return distance, turn


@dataclass(frozen=True, kw_only=True)
class MeasurementNoise(Parameters, name="measurement"):
    """Noise of an observation in addition to its own sigmas, and the validation gate."""

    range_sigma_share: NotNegative
    """Standard deviation as a share of the range: mirror, mounting, uneven floor."""
    range_sigma_m: NotNegative
    """Standard deviation of every range, meters."""
    bearing_sigma_rad: NotNegative
    """Standard deviation of every bearing, degrees."""
    relation: Literal["exact", "eq2"]
    """Relation between image radius and incidence: "exact", or "eq2" for the paper's Eq. 2."""
    gate: Positive
    """Maximum squared Mahalanobis distance; 9.21: 99 % of chi-square, 2 degrees of freedom."""
    report_after_steps: Annotated[int, Field(ge=1, strict=True)]
    """Successive steps without an accepted observation after which a notice is given."""


@dataclass(frozen=True, kw_only=True)
class FilterParameters(Parameters):
    """All parameters of the filter."""

    start: StartNoise
    motion: MotionNoise
    measurement: MeasurementNoise


def read_parameters(path: Path | None = None) -> FilterParameters:
    """Read a file of filter parameters; by default omnisim's own.

    Raises:
        LocalizationError: an invalid file; the message names file, key, value and expected value.
    """
    return read_toml(path or DEFAULT, FilterParameters, LocalizationError)
