"""Lenses and mirrors measured from corners: truth within the deviations, and what is refused."""

import dataclasses

import numpy as np
import pytest

from omnisim.cameras import (
    DoubleSphereCamera,
    EquisolidCamera,
    KannalaBrandtCamera,
    MirroredCamera,
    OcamcalibCamera,
    UnifiedCamera,
)
from omnisim.cameras.optics.system_file import parse_optics
from omnisim.core.errors import MeasurementError
from omnisim.measurement.comparison import locate_board
from omnisim.measurement.geometry import BoardView, measure_geometry, measure_optics, model_choice
from omnisim.measurement.geometry.measured_geometry import MIN_SHAPE_IMAGES
from tests.cameras.optics.boards.test_calibrate import MIRROR, _changed, boards_of
from tests.measurement.geometry.board_pictures import (
    LENS,
    board_pose,
    corner_grid,
    noisy_views,
    varied_poses,
)

SIZE = LENS.width_px, LENS.height_px
GRID = corner_grid()
SIGMA_PX = 0.1
KB = ["kannala_brandt"]


@pytest.fixture(scope="module")
def views():
    return noisy_views(LENS, varied_poses(14), GRID, SIGMA_PX)


@pytest.fixture(scope="module")
def few_views(views):
    """Too few to measure the board's shape."""
    assert len(views) // 2 < MIN_SHAPE_IMAGES
    return views[::2]


def test_the_true_model_is_found_and_its_numbers_are_within_their_deviations(views):
    models = ["equidistant", "eucm", "kannala_brandt", "pinhole"]
    measured = measure_geometry(views, SIZE, models=models)
    assert measured.held_out_rms_px < 1.1 * SIGMA_PX * np.sqrt(2.0)
    assert measured.rms_px == pytest.approx(SIGMA_PX * np.sqrt(2.0), rel=0.08)
    names = [model.name for model in measured.models]
    # three fixed functions of the angle cannot be this lens
    assert names.index("kannala_brandt") < names.index("equidistant")
    if measured.model != "kannala_brandt":  # a smaller model that is as good, over this field
        sizes = {model.name: model.parameters for model in measured.models}
        assert sizes[measured.model] < sizes["kannala_brandt"]


def test_rays_of_the_measured_lens_are_those_of_the_lens():
    sigma_px = 0.01
    views = noisy_views(LENS, varied_poses(14), GRID, sigma_px)
    measured = measure_geometry(views, SIZE, models=KB, is_flat=True)
    v, u = np.mgrid[10:300:20, 10:400:20].astype(np.float64)
    pixels = np.stack((u.ravel(), v.ravel()), axis=1)
    offsets = np.concatenate([view.pixels_px for view in views]) - LENS.principal_point_px
    reach = np.linalg.norm(offsets, axis=1).max()
    pixels = pixels[np.linalg.norm(pixels - LENS.principal_point_px, axis=1) < reach]
    rays = [camera.ray_from_pixel(pixels).directions for camera in (LENS, measured.camera)]
    left, _, right = np.linalg.svd(rays[0].T @ rays[1])  # boards do not tell the camera's rotation
    turned = rays[1] @ (left @ right).T
    errors_px = LENS.focal_lengths_px[0] * np.linalg.norm(turned - rays[0], axis=1)
    # a focal length known to 0.25 % at 0.1 px: 60° from the axis 0.034 px at 0.01 px; 3 of them
    assert errors_px.max() < 0.1


@pytest.mark.slow
@pytest.mark.long
def test_standard_deviations_are_honest_in_100_sets():
    within = []
    truth = {
        f"{name}.{index}": value
        for name in ("focal_lengths_px", "principal_point_px", "coefficients")
        for index, value in enumerate(getattr(LENS, name))
    }
    poses = varied_poses(12)
    for seed in range(100):
        views = noisy_views(LENS, poses, GRID, SIGMA_PX, seed)
        measured = measure_geometry(views, SIZE, models=KB, is_flat=True)
        for quantity in measured.quantities:
            within.append(abs(quantity.value - truth[quantity.name]) < 2.0 * quantity.sigma)
    assert 0.90 <= np.mean(within) <= 0.99


@pytest.mark.parametrize(
    "lens",
    [
        DoubleSphereCamera(640, 480, (220.0, 221.0), (322.0, 236.0), -0.2, 0.59),
        EquisolidCamera(640, 480, 210.0, (322.0, 236.0)),
        OcamcalibCamera(
            640, 480, (322.0, 236.0), (-210.0, 0.0, 1.1e-3, -1e-6, 3e-9), (0.999, 2e-4, 0.0)
        ),
        UnifiedCamera(640, 480, (520.0, 521.0), (322.0, 236.0), 0.0, (-0.1, 0.02, 0.001, 0.0)),
    ],
    ids=lambda lens: lens.model_name,
)
def test_other_lenses_are_measured_too(lens):
    own, widest = (lens.model_name, 55.0) if getattr(lens, "xi", 1.0) else ("pinhole", 20.0)
    views = noisy_views(lens, varied_poses(6, widest_deg=widest, distance_m=0.6), GRID, 0.05)
    measured = measure_geometry(views, (640, 480), is_flat=True, models=[own, "kannala_brandt"])
    assert measured.held_out_rms_px < 1.15 * 0.05 * np.sqrt(2.0)
    assert next(model for model in measured.models if model.name == own).rms_px < 0.08


def _corner_moved(views, by_px):
    pixels_px = views[2].pixels_px.copy()
    pixels_px[10] += by_px
    return [*views[:2], BoardView("2.png", views[2].points_m, pixels_px), *views[3:]]


def test_corners_are_judged_by_a_decentered_lens_where_the_camera_is_one():
    # as OpenCV's own set of a misaligned camera has it; a lens without decentering is 2 px off
    decentering = (-0.02, 0.012, 0.022, -0.004)
    lens = UnifiedCamera(640, 480, (202.0, 203.0), (315.0, 215.0), 1.03, decentering)
    views = noisy_views(lens, varied_poses(8, distance_m=0.35), GRID, 0.1)
    changed = _corner_moved(views, (1.5, -1.5))  # seen by a lens that fits to 0.1 px only
    models = ["unified", "kannala_brandt"]
    measured = measure_geometry(changed, (640, 480), models=models, is_flat=True)
    assert measured.model == "unified"
    assert len(measured.errors_px) == len(views) * len(GRID) - 1
    assert measured.held_out_rms_px < 1.15 * 0.1 * np.sqrt(2.0)


def test_a_bent_board_is_measured_with_the_lens():
    x, y = GRID.T
    bow = 0.002 * (1.0 - ((x - 0.105) ** 2 + (y - 0.075) ** 2) / 0.13**2)
    offsets = np.column_stack((np.zeros_like(bow), np.zeros_like(bow), bow))
    views = noisy_views(LENS, varied_poses(20), GRID, 0.05, offsets_m=offsets)
    flat = measure_geometry(views, SIZE, models=KB, is_flat=True)
    bent = measure_geometry(views, SIZE, models=KB)
    assert bent.held_out_rms_px < 0.75 * flat.held_out_rms_px
    assert bent.rms_px == pytest.approx(0.05 * np.sqrt(2.0), rel=0.1)
    # up to a plane and a motion of the board's frame, the bow is the true one
    plane = np.column_stack((np.ones(len(x)), x, y))
    order = np.lexsort((GRID[:, 1], GRID[:, 0]))
    residual = bent.board_m[:, 2] - bow[order]
    residual -= plane[order] @ np.linalg.lstsq(plane[order], residual, rcond=None)[0]
    # the prior of 0.6 mm pulls on the bow of 2 mm
    assert np.abs(residual).max() < 0.15 * 0.002


def test_a_mirrored_camera_has_the_same_lens_behind_the_mirror(views):
    mirrored = [
        dataclasses.replace(view, pixels_px=view.pixels_px * (-1.0, 1.0) + (399.0, 0.0))
        for view in views
    ]
    measured = measure_geometry(mirrored, SIZE, mirrored=True, models=KB, is_flat=True)
    assert isinstance(measured.camera, MirroredCamera)
    lens = measured.camera.lens
    assert isinstance(lens, KannalaBrandtCamera)
    assert lens.principal_point_px[0] == pytest.approx(399.0 - LENS.principal_point_px[0], abs=0.3)


def test_an_image_of_another_lens_is_named(views):
    other = dataclasses.replace(LENS, focal_lengths_px=(170.0, 171.0))
    (strange,) = noisy_views(other, [board_pose(0.0, 15.0, 0.2)], GRID, 0.1)
    strange = dataclasses.replace(strange, name="zoomed.png")
    measured = measure_geometry([*views, strange], SIZE, models=KB, is_flat=True)
    assert [one.name for one in measured.rejected] == ["zoomed.png"]
    assert "off a lens that fits the others" in measured.rejected[0].reason


def test_a_corner_elsewhere_is_left_out(few_views):
    """An image given twice counts once."""
    copy = BoardView("copy.png", few_views[0].points_m, few_views[0].pixels_px)
    measured = measure_geometry([*_corner_moved(few_views, (4.0, -3.0)), copy], SIZE, models=KB)
    assert len(measured.errors_px) == len(few_views) * len(GRID) - 1
    assert measured.rejected[0].reason == f"the same image as {few_views[0].name}"


def test_of_many_images_all_are_fitted(views, monkeypatch):
    monkeypatch.setattr(model_choice, "MAX_COMPARED", len(views) - 5)
    count = len(views)
    measured = measure_geometry(views, SIZE, models=KB, is_flat=True)
    assert len(measured.views) == len(measured.poses) == count
    assert len(measured.errors_px) == count * len(GRID)
    assert measured.held_out_rms_px < 1.1 * SIGMA_PX * np.sqrt(2.0)


def test_too_few_boards_are_refused(views):
    with pytest.raises(MeasurementError, match="4 images with a usable board: expected at least 5"):
        measure_geometry(views[:4], SIZE)


def test_boards_of_one_orientation_do_not_determine_a_lens():
    lens = UnifiedCamera(640, 480, (900.0, 900.0), (320.0, 240.0), 0.0, (0.0,) * 4)
    poses = np.tile(np.eye(4), (5, 1, 1))
    poses[:, :3, 3] = (-0.1, -0.08, 1.0) + np.arange(5)[:, None] * (-0.01, 0.005, 0.01)
    with pytest.raises(MeasurementError, match="do not determine the focal length"):
        measure_geometry(noisy_views(lens, poses, GRID, 0.2), (640, 480))


def test_a_wrong_square_is_named():
    offsets = np.zeros((len(GRID), 3))
    offsets[20, 0] = 0.006  # a fifth of a square
    views = noisy_views(LENS, varied_poses(6), GRID, 0.05, offsets_m=offsets)
    with pytest.raises(
        MeasurementError, match=r"corner at \(120, 60\) mm is off its place in 6 of 6"
    ):
        measure_geometry(views, SIZE, models=KB)


def test_opencv_s_fisheye_calibration_is_the_same_lens(views):
    cv2 = pytest.importorskip("cv2")
    measured = measure_geometry(views, SIZE, models=KB, is_flat=True)
    names = ("RECOMPUTE_EXTRINSIC", "FIX_SKEW", "USE_INTRINSIC_GUESS")  # moved in OpenCV 5
    flags = sum(getattr(cv2.fisheye, f"CALIB_{name}", 0) for name in names)
    flags = flags or sum(getattr(cv2, f"CALIB_{name}") for name in names)
    (fx, fy), (u, v) = LENS.focal_lengths_px, LENS.principal_point_px
    # without a guess near the lens, OpenCV ends 37 px away from the corners
    guess = np.array([[fx, 0.0, u], [0.0, fy, v], [0.0, 0.0, 1.0]])
    rms, matrix, distortion, _, _ = cv2.fisheye.calibrate(
        [view.points_3d_m.reshape(1, -1, 3) for view in views],
        [view.pixels_px.reshape(1, -1, 2) for view in views],
        SIZE,
        guess,
        np.array(LENS.coefficients).reshape(4, 1),
        flags=flags,
        criteria=(cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-12),
    )
    assert measured.rms_px == pytest.approx(rms, rel=1e-6)
    lens = measured.camera
    assert isinstance(lens, KannalaBrandtCamera)
    assert lens.focal_lengths_px == pytest.approx((matrix[0, 0], matrix[1, 1]), rel=1e-5)
    assert lens.principal_point_px == pytest.approx(matrix[:2, 2], abs=1e-3)
    assert lens.coefficients == pytest.approx(distortion.ravel(), abs=1e-5)


@pytest.mark.slow
def test_opencv_s_omnidirectional_calibration_leaves_no_less():
    cv2 = pytest.importorskip("cv2")
    lens = UnifiedCamera(640, 480, (420.0, 421.0), (322.0, 236.0), 1.1, (-0.05, 0.01, 1e-3, -1e-3))
    views = noisy_views(lens, varied_poses(8, distance_m=0.5), GRID, SIGMA_PX)
    measured = measure_geometry(views, (640, 480), models=["unified"], is_flat=True)
    objects = [view.points_3d_m[:, None] for view in views]
    images = [view.pixels_px[:, None] for view in views]
    stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 500, 1e-9)
    rms = cv2.omnidir.calibrate(
        objects, images, (640, 480), None, None, None, cv2.omnidir.CALIB_FIX_SKEW, stop
    )[0]
    assert measured.rms_px <= 1.001 * rms


TRUE = {"decenter_m": [0.0008, -0.0005, 0.0], "tilt_deg": [1.2, 0.0, 0.0]}
FREE = ["surfaces.0.decenter_m.0", "surfaces.0.decenter_m.1", "surfaces.0.tilt_deg.0"]
CORNER_SIGMA_PX = 0.05


@pytest.fixture(scope="module")
def system():
    return parse_optics(_changed(MIRROR, TRUE))


@pytest.fixture(scope="module")
def mirror_views(system):
    random = np.random.default_rng(6)
    return [
        BoardView(
            f"{index}.png",
            one.points_m,
            one.pixels_px + CORNER_SIGMA_PX * random.normal(size=one.pixels_px.shape),
        )
        for index, one in enumerate(boards_of(system, 6))
    ]


@pytest.mark.slow
def test_a_misaligned_mirror_is_measured_without_an_image_of_another_board(mirror_views):
    strange = BoardView(
        "other.png", mirror_views[0].points_m * (1.05, 1.0), mirror_views[0].pixels_px + 0.01
    )
    measured = measure_optics(MIRROR, FREE, [*mirror_views, strange])
    assert [one.name for one in measured.rejected] == ["other.png"]
    assert "off a lens that fits the others" in measured.rejected[0].reason
    assert measured.rms_px == pytest.approx(CORNER_SIGMA_PX * np.sqrt(2.0), rel=0.15)
    assert measured.rms_px < measured.held_out_rms_px < 1.3 * CORNER_SIGMA_PX * np.sqrt(2.0)
    truth = (*TRUE["decenter_m"][:2], TRUE["tilt_deg"][0])
    for quantity, true in zip(measured.quantities, truth, strict=True):
        assert abs(quantity.value - true) < 4.0 * quantity.sigma
    assert [one.unit for one in measured.quantities] == ["m", "m", "°"]


def test_a_board_is_located_before_a_mirror(system, mirror_views):
    placed = locate_board(system, mirror_views[0])
    errors = placed.pixels(mirror_views[0].points_m).positions_px - mirror_views[0].pixels_px
    assert np.sqrt(np.mean(np.square(errors))) < 1.2 * CORNER_SIGMA_PX


def test_too_few_images_of_a_mirror_are_refused(mirror_views):
    with pytest.raises(MeasurementError, match="4 images with a usable board: expected at least 5"):
        measure_optics(MIRROR, FREE, mirror_views[:4])
