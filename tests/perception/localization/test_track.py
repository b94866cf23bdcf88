"""Notices and errors of a whole run."""

import dataclasses

import numpy as np

from omnisim.perception.localization.filter import Association, Estimate, read_parameters
from omnisim.perception.localization.track import Track, notices


def _estimate(k, accepted=0, gated=0, rejected_steps=0):
    judged = tuple(
        Association("a", 1.0, 0.0, 0.0, 0.0, 1.0, verdict)
        for verdict in ["accepted"] * accepted + ["gated"] * gated
    )
    return Estimate(float(k), np.zeros(3), np.eye(3), judged, steps_rejected=rejected_steps)


def _track(*seen):
    estimates, rejected = [], 0
    for k, (accepted, gated) in enumerate(seen):
        rejected = 0 if accepted else rejected + bool(gated)
        estimates.append(_estimate(k, accepted, gated, rejected))
    return Track(tuple(estimates), np.zeros((len(seen), 3)))


def test_the_gate_opens_where_most_pass():
    assert _track((0, 0), (0, 3), (1, 2), (2, 1), (0, 3)).gate_opening_step == 3
    assert _track((0, 0), (0, 3)).gate_opening_step is None


def test_notices_of_long_rejection_and_blindness():
    parameters = read_parameters()
    limit = parameters.measurement.report_after_steps
    closed = _track((0, 0), *[(0, 2)] * limit, (2, 0))
    assert notices(closed, parameters) == [
        f"steps 1 to {limit}: none of the landmarks that were seen passed the gate; the estimate "
        "went by the wheels, and its doubt grew"
    ]
    assert notices(_track((0, 0), *[(0, 2)] * (limit - 1), (2, 0)), parameters) == []
    # also where the run ends like that
    assert len(notices(_track((0, 0), (2, 0), *[(0, 2)] * limit), parameters)) == 1
    assert notices(_track((0, 0), (0, 0), (1, 0)), parameters) == [
        "1 of 2 steps show no landmark: 1"
    ]


def test_errors_are_distances_from_the_truth():
    track = _track((0, 0), (1, 0))
    moved = dataclasses.replace(track, reckoned=np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]]))
    truth = np.array([[0.0, 0.0, 0.0], [0.3, 0.4, 0.1]])
    np.testing.assert_allclose(moved.errors_m(truth), (0.0, 0.5))
    np.testing.assert_allclose(moved.reckoned_errors_m(truth), (0.0, 4.5))
    np.testing.assert_allclose(moved.nees(truth), (0.0, 0.09 + 0.16 + 0.01))
