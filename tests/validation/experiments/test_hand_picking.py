"""Landmarks picked by hand: unbiased, as uncertain as they say, and the lamp and clutter."""

import math

import numpy as np

import omnisim
from omnisim.core.trajectories.odometry import Odometry
from omnisim.perception.localization.filter import LandmarkMap, predict_measurement
from omnisim.perception.unwarping import CameraMount
from omnisim.scene import load_scene
from omnisim.validation.experiments.experiment_runs import Hand, pick_landmarks
from omnisim.validation.experiments.recordings import cluttered, with_wrong_start


def _mount():
    sensor = omnisim.OmniCamera()
    raised = sensor.base_from_optical.copy()
    raised[:3, 3] = -0.08, 0.0, 0.65
    return CameraMount(sensor.model, raised)


def test_a_hand_is_as_good_as_it_says():
    landmarks = LandmarkMap.of_scene(load_scene("soccer").landmarks)
    mount, pose = _mount(), np.array([-0.9, 0.3, 2.0])
    generator = np.random.default_rng(4)
    exact = pick_landmarks(pose, mount, landmarks, Hand(sigma_px=0.0, farthest_m=9.0), generator)
    assert {each.candidates[0] for each in exact} == set(landmarks.corners_m)
    for each in exact:
        expected = predict_measurement(
            tuple(pose), mount.position_m, landmarks.corners(each.candidates[0])
        )
        assert abs(each.range_m - expected[0]) < 1e-9
        assert abs(math.remainder(each.bearing_rad - expected[4], 2.0 * math.pi)) < 1e-9
    errors = []
    for _ in range(150):
        for each, true in zip(
            pick_landmarks(pose, mount, landmarks, Hand(1.0, 9.0), generator), exact, strict=True
        ):
            turn = math.remainder(each.bearing_rad - true.bearing_rad, 2.0 * math.pi)
            far = (each.range_m - true.range_m) / each.range_sigma_m
            errors.append((far, turn / each.bearing_sigma_rad))
    spread = np.std(errors, axis=0)
    # 900 picks: 5 % would be two standard deviations; a goal's two feet are not as sure as one
    # half of each, and a far range's error is not normal
    np.testing.assert_allclose(spread, 1.0, atol=0.2)


def test_far_and_hidden_landmarks_are_not_picked():
    landmarks = LandmarkMap.of_scene(load_scene("soccer").landmarks)
    generator = np.random.default_rng(0)
    near = pick_landmarks(np.zeros(3), _mount(), landmarks, Hand(farthest_m=2.6), generator)
    assert {each.candidates[0] for each in near} == {
        "beacon_left_yellow", "beacon_right_yellow", "beacon_left_blue", "beacon_right_blue",
    }  # fmt: skip
    beside = np.array([1.35, 1.65, 0.0])  # the beacon's foot is under the robot's own edge
    seen = pick_landmarks(beside, _mount(), landmarks, Hand(), generator)
    assert "beacon_left_blue" not in {each.candidates[0] for each in seen}


def test_clutter_stands_around_the_field_and_faces_outwards():
    scene = load_scene("soccer")
    changed = cluttered(scene)
    assert changed.landmarks == scene.landmarks
    boxes = changed.instances[len(scene.instances) :]
    assert len(boxes) >= 10
    for box in boxes:
        x, y, _ = box.world_from_mesh[:3, 3]
        assert abs(x) > 3.0 or abs(y) > 2.0  # off the carpet
        mesh = changed.meshes[box.mesh]
        corners = mesh.positions[mesh.triangles].astype(np.float64)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert np.all(np.sum(normals * corners.mean(axis=1), axis=1) > 0.0)
        assert (corners[..., 2] + box.world_from_mesh[2, 3]).min() > -1e-6


def test_a_start_that_is_wrong_keeps_the_readings():
    odometry = Odometry(np.arange(3.0), np.ones(2), np.zeros(2), (1.0, 2.0, 0.5))
    moved = with_wrong_start(odometry)
    np.testing.assert_array_equal(moved.distances_m, odometry.distances_m)
    assert moved.start != odometry.start
