"""Images of a scene beside a twin's: corners by OpenCV, edges, gray levels, noise."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift

from omnisim.cameras import KannalaBrandtCamera
from omnisim.core.errors import MeasurementError
from omnisim.measurement.comparison import compare_scene_images, pose_indices
from omnisim.measurement.comparison.comparison import BIN_LEVELS, even_blocks, noise_by_level
from omnisim.measurement.comparison.scene_comparison import (
    brighter_ev,
    check_size,
    compare_scene_image,
    seen_field,
    track_corners,
)
from omnisim.measurement.geometry.board_detection import LUMA
from omnisim.rendering.camera.degradations import Degradation, Noise, Vignetting
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import Stage

LENS = KannalaBrandtCamera(
    400, 300, (128.0, 128.4), (202.0, 148.5), (0.012, -0.008, 0.002, -0.0005), np.radians(95.0)
)
SENSOR = OmniCamera(
    LENS, degradation=Degradation(vignetting=Vignetting((-0.25, 0.05, -0.01)), noise=Noise())
)
ROUND = dataclasses.replace(LENS, width_px=360, theta_max_rad=np.radians(60.0))


def texture(seed):
    pattern = gaussian_filter(np.random.default_rng(seed).normal(size=(140, 180)), 2.0)
    return 128.0 + 40.0 * pattern / pattern.std()


def gray(levels):
    return np.clip(np.rint(levels), 0, 255).astype(np.uint8)


def field(image):
    inner = np.zeros(image.shape, dtype=np.uint8)
    inner[16:-16, 16:-16] = 255
    return inner


def test_corners_are_tracked_to_a_fiftieth_of_a_pixel_in_other_light():
    pytest.importorskip("cv2")
    image = texture(1)
    moved = 20.0 + 0.6 * shift(image, (-1.3, 0.45), order=5, mode="nearest")
    noise = np.random.default_rng(3).normal(size=(2, *image.shape))
    corners, offsets = track_corners(gray(image + noise[0]), gray(moved + noise[1]), field(image))
    is_found = np.isfinite(offsets).all(axis=1)
    assert is_found.mean() > 0.95 < len(corners) / 40
    errors = offsets[is_found] - (0.45, -1.3)
    assert np.abs(np.median(errors, axis=0)).max() < 0.02
    assert np.percentile(np.linalg.norm(errors, axis=1), 90.0) < 0.1


def test_corners_are_not_found_in_another_image():
    pytest.importorskip("cv2")
    image = gray(texture(1))
    offsets = track_corners(image, gray(texture(2)), field(image))[1]
    assert np.isfinite(offsets).all(axis=1).mean() < 0.05
    assert len(track_corners(np.full_like(image, 99), image, field(image))[0]) == 0


def test_noise_of_even_blocks_by_gray_level():
    random = np.random.default_rng(4)
    steps = np.repeat(np.linspace(40.0, 200.0, 6), 40)[None] + np.zeros((160, 1))
    lit = steps + np.linspace(0.0, 8.0, 160)[:, None]  # a gradient is no noise
    stripes = lit + 2.0 * (np.arange(240) % 2)  # nor are rows or columns
    deviation = 1.0 + lit / 80.0
    image = gray(lit + deviation * random.normal(size=lit.shape))
    twin = gray(stripes + 2.0 * random.normal(size=lit.shape))
    noise = noise_by_level([even_blocks(image, twin, field(image))])
    assert len(noise) >= 5
    assert {one.level % BIN_LEVELS for one in noise} == {0.5 * BIN_LEVELS}
    for one in noise:
        assert one.noise == pytest.approx(1.0 + one.level / 80.0, rel=0.12)
        assert one.twin_noise == pytest.approx(2.0, rel=0.12)


def test_the_field_ends_before_the_rim_of_the_lens():
    pytest.importorskip("cv2")
    mask = seen_field(ROUND)
    rows, columns = np.nonzero(mask)
    radii = np.hypot(columns - ROUND.principal_point_px[0], rows - ROUND.principal_point_px[1])
    edge = ROUND.pixel_from_ray(np.array([[np.sin(1.04719), 0.0, np.cos(1.04719)]])).positions_px
    rim = edge[0, 0] - ROUND.principal_point_px[0]
    assert rim - 15.0 < radii.max() < rim - 6.0


def test_poses_go_by_name_or_by_order():
    files = [Path("photos/b.png"), Path("photos/c.png")]
    poses = Path("poses.tum")
    assert pose_indices(files, None, 2, poses).tolist() == [0, 1]
    assert pose_indices(files, ("images/c.jpg", "a.png", "b.png"), 3, poses).tolist() == [2, 0]
    for names, count, message in (
        (None, 3, "poses.tum: 3 poses for 2 images: expected one pose per image"),
        (("a.png", "b.png"), 2, "poses.tum: no pose of c.png"),
        (("a.png",), 1, "poses.tum: no pose of b.png, nor of 1 more images"),
        (("b.png", "c.png", "d/c.png"), 3, "poses.tum: several poses of c: expected one"),
    ):
        with pytest.raises(MeasurementError, match=message):
            pose_indices(files, names, count, poses)


WRONG = dataclasses.replace(LENS, focal_lengths_px=(128.0 * 1.005, 128.4 * 1.005))


@pytest.fixture(scope="module")
def courtyard():
    """Images of the courtyard by the hidden camera, by its true twin, and by a wrong one."""
    pytest.importorskip("cv2")
    poses = [
        SENSOR.base_pose(
            (0.1 * number, 0.2, 0.9), yaw_deg=100.0 * number, pitch_deg=5.0 * number, roll_deg=3.0
        )
        for number in range(2)
    ]
    cameras = ((SENSOR, "another"), (SENSOR, 0), (dataclasses.replace(SENSOR, model=WRONG), 0))
    with Stage("courtyard") as stage:
        renderers = [stage.open(sensor, seed=seed) for sensor, seed in cameras]
        frames = [
            [renderer.render(base, frame_number=number) for number, base in enumerate(poses)]
            for renderer in renderers
        ]
    return [[gray(frame.rgba[..., :3] @ LUMA) for frame in own] for own in frames]


def compared(images, twins):
    mask = seen_field(LENS)
    pairs = enumerate(zip(images, twins, strict=True))
    compared = [compare_scene_image(f"{number}.png", *pair, mask) for number, pair in pairs]
    return compared, compare_scene_images(SENSOR, compared)


@pytest.mark.slow
def test_the_true_twin_shows_the_same_scene(courtyard):
    images, comparison = compared(courtyard[0], courtyard[1])
    assert comparison.lost < 0.01 * sum(ring.corners for ring in comparison.rings)
    assert comparison.bias_px < 0.01
    assert np.percentile(np.abs(comparison.level_errors), 90.0) < 1.0
    assert abs(brighter_ev(SENSOR, images)) < 0.01
    assert all(ring.rms_px < 0.03 for ring in comparison.rings)
    rises = np.array([(ring.rise_px, ring.twin_rise_px) for ring in comparison.rings])
    rises = rises[np.isfinite(rises).all(axis=1)]  # other rings have too few clean edges
    assert len(rises)
    np.testing.assert_allclose(rises[:, 1], rises[:, 0], rtol=0.15)
    assert len(comparison.noise) >= 4
    for one in comparison.noise:
        assert one.twin_noise == pytest.approx(one.noise, rel=0.15)


@pytest.mark.slow
def test_a_focal_length_off_by_half_a_percent_shows(courtyard):
    images, comparison = compared(courtyard[0], courtyard[2])
    corners = np.concatenate([image.corners_px for image in images])
    offsets = np.concatenate([image.offsets_px for image in images])
    true = WRONG.pixel_from_ray(LENS.ray_from_pixel(corners).directions).positions_px - corners
    errors = (offsets - true)[np.isfinite(offsets).all(axis=1)]
    assert np.median(np.linalg.norm(errors, axis=1)) < 0.05
    assert np.abs(np.median(errors, axis=0)).max() < 0.02
    outer = comparison.rings[-1]
    assert outer.bias_px[0] > 0.5
    assert abs(outer.bias_px[1]) < 0.05
    assert comparison.bias_px > 10.0 * 0.05


@pytest.mark.slow
def test_images_of_other_poses_are_refused(courtyard):
    with pytest.raises(MeasurementError, match="corners are found in the twin's images"):
        compared(courtyard[0], courtyard[1][::-1])


def test_an_image_of_another_size_is_refused():
    with pytest.raises(MeasurementError, match=r"0\.png: 40 × 30 px: expected 400 × 300 px"):
        check_size(Path("0.png"), np.zeros((30, 40), dtype=np.uint8), SENSOR)
