"""The paper's experiments: accuracy of detections, picking by hand, degraded images."""

import math

import numpy as np
import pytest

import omnisim
from omnisim.core.trajectories.odometry import Odometry
from omnisim.perception.landmarks.landmark_detector import Detection
from omnisim.perception.localization.filter import (
    LandmarkMap,
    Observation,
    predict_measurement,
    read_parameters,
)
from omnisim.perception.localization.track import mean_interval
from omnisim.perception.unwarping import CameraMount
from omnisim.rendering.camera.degradations.defocus import Defocus
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.scene import load_scene
from omnisim.validation.experiments import experiment_runs as runs
from omnisim.validation.experiments import recordings
from omnisim.validation.experiments.landmark_sections import CAUSES, degraded

SIZE = 96
V, U = np.mgrid[:SIZE, :SIZE] - 0.5 * (SIZE - 1)
RADIUS = np.hypot(U, V)
SHOWN = RADIUS < 0.5 * SIZE
GEOMETRY = ImageGeometry(SIZE, SIZE, (0.5 * (SIZE - 1), 0.5 * (SIZE - 1)))
BY_NAME = {cause.name: cause for cause in CAUSES}


def _detection(name, range_m, bearing_rad, sigma_m=0.01):
    return Detection(name, bearing_rad, range_m, range_m - 0.01, 0.01, sigma_m, 0, 1, 0, 1, 4)


def test_matches_are_near_the_landmark():
    landmarks = LandmarkMap({"a": (2.0, 0.0), "b": (0.0, 3.0), "c": (-1.0, 0.0), "d": (0, -6.0)})
    seen = [[
        _detection("a", 2.1, math.radians(1.0)),
        _detection("b", 3.0, math.radians(90.0 + 4.0)),  # 4° off is somewhere else
        _detection("c", 1.0, math.radians(-179.0)),  # 1° off, across the half turn
    ]]  # fmt: skip
    matches = runs.compare(seen, np.zeros((1, 3)), landmarks, (0.0, 0.0))
    found = {each.landmark: each for each in matches}
    assert {name for name, each in found.items() if each.is_right} == {"a", "c"}
    assert found["a"].range_error_m == pytest.approx(0.1)
    assert found["c"].bearing_error_rad == pytest.approx(math.radians(1.0))
    assert found["d"].detection is None
    near = runs.accuracy(matches, 0.0, 4.0)
    assert (near.recall, near.precision, near.count) == (2 / 3, 2 / 3, 2)
    assert near.range_rms_share == pytest.approx(math.sqrt(0.05**2 / 2))
    assert near.eq2_mean_m == pytest.approx(-0.01)
    assert runs.accuracy(matches, 4.0, 9.0).recall == 0.0
    nothing = runs.accuracy([], 0.0, 4.0)
    assert math.isnan(nothing.recall)
    assert math.isnan(nothing.bearing_rms_rad)
    off, unsure = (
        runs.DetectionMatch(0, "a", 2.0, _detection("a", 2.7, 0.0, sigma_m), 0.7, 0.0)
        for sigma_m in (0.01, 0.5)
    )
    assert (off.is_right, unsure.is_right) == (False, True)


def test_seeds_are_averaged_over_finite_values():
    found = runs.SeedRuns(
        (), np.zeros((2, 3)), np.zeros((2, 3)),
        np.array([[np.nan, 2.0, 4.0], [np.nan, np.nan, 2.0]]),
        np.array([[np.nan, 3.0, 2.0], [np.nan, np.nan, 6.0]]),
        np.array([[0, 4, 2], [0, 0, 6]]),
    )  # fmt: skip
    np.testing.assert_array_equal(found.nees_by_step, [np.nan, 2.0, 3.0])
    np.testing.assert_array_equal(found.nis_by_step, [np.nan, 0.75, 1.0])
    assert found.nis_intervals[2] == mean_interval(1, 8)


def test_the_real_setting_starts_without_any_doubt_at_a_wrong_place():
    parameters = read_parameters(runs.REAL_PARAMETERS)
    assert parameters.start.position_sigma_m == parameters.start.heading_sigma_rad == 0.0
    parts = {"defocus", "shutter", "exposure", "noise", "bayer", "dirt"}
    assert parts <= recordings.real_camera().parts.keys()
    odometry = Odometry(np.arange(3.0), np.ones(2), np.zeros(2), (1.0, 2.0, 0.5))
    moved = recordings.with_wrong_start(odometry)
    np.testing.assert_array_equal(moved.distances_m, odometry.distances_m)
    assert moved.start != odometry.start


def test_colors_are_learned_on_another_way():
    lap = np.array([(2.3, 1.5), (-2.3, 1.5), (-2.3, -1.5), (2.3, -1.5)])
    way = np.array(recordings.TRAINING_WAYPOINTS)
    assert np.linalg.norm(way[:, None] - lap, axis=2).min() > 0.5
    assert np.all(np.abs(way) < (2.7, 1.8))


@pytest.fixture(scope="module")
def pick():
    """Function that picks the soccer field's landmarks from a pose."""
    sensor, landmarks = omnisim.OmniCamera(), LandmarkMap.of_scene(load_scene("soccer").landmarks)
    raised = sensor.base_from_optical.copy()
    raised[:3, 3] = -0.08, 0.0, 0.65
    mount, generator = CameraMount(sensor.model, raised), np.random.default_rng(4)

    def pick(pose, **hand):
        return runs.pick_landmarks(np.array(pose), mount, landmarks, runs.Hand(**hand), generator)

    pick.mount, pick.landmarks = mount, landmarks
    return pick


def test_a_hand_is_as_good_as_it_says(pick):
    pose = (-0.9, 0.3, 2.0)
    exact = pick(pose, sigma_px=0.0, farthest_m=9.0)
    assert {each.candidates[0] for each in exact} == set(pick.landmarks.corners_m)
    for each in exact:
        corners = pick.landmarks.corners(each.candidates[0])
        expected = predict_measurement(pose, pick.mount.position_m, corners)
        assert abs(each.range_m - expected[0]) < 1e-9
        assert abs(math.remainder(each.bearing_rad - expected[4], 2.0 * math.pi)) < 1e-9
    errors = []
    for _ in range(150):
        for each, true in zip(pick(pose, sigma_px=1.0, farthest_m=9.0), exact, strict=True):
            turn = math.remainder(each.bearing_rad - true.bearing_rad, 2.0 * math.pi)
            far = (each.range_m - true.range_m) / each.range_sigma_m
            errors.append((far, turn / each.bearing_sigma_rad))
    # 900 picks: 5 % would be two standard deviations; a goal's two feet are not as sure as one
    # half of each, and a far range's error is not normal
    np.testing.assert_allclose(np.std(errors, axis=0), 1.0, atol=0.2)


def test_far_and_hidden_landmarks_are_not_picked(pick):
    assert {each.candidates[0] for each in pick((0.0, 0.0, 0.0), farthest_m=2.6)} == {
        "beacon_left_yellow", "beacon_right_yellow", "beacon_left_blue", "beacon_right_blue",
    }  # fmt: skip
    beside = pick((1.35, 1.65, 0.0))  # the beacon's foot is under the robot's own edge
    assert "beacon_left_blue" not in {each.candidates[0] for each in beside}


def test_clutter_stands_around_the_field_and_faces_outwards():
    scene = load_scene("soccer")
    changed = recordings.cluttered(scene)
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


def test_ahead_is_within_half_the_field_of_view():
    turns_deg = (-50, -44, 0, 44, 46)
    seen = [[Observation(("a",), 1.0, math.radians(turn), 0.1, 0.1) for turn in turns_deg]]
    (left,) = runs.in_field_of_view(seen, math.radians(90.0))
    assert [round(math.degrees(each.bearing_rad)) for each in left] == [-44, 0, 44]


@pytest.fixture(scope="module")
def image():
    """Colored sectors and rings in a round mask."""
    sector = ((np.arctan2(V, U) + math.pi) / (2 * math.pi) * 12).astype(int) % 3
    colors = np.array([(240, 210, 20), (20, 170, 230), (110, 120, 115)], np.uint8)
    drawn = colors[(sector + (RADIUS // 12).astype(int)) % 3]
    return np.where(SHOWN[..., None], drawn, 0).astype(np.uint8)


@pytest.mark.parametrize("name", list(BY_NAME))
def test_each_level_changes_more_than_the_one_before(name, image):
    cause, changes = BY_NAME[name], [0.0]
    for level in cause.levels:
        changed = degraded(image, 12, SHOWN, GEOMETRY, cause, level)
        assert np.all(changed[~SHOWN] == 0)
        changes.append(np.abs(changed[SHOWN].astype(float) - image[SHOWN]).mean())
    assert np.all(np.diff(changes) > 0.0)


def test_defocus_is_the_cameras(image):
    light = np.concatenate((image / 255.0, SHOWN[..., None]), axis=-1).astype(np.float32)
    quick = BY_NAME["defocus"].apply(light, GEOMETRY, 2.0, 0)
    wanted = Defocus(center_defocus_px=2.0, rim_defocus_px=2.0).apply(light, GEOMETRY)
    inside = RADIUS < 0.5 * SIZE - 4
    # float32 through a Fourier transform
    np.testing.assert_allclose(quick[inside], wanted[inside], atol=2e-5)


def test_white_balance_that_is_too_warm():
    light = np.full((SIZE, SIZE, 4), 0.4, np.float32)
    warm = BY_NAME["white balance"].apply(light, GEOMETRY, 0.25, 0)
    np.testing.assert_allclose(warm[SIZE // 2, SIZE // 2, :3], (0.5, 0.4, 0.32), rtol=1e-6)


def test_a_turn_blurs_along_circles_only():
    light = np.ones((SIZE, SIZE, 4), np.float32)
    light[..., :3] = 0.5 + 0.4 * np.sin(RADIUS / 5.0)[..., None]
    blurred = BY_NAME["motion blur"].apply(light, GEOMETRY, 8.0, 0)
    inside = RADIUS < 0.5 * SIZE - 2
    # what bilinear interpolation takes from a sine of 31 px: (2π/31)²/8 of its 0.4
    np.testing.assert_allclose(blurred[inside], light[inside], atol=0.4 * 0.0055)
