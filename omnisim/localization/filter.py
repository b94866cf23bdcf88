"""The extended Kalman filter of the paper: state (x, y, φ), control (v, δφ), measurement (r, γ).

All sightings of one picture are judged against the same prediction, each by itself, and those that
pass the gate are taken in together: what comes first makes no difference.

Source: Schmits & Visser 2008, Eq. 4 to 6; the update in Joseph's form, as in Bar-Shalom, Li,
Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, section 5.2.6.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.errors import LocalizationError
from omnisim.localization.motion import move
from omnisim.localization.parameters import FilterParameters
from omnisim.localization.sightings import LandmarkMap, Sighting, expect

Verdict = Literal["accepted", "gated", "outdone", "singular"]
_EYE = np.eye(3)
# A symmetric matrix whose determinant is below this share of the largest it could have has no
# inverse to speak of.
_SINGULAR = 1e-12


class Judgement(NamedTuple):
    """What became of one sighting.

    Attributes:
        landmark: the one that it was taken for.
        range_m, bearing_rad: as measured.
        range_innovation_m, bearing_innovation_rad: measured less expected.
        distance_squared: of Mahalanobis; infinite where the innovation has no covariance.
        verdict: accepted; gated: too far off; outdone: another one fits this landmark better;
            singular: there is no uncertainty to judge it by.
    """

    landmark: str
    range_m: float
    bearing_rad: float
    range_innovation_m: float
    bearing_innovation_rad: float
    distance_squared: float
    verdict: Verdict


@dataclass(frozen=True, eq=False)
class Estimate:
    """What is believed after a step.

    Attributes:
        time_s: when.
        pose: (3,) x and y in metres, yaw in radians within ±π.
        covariance: (3, 3).
        judgements: one for each sighting, in their order.
        nis: normalised innovation squared of the accepted sightings together, or NaN: none.
        nis_degrees: of freedom that it has.
        steps_rejected: how many steps up to this one have had sightings and let none through.
    """

    time_s: float
    pose: NDArray[np.float64]
    covariance: NDArray[np.float64]
    judgements: tuple[Judgement, ...] = ()
    nis: float = math.nan
    nis_degrees: int = 0
    steps_rejected: int = 0


class LocalizationFilter:
    """Keeps the estimate of one robot.

    Args:
        landmarks: where they are.
        parameters: noise and gate.
        camera_m: x and y of the effective viewpoint in the base frame.
        time_s: of the first pose.
        pose: (3,) where the robot starts: x, y, yaw.
        covariance: (3, 3) of the start, or None: by the parameters.

    Raises:
        LocalizationError: a start that is not finite, or a covariance that cannot be one.
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
        start = np.asarray(pose, dtype=np.float64)
        if covariance is None:
            sigma_m = parameters.start.position_sigma_m
            sigma_rad = math.radians(parameters.start.heading_sigma_deg)
            covariance = np.diag([sigma_m**2, sigma_m**2, sigma_rad**2])
        doubt = np.asarray(covariance, dtype=np.float64)
        if start.shape != (3,) or not np.all(np.isfinite((*start, time_s))):
            raise LocalizationError(f"start {pose} at {time_s} s: want finite x, y, yaw and time")
        if (
            doubt.shape != (3, 3)
            or not np.all(np.isfinite(doubt))
            or not np.array_equal(doubt, doubt.T)
            or np.linalg.eigvalsh(doubt)[0] < 0.0
        ):
            raise LocalizationError("start: want a symmetric covariance (3, 3), not negative")
        start = np.array([start[0], start[1], wrapped(start[2])])
        self.estimate = Estimate(float(time_s), start, doubt)

    def step(
        self,
        time_s: float,
        speed_mps: float,
        turn_rad: float,
        sightings: Sequence[Sighting] = (),
    ) -> Estimate:
        """Drive on to a time, and look around there.

        Args:
            time_s: when.
            speed_mps: mean speed along the arc since the last step, negative backwards.
            turn_rad: since then.
            sightings: of the picture at `time_s`.

        Raises:
            LocalizationError: a time that is not after the last one, or readings that are not
                finite; the estimate stays as it was.
        """
        before = self.estimate
        if not time_s > before.time_s:
            raise LocalizationError(
                f"time {time_s:.9g} s: is not after the last step's, {before.time_s:.9g} s: "
                "want times that increase"
            )
        if not (math.isfinite(time_s) and math.isfinite(speed_mps) and math.isfinite(turn_rad)):
            raise LocalizationError(
                f"step to {time_s} s with {speed_mps} m/s and a turn of {turn_rad} rad: "
                "want finite numbers"
            )
        distance_m = speed_mps * (time_s - before.time_s)
        sigma_m, sigma_rad = self._parameters.motion.sigmas(distance_m, turn_rad)
        pose, by_pose, by_control = move(before.pose, distance_m, turn_rad)
        spread = by_control * (sigma_m, sigma_rad)
        covariance = by_pose @ before.covariance @ by_pose.T + spread @ spread.T
        self.estimate = self._look(time_s, pose, covariance, sightings, before.steps_rejected)
        return self.estimate

    def _look(
        self,
        time_s: float,
        pose: NDArray[np.float64],
        covariance: NDArray[np.float64],
        sightings: Sequence[Sighting],
        steps_rejected: int,
    ) -> Estimate:
        """Correct a prediction by what is seen."""
        if not sightings:
            return _estimate(time_s, pose, covariance, steps_rejected=steps_rejected)
        owners = [k for k, sighting in enumerate(sightings) for _ in sighting.candidates]
        names = [name for sighting in sightings for name in sighting.candidates]
        here, corners = tuple(pose.tolist()), self._landmarks.corners
        told = np.array([_numbers(sighting) for sighting in sightings])
        if len(owners) > len(sightings):
            told = told[owners]
        model = np.array([expect(here, self._camera_m, corners(name)) for name in names])
        model = model.reshape(-1, 2, 4)
        expected, by_pose = model[..., 0], model[..., 1:]
        innovations = told[:, :2] - expected
        innovations[:, 1] = np.remainder(innovations[:, 1] + math.pi, 2.0 * math.pi) - math.pi
        noise = self._noise(told)
        spread = by_pose @ covariance
        own = spread @ by_pose.transpose(0, 2, 1)
        distances = _mahalanobis(innovations, own, noise)
        off, far = innovations.tolist(), distances.tolist()
        verdicts, chosen = self._judge(owners, names, far)
        judgements = tuple(
            Judgement(
                names[row],
                sighting.range_m,
                sighting.bearing_rad,
                *off[row],
                far[row],
                verdict,
            )
            for sighting, row, verdict in zip(sightings, chosen, verdicts, strict=True)
        )
        taken = [row for row, verdict in zip(chosen, verdicts, strict=True) if verdict == ACCEPTED]
        if not taken:
            return _estimate(time_s, pose, covariance, judgements, steps_rejected + 1)
        h = by_pose[taken].reshape(-1, 3)
        r = noise[taken].reshape(-1)
        nu = innovations[taken].reshape(-1)
        across = h @ covariance
        s = across @ h.T
        s.flat[:: len(r) + 1] += r
        try:
            weights = np.linalg.inv(s)
        except np.linalg.LinAlgError:  # each can be inverted, but not all of them together
            singular = tuple(
                judged._replace(verdict=SINGULAR) if judged.verdict == ACCEPTED else judged
                for judged in judgements
            )
            return _estimate(time_s, pose, covariance, singular, steps_rejected + 1)
        gain = across.T @ weights
        kept = _EYE - gain @ h
        corrected = kept @ covariance @ kept.T + (gain * r) @ gain.T
        nis = float(nu @ weights @ nu)
        return _estimate(time_s, pose + gain @ nu, corrected, judgements, 0, nis, len(nu))

    def _noise(self, told: NDArray[np.float64]) -> NDArray[np.float64]:
        """Variances (n, 2) of range and bearing: what sightings say, and what the file adds."""
        extra = self._parameters.measurement
        noise = np.square(told[:, 2:])
        noise[:, 0] += np.square(extra.range_sigma_share * told[:, 0]) + extra.range_sigma_m**2
        noise[:, 1] += math.radians(extra.bearing_sigma_deg) ** 2
        return noise

    def _judge(
        self, owners: list[int], names: list[str], distances: list[float]
    ) -> tuple[list[Verdict], list[int]]:
        """A verdict for each sighting, and which of its candidates it is taken for."""
        gate = self._parameters.measurement.gate
        best: dict[int, int] = {}
        for k, (owner, distance) in enumerate(zip(owners, distances, strict=True)):
            if owner not in best or distance < distances[best[owner]]:
                best[owner] = k
        chosen = list(best.values())
        holders: dict[str, int] = {}  # of a landmark: which sighting fits it best
        for k in chosen:
            holder = holders.get(names[k])
            if holder is None or distances[k] < distances[holder]:
                holders[names[k]] = k
        verdicts: list[Verdict] = []
        for k in chosen:
            if not math.isfinite(distances[k]):
                verdicts.append(SINGULAR)
            elif distances[k] > gate:
                verdicts.append("gated")
            else:
                verdicts.append(ACCEPTED if holders[names[k]] == k else "outdone")
        return verdicts, chosen


ACCEPTED: Verdict = "accepted"
SINGULAR: Verdict = "singular"


def wrapped(angle_rad: float) -> float:
    """The same direction within ±π."""
    return math.remainder(angle_rad, 2.0 * math.pi)


def _numbers(sighting: Sighting) -> tuple[float, float, float, float]:
    numbers = (
        sighting.range_m,
        sighting.bearing_rad,
        sighting.range_sigma_m,
        sighting.bearing_sigma_rad,
    )
    if not all(map(math.isfinite, numbers)) or min(numbers[2:]) < 0.0 or not sighting.candidates:
        raise LocalizationError(
            f"sighting {sighting}: want a candidate, finite numbers, and sigmas of 0 or more"
        )
    return numbers


def _mahalanobis(
    innovations: NDArray[np.float64], own: NDArray[np.float64], noise: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Squared distances (n,) of innovations (n, 2) by their covariances: the prediction's own
    (n, 2, 2) and the noise's variances (n, 2); infinite where there is no inverse."""
    a, b, c = own[:, 0, 0] + noise[:, 0], own[:, 0, 1], own[:, 1, 1] + noise[:, 1]
    determinant = a * c - b * b
    sound = determinant > _SINGULAR * a * c
    u, v = innovations[:, 0], innovations[:, 1]
    weighted = c * u * u - 2.0 * b * u * v + a * v * v
    return np.where(sound, weighted / np.where(sound, determinant, 1.0), np.inf)


def _estimate(
    time_s: float,
    pose: NDArray[np.float64],
    covariance: NDArray[np.float64],
    judgements: tuple[Judgement, ...] = (),
    steps_rejected: int = 0,
    nis: float = math.nan,
    nis_degrees: int = 0,
) -> Estimate:
    pose[2] = wrapped(pose[2])
    symmetric = 0.5 * (covariance + covariance.T)
    return Estimate(time_s, pose, symmetric, judgements, nis, nis_degrees, steps_rejected)
