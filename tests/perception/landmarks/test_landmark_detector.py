"""Landmark detection on the soccer field: recall, identity and accuracy, no false positives."""

import dataclasses
import math

import numpy as np
import pytest

import omnisim
from omnisim.core.errors import LocalizationError
from omnisim.perception.landmarks import landmark_detector
from omnisim.perception.landmarks.color_model import BINS, ColorModel, bin_of
from omnisim.perception.landmarks.landmark_detector import LandmarkDetector, find_regions
from omnisim.perception.localization.filter import LandmarkMap, predict_measurement
from omnisim.perception.unwarping import CameraMount, Panorama
from omnisim.rendering.camera.captured_image import valid_mask

PLACES = [(-0.6, 0.4, 25.0), (1.9, -1.2, 130.0), (-2.2, 1.3, -100.0)]
HEIGHT_M = 0.65
COLORS = {"pink": (244, 56, 162), "sky_blue": (0, 184, 241), "yellow": (246, 218, 0)}


def _model(colors=tuple(COLORS)):
    """Every color whose hue is near enough to a landmark's, at any brightness, blurred or not."""
    steps = 8 * np.arange(BINS) + 4
    red, green, blue = np.meshgrid(steps, steps, steps, indexing="ij")
    bins = np.stack((red, green, blue), axis=-1).reshape(-1, 3).astype(np.float64)
    counts = np.zeros((1 + len(colors), BINS**3))
    brightness = bins.max(axis=1, keepdims=True)
    for index, name in enumerate(colors, start=1):
        wanted = np.array(COLORS[name]) / max(COLORS[name])
        near = np.linalg.norm(bins / brightness - wanted, axis=1) < 0.28
        counts[index] = near & (brightness[:, 0] > 110)
    counts[0] = 1.0 * ~np.any(counts[1:] > 0, axis=0)
    return ColorModel(tuple(colors), counts, (1.0,) * len(colors))


def _mount(sensor):
    raised = sensor.base_from_optical.copy()
    raised[2, 3] = HEIGHT_M
    return CameraMount(sensor.model, raised, valid_mask(sensor.model, sensor.mesh_polygons))


@pytest.fixture(scope="module")
def field():
    """The scene, the camera on its mount, and images from some places."""
    scene = omnisim.load_scene("soccer")
    sensor = omnisim.OmniCamera()
    with omnisim.open_sensor(scene, sensor) as renderer:
        images = [
            renderer.render(omnisim.pose((x, y, HEIGHT_M), yaw_deg=yaw)).rgb for x, y, yaw in PLACES
        ]
    return scene, _mount(sensor), images


def test_every_landmark_is_found_where_it_is(field):
    scene, mount, images = field
    detector = LandmarkDetector(_model(), scene.landmarks, mount)
    landmarks = LandmarkMap.of_scene(scene.landmarks)
    for (x, y, yaw_deg), image in zip(PLACES, images, strict=True):
        found = {each.landmark: each for each in detector(image)}
        for name, corners in landmarks.corners_m.items():
            expected = predict_measurement((x, y, math.radians(yaw_deg)), mount.position_m, corners)
            range_m, bearing = expected[0], expected[4]
            if range_m < 4.0:
                assert name in found, f"{name} at {range_m:.2f} m is not found from {x, y}"
            if name not in found:
                continue
            off = math.remainder(found[name].bearing_rad - bearing, 2.0 * math.pi)
            # the bounds that drives are held to as RMS, three times: here it is each one
            assert abs(off) < math.radians(1.5), name
            assert abs(found[name].range_m - range_m) < 0.15 * range_m, name
            # the inverse of Eq. 2 is 0.08° off at most: dr = (r² + H²)/H dθ
            slack = 2.0 * (range_m**2 + HEIGHT_M**2) / 0.35 * math.radians(0.08)
            assert 0.0 < abs(found[name].range_eq2_m - found[name].range_m) < slack


def test_a_turned_robot_sees_the_same_landmarks_elsewhere(field):
    """Also one that stands across the panorama's edge."""
    scene, mount, images = field
    detector = LandmarkDetector(_model(), scene.landmarks, mount)
    straight = {found.landmark: found for found in detector(images[0])}
    assert len(straight) == 6
    for turn in np.radians((65.0, 155.0)):
        rotation = np.eye(4)
        rotation[:2, :2] = (math.cos(turn), -math.sin(turn)), (math.sin(turn), math.cos(turn))
        turned = dataclasses.replace(mount, base_from_optical=rotation @ mount.base_from_optical)
        found = LandmarkDetector(_model(), scene.landmarks, turned)(images[0])
        assert {each.landmark for each in found} == set(straight)
        for each in found:
            bearing = straight[each.landmark].bearing_rad + turn
            assert abs(math.remainder(each.bearing_rad - bearing, 2 * math.pi)) < math.radians(0.5)
            assert each.range_m == pytest.approx(straight[each.landmark].range_m, rel=0.05)


def test_nothing_is_found_where_nothing_is(field):
    _, mount, images = field
    scene = omnisim.load_scene("soccer")
    detector = LandmarkDetector(_model(), scene.landmarks, mount)
    assert detector(np.full_like(images[0], 120)) == []
    assert detector(np.zeros_like(images[0])) == []
    # yellow up to the horizon is no goal
    assert detector(np.full_like(images[0], COLORS["yellow"])) == []


def test_a_wrong_order_of_colors_is_another_landmark(field):
    scene, mount, images = field
    right = [each for each in scene.landmarks if len(each.bands) == 3]
    swapped = []
    for landmark in right:
        low, middle, high = landmark.bands
        colors = (middle, high.color), (high, middle.color)
        bands = (low, *(dataclasses.replace(band, color=color) for band, color in colors))
        swapped.append(dataclasses.replace(landmark, bands=bands))
    seen = {each.landmark for each in LandmarkDetector(_model(), right, mount)(images[0])}
    mirrored = {each.landmark for each in LandmarkDetector(_model(), swapped, mount)(images[0])}
    other = {name.replace("left", "?").replace("right", "left").replace("?", "right")
             for name in seen}  # fmt: skip
    assert mirrored == other


def test_landmarks_must_differ(field):
    scene, mount, _ = field
    twin = dataclasses.replace(scene.landmarks[0], name="twin")
    with pytest.raises(LocalizationError, match="'goal_yellow' and 'twin': look the same"):
        LandmarkDetector(_model(), (*scene.landmarks, twin), mount)
    other = _model(("pink",))
    with pytest.raises(LocalizationError, match="none can be detected by the model's colors"):
        LandmarkDetector(other, scene.landmarks[:1], mount)
    grounded = mount.base_from_optical.copy()
    grounded[2, 3] = 0.0
    with pytest.raises(LocalizationError, match="0 m above the ground"):
        Panorama(dataclasses.replace(mount, base_from_optical=grounded))


def test_rows_are_ranges(field):
    _, mount, _ = field
    panorama = Panorama(mount)
    ranges = np.array([0.5, 2.0, 6.0])
    for height_m in (0.0, 0.2):
        rows = panorama.rows(ranges, height_m)
        np.testing.assert_allclose(panorama.ranges_m(rows, height_m), ranges, rtol=1e-12)
        np.testing.assert_allclose(panorama.heights_m(rows, ranges), height_m, atol=1e-12)
        step = 1e-6
        ahead, here = (panorama.ranges_m(at, height_m) for at in (rows + step, rows))
        sigmas = panorama.range_sigmas_m(ranges, height_m, 1.0)
        np.testing.assert_allclose(sigmas, (here - ahead) / step, rtol=1e-4)
    assert np.isinf(panorama.ranges_m(panorama.camera.principal_point_px[1] - 3.0))


def test_two_edges_that_agree_give_a_range(field):
    """The third one is hidden by what stands in front of the pillar."""
    panorama = Panorama(field[1])
    seen = ((0.4, 2.0), (0.2, 2.0), (0.0, 3.0))
    edges = [(height_m, float(panorama.rows(at_m, height_m)), 0.1, 0.0) for height_m, at_m in seen]
    assert landmark_detector._fit_range(panorama, edges)[0] == pytest.approx(2.0)
    assert landmark_detector._fit_range(panorama, edges[1:]) is None


def test_a_region_across_the_edge_is_one():
    classes = np.zeros((6, 40), np.uint8)
    classes[2:4, 37:] = classes[2:4, :3] = 1
    classes[1:5, 10:14] = 2
    classes[0, 20] = 1  # a speck
    regions = sorted(find_regions(classes, 2, 4), key=lambda region: region.color)
    assert [region.left % 40 for region in regions] == [37, 10]
    assert [region.right - region.left for region in regions] == [6, 4]
    assert [region.area_px for region in regions] == [12, 16]


def test_bins_of_the_test_model_are_the_landmarks():
    model = _model()
    for name, color in COLORS.items():
        assert model.table[bin_of(np.array(color, np.uint8))] == model.color_class(name)
