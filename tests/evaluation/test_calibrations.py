"""Calibrations from boards, as estimators, and the errors of their cameras."""

import dataclasses

import numpy as np
import pytest

from omnisim.cameras import KannalaBrandtCamera, UnifiedCamera
from omnisim.core.errors import EstimatorError, MeasurementError
from omnisim.evaluation.estimator_registry import estimator_named
from omnisim.evaluation.run_evaluation import Outcome, outcome_from
from omnisim.evaluation.trajectory_errors import camera_errors
from omnisim.measurement.geometry import BoardView
from omnisim.validation.plain_scenes import board_corners_m, board_poses_in_front

SIZE_PX = 640, 480
LENS = KannalaBrandtCamera(
    *SIZE_PX, (300.0, 300.6), (322.5, 237.0), (0.012, -0.008, 0.002, -5e-4), np.radians(90.0)
)
MEI = UnifiedCamera(*SIZE_PX, (600.0, 601.0), (318.0, 241.0), 1.1, (-0.1, 0.02, 1e-4, -2e-4))
NOISE_PX = 0.03
BOARD = "8x6:80mm"


def boards(camera, count, widest_deg=45.0):
    """Corners of boards all over the field, with the noise of a corner finder."""
    generator, points = np.random.default_rng(3), board_corners_m()
    views = []
    poses = board_poses_in_front(count, np.radians(widest_deg))
    for number, optical_from_board in enumerate(poses):
        rays = points @ optical_from_board[:3, :3].T + optical_from_board[:3, 3]
        found = camera.pixel_from_ray(rays)
        assert found.valid.all()
        noise = generator.normal(0.0, NOISE_PX, found.positions_px.shape)
        views.append(BoardView(f"{number}.png", points[:, :2], found.positions_px + noise))
    return views


def test_the_true_camera_has_no_errors():
    errors = camera_errors(LENS, LENS)
    assert errors.focal_length == pytest.approx(0.0, abs=1e-12)
    assert errors.max_px < 1e-6
    assert errors.covered == 1.0


def test_errors_are_those_of_the_closed_form():
    """An equidistant lens, whose focal length is 1 % off: the error is 1 % of the radius."""
    truth = KannalaBrandtCamera(400, 400, (100.0,) * 2, (199.5,) * 2, (0.0,) * 4)
    wrong = dataclasses.replace(truth, focal_lengths_px=(101.0, 101.0))
    errors = camera_errors(wrong, truth)
    assert errors.focal_length == pytest.approx(0.01, rel=1e-6)
    radii = np.linalg.norm(np.mgrid[0:400:8, 0:400:8].reshape(2, -1).T - 199.5, axis=1)
    seen = radii < 100.0 * np.pi
    assert errors.max_px == pytest.approx(0.01 * radii[seen].max(), rel=0.02)
    assert errors.rms_px == pytest.approx(0.01 * np.sqrt(np.mean(radii[seen] ** 2)), rel=0.02)


def test_how_the_lens_is_turned_is_no_error():
    """A wide lens, shifted by half a pixel, is nearly a turned one."""
    truth = KannalaBrandtCamera(400, 400, (400.0,) * 2, (199.5,) * 2, (0.0,) * 4)
    shifted = dataclasses.replace(truth, principal_point_px=(200.0, 199.5))
    assert camera_errors(shifted, truth).rms_px < 0.03


@pytest.mark.slow
@pytest.mark.parametrize(("name", "truth"), [("cv2-fisheye", LENS), ("cv2-omnidir", MEI)])
def test_opencv_calibrates_its_own_model(name, truth):
    """Asked: as well as corners with this noise determine it, a little past the boards, too."""
    pytest.importorskip("cv2")
    camera = estimator_named(f"{name}:{BOARD}").calibrate(boards(truth, 9), SIZE_PX)
    errors = camera_errors(camera, truth)
    assert abs(errors.focal_length) < 1e-3
    assert errors.rms_px < 0.3
    assert errors.covered > 0.999


@pytest.mark.slow
def test_our_own_calibrates_a_lens():
    """One of its models, to be quick; the choice among all is tested with `omnisim measure`."""
    pytest.importorskip("cv2")
    method = estimator_named(f"measure:{BOARD}")
    method.models = ("kannala_brandt",)
    errors = camera_errors(method.calibrate(boards(LENS, 7), SIZE_PX), LENS)
    assert abs(errors.focal_length) < 1e-3
    assert errors.rms_px < 0.3


def test_corners_that_opencv_cannot_use_are_an_error():
    """It takes θ from x/z, so that corners past 90° have no homography."""
    pytest.importorskip("cv2")
    wide = dataclasses.replace(LENS, focal_lengths_px=(150.0, 150.0), theta_max_rad=np.pi)
    views = boards(wide, 8, widest_deg=95.0)
    with pytest.raises(EstimatorError, match=r"cv2\.fisheye\.calibrate: "):
        estimator_named(f"cv2-fisheye:{BOARD}").calibrate(views, SIZE_PX)


def test_names_have_a_board():
    with pytest.raises(EstimatorError, match="expected a board, as in measure:8x6:80mm"):
        estimator_named("measure")
    with pytest.raises(EstimatorError, match="'measur:8x6:80mm': unknown"):
        estimator_named("measur:8x6:80mm")
    with pytest.raises(MeasurementError, match="8 by 6"):
        estimator_named("measure:8 by 6")


def test_an_outcome_keeps_a_cameras_errors():
    errors = camera_errors(LENS, LENS)
    outcome = Outcome("measure:8x6:80mm", "ok", errors.summary, 1.0, camera=errors)
    assert outcome_from(outcome.as_dict()).camera == errors
    old = Outcome("imu", "failed", "no IMU").as_dict()
    del old["camera"]  # of an older version
    assert outcome_from(old).camera is None
