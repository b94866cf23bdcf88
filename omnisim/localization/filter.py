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
from omnisim.localization.observations import LandmarkMap, Observation, expect
from omnisim.localization.parameters import FilterParameters
from omnisim.poses import wrap_angle

Verdict = Literal["accepted", "gated", "superseded", "singular"]
_EYE = np.eye(3)
# A symmetric matrix whose determinant is below this share of the largest it could have has no
# inverse to speak of.
_SINGULAR = 1e-12


class Association(NamedTuple):
    """What became of one sighting.

    Attributes:
        landmark: the one that it was taken for.
        range_m, bearing_rad: as measured.
        range_innovation_m, bearing_innovation_rad: measured less expected.
        distance_squared: of Mahalanobis; infinite where the innovation has no covariance.
        verdict: accepted; gated: too far off; superseded: another one fits this landmark better;
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
    judgements: tuple[Association, ...] = ()
    nis: float = math.nan
    nis_degrees: int = 0
    steps_rejected: int = 0


class _Pair(NamedTuple):
    """A sighting and a landmark that it may be."""

    sighting: int
    landmark: str
    distance_squared: float  # of Mahalanobis; infinite where there is no inverse
    by_pose: tuple[float, ...]  # Jacobian: range by x, y, yaw, then bearing
    noise_m2: float
    noise_rad2: float
    off_m: float  # measured less expected
    off_rad: float


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
        start = np.array([start[0], start[1], wrap_angle(start[2])])
        self.estimate = Estimate(float(time_s), start, doubt)

    def step(
        self,
        time_s: float,
        speed_mps: float,
        turn_rad: float,
        sightings: Sequence[Observation] = (),
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
        sightings: Sequence[Observation],
        steps_rejected: int,
    ) -> Estimate:
        """Correct a prediction by what is seen."""
        if not sightings:
            return _estimate(time_s, pose, covariance, steps_rejected=steps_rejected)
        for sighting in sightings:
            _check(sighting)
        here, spread = tuple(pose.tolist()), covariance.tolist()
        pairs = [
            self._pair(number, sighting, name, here, spread)
            for number, sighting in enumerate(sightings)
            for name in sighting.candidates
        ]
        chosen, verdicts = self._judge(pairs)
        judgements = tuple(
            Association(
                pair.landmark,
                sightings[pair.sighting].range_m,
                sightings[pair.sighting].bearing_rad,
                pair.off_m,
                pair.off_rad,
                pair.distance_squared,
                verdict,
            )
            for pair, verdict in zip(chosen, verdicts, strict=True)
        )
        taken = [
            pair for pair, verdict in zip(chosen, verdicts, strict=True) if verdict == ACCEPTED
        ]
        if not taken:
            return _estimate(time_s, pose, covariance, judgements, steps_rejected + 1)
        h = np.array([pair.by_pose for pair in taken]).reshape(-1, 3)
        rest = np.array([pair[-4:] for pair in taken])  # noise and innovation of both
        r, nu = rest[:, :2].reshape(-1), rest[:, 2:].reshape(-1)
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

    def _pair(
        self,
        number: int,
        sighting: Observation,
        name: str,
        pose: tuple[float, float, float],
        covariance: list[list[float]],
    ) -> _Pair:
        """Hold a sighting against a landmark, in plain floats: one at a time NumPy is slow."""
        range_m, a0, a1, a2, bearing, b0, b1, b2 = expect(
            pose, self._camera_m, self._landmarks.corners(name)
        )
        extra = self._parameters.measurement
        noise_m2 = (
            sighting.range_sigma_m**2
            + (extra.range_sigma_share * sighting.range_m) ** 2
            + extra.range_sigma_m**2
        )
        noise_rad2 = sighting.bearing_sigma_rad**2 + math.radians(extra.bearing_sigma_deg) ** 2
        (p00, p01, p02), (_, p11, p12), (_, _, p22) = covariance
        # the covariance times the bearing's row of the Jacobian
        q0 = p00 * b0 + p01 * b1 + p02 * b2
        q1 = p01 * b0 + p11 * b1 + p12 * b2
        q2 = p02 * b0 + p12 * b1 + p22 * b2
        cross = a0 * q0 + a1 * q1 + a2 * q2
        far = noise_m2 + p00 * a0 * a0 + p11 * a1 * a1 + p22 * a2 * a2
        far += 2.0 * (p01 * a0 * a1 + p02 * a0 * a2 + p12 * a1 * a2)
        turn = noise_rad2 + b0 * q0 + b1 * q1 + b2 * q2
        off_m = sighting.range_m - range_m
        off_rad = wrap_angle(sighting.bearing_rad - bearing)
        determinant = far * turn - cross * cross
        distance = math.inf
        if determinant > _SINGULAR * far * turn:
            weighted = turn * off_m * off_m - 2.0 * cross * off_m * off_rad + far * off_rad**2
            distance = weighted / determinant
        return _Pair(
            number, name, distance, (a0, a1, a2, b0, b1, b2), noise_m2, noise_rad2, off_m, off_rad
        )

    def _judge(self, pairs: list[_Pair]) -> tuple[list[_Pair], list[Verdict]]:
        """Which landmark each sighting is taken for, in their order, and its verdict."""
        gate = self._parameters.measurement.gate
        best: dict[int, _Pair] = {}
        for pair in pairs:
            other = best.get(pair.sighting)
            if other is None or pair.distance_squared < other.distance_squared:
                best[pair.sighting] = pair
        holders: dict[str, _Pair] = {}  # of a landmark: which sighting fits it best
        for pair in best.values():
            holder = holders.get(pair.landmark)
            if holder is None or pair.distance_squared < holder.distance_squared:
                holders[pair.landmark] = pair
        verdicts: list[Verdict] = []
        for pair in best.values():
            if pair.distance_squared == math.inf:
                verdicts.append(SINGULAR)
            elif pair.distance_squared > gate:
                verdicts.append("gated")
            else:
                verdicts.append(ACCEPTED if holders[pair.landmark] is pair else "superseded")
        return list(best.values()), verdicts


ACCEPTED: Verdict = "accepted"
SINGULAR: Verdict = "singular"


def _check(sighting: Observation) -> None:
    if not (
        sighting.candidates
        and math.isfinite(sighting.range_m)
        and math.isfinite(sighting.bearing_rad)
        and 0.0 <= sighting.range_sigma_m < math.inf
        and 0.0 <= sighting.bearing_sigma_rad < math.inf
    ):
        raise LocalizationError(
            f"sighting {sighting}: want a candidate, finite numbers, and sigmas of 0 or more"
        )


def _estimate(
    time_s: float,
    pose: NDArray[np.float64],
    covariance: NDArray[np.float64],
    judgements: tuple[Association, ...] = (),
    steps_rejected: int = 0,
    nis: float = math.nan,
    nis_degrees: int = 0,
) -> Estimate:
    pose[2] = wrap_angle(pose[2])
    symmetric = 0.5 * (covariance + covariance.T)
    return Estimate(time_s, pose, symmetric, judgements, nis, nis_degrees, steps_rejected)
