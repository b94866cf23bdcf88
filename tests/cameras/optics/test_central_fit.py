"""Central calibrations of optical systems: exact where there is one, and honest where not."""

import dataclasses
import math

import numpy as np
import pytest

from omnisim.cameras import KannalaBrandtCamera, MirroredCamera, PerspectiveCamera
from omnisim.cameras.calibration import FORMATS, find_pose, load_calibration
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.cameras.optics import (
    CentralView,
    OpticalSystem,
    Surface,
    fit_central,
    measure_centrality,
)
from omnisim.cameras.optics.shapes import Conic
from omnisim.core import poses
from omnisim.core.errors import CalibrationError, OpticsError
from tests.cameras.optics.examples import FISHEYE, HYPERBOLA, SYSTEMS
from tests.slow import slow_but


def _turned_hyperbola(turn):
    """The central mirror and its camera, both turned about the pinhole."""
    system = SYSTEMS["hyperbola"]
    (mirror,) = system.surfaces
    surface = dataclasses.replace(mirror, system_from_surface=turn @ mirror.system_from_surface)
    return dataclasses.replace(system, surfaces=(surface,), system_from_camera=turn)


def test_central_mirror_is_found_with_its_pose():
    """Its directions are the unified model's (Geyer and Daniilidis 2001), about its own axis."""
    turn = poses.pose((0.01, 0.02, 0.03), roll_deg=12.0, pitch_deg=-20.0, yaw_deg=33.0)
    calibration = fit_central(_turned_hyperbola(turn), "opencv_omnidir")
    (fitted,) = calibration.cameras
    assert fitted.residuals.max_px < 1e-10
    assert max(error.max_px for error in fitted.residuals.at_distances) < 1e-10
    assert fitted.camera.lens.xi == pytest.approx(HyperbolicMirror().xi, abs=1e-9)
    pose = find_pose(fitted.poses, "optics", "camera")
    np.testing.assert_allclose(pose[:3, :3], turn[:3, :3], atol=1e-10)
    focus_m = turn @ (0.0, 0.0, HYPERBOLA.focal_distance_m, 1.0)
    np.testing.assert_allclose(pose[:3, 3], focus_m[:3], atol=1e-9)


@pytest.mark.parametrize("name", ["sphere", "tilted camera"])
def test_residuals_are_those_of_points(name, tmp_path):
    """Points on the rays, taken through the file as its user would, are as far off as it says."""
    system, distance_m = SYSTEMS[name], 0.7
    fit_central(system, "opencv_fisheye", distances_m=[distance_m]).save(
        tmp_path / "fitted.yaml", "opencv_fisheye"
    )
    (loaded,) = load_calibration(tmp_path / "fitted.yaml").cameras
    optics_from_camera = find_pose(loaded.poses, "optics", loaded.name)
    viewpoint_m = optics_from_camera[:3, 3]
    generator = np.random.default_rng(3)
    pixels = generator.uniform(0.0, 359.0, (2000, 2))
    rays = system.rays(pixels)
    pixels, origins_m, directions = (x[rays.valid] for x in (pixels, *rays[:2]))
    lengths = np.full(len(pixels), distance_m)
    for _ in range(50):  # to the sphere about the viewpoint, by fixed-point iteration
        points_m = origins_m + lengths[:, None] * directions
        lengths += distance_m - np.linalg.norm(points_m - viewpoint_m, axis=1)
    seen = loaded.camera.pixel_from_ray((points_m - viewpoint_m) @ optics_from_camera[:3, :3])
    off_px = np.linalg.norm(seen.positions_px - pixels, axis=1)[seen.valid]
    infinity, near = loaded.residuals.at_distances
    assert (infinity.distance_m, near.distance_m) == (math.inf, distance_m)
    assert off_px.mean() == pytest.approx(near.mean_px, rel=0.05)
    assert np.percentile(off_px, 99.0) == pytest.approx(near.percentile_99_px, rel=0.05)
    assert near.mean_px > infinity.mean_px


def test_fit_is_right_at_the_distance_asked():
    system = SYSTEMS["sphere"]
    near = fit_central(system, "opencv_fisheye", right_at_m=0.5, distances_m=[0.5, 5.0])
    infinity, at_half, at_five = near.cameras[0].residuals.at_distances
    assert at_half.max_px < 0.01
    assert at_five.mean_px > 0.1
    assert infinity.mean_px > at_five.mean_px


@pytest.mark.parametrize("form", slow_but(FORMATS, long=("ocamcalib", "omnisim", "ros")))
def test_every_format_says_what_is_left(form, tmp_path):
    """A dome a little off is nearly a lens, which most formats represent."""
    system = dataclasses.replace(SYSTEMS["dome"], camera=FISHEYE.scaled(0.25))
    path = tmp_path / f"file{FORMATS[form].suffix}"
    if form in {"opencv_pinhole", "blender_osl"}:  # the latter has no model to fit
        with pytest.raises(CalibrationError, match=rf"{form} (cannot represent|ends before)"):
            fit_central(system, form).save(path, form)
        return
    fit_central(system, form).save(path, form)
    (loaded,) = load_calibration(path).cameras
    assert loaded.residuals.source_model == "optics"
    assert [error.distance_m for error in loaded.residuals.at_distances] == [math.inf, 0.3, 1, 5]
    assert find_pose(loaded.poses, "optics", loaded.name) is not None


def test_one_model_alone():
    (fitted,) = fit_central(SYSTEMS["sphere"], model="kannala_brandt").cameras
    assert isinstance(fitted.camera, MirroredCamera)
    assert isinstance(fitted.camera.lens, KannalaBrandtCamera)
    with pytest.raises(CalibrationError, match=r"--model eucm: .* expected one of kannala_brandt"):
        fit_central(SYSTEMS["sphere"], "opencv_fisheye", "eucm")


def test_no_lens_is_near():
    with pytest.raises(CalibrationError, match="opencv_omnidir cannot represent"):
        fit_central(SYSTEMS["cone"], "opencv_omnidir", source="cone.toml")


@pytest.mark.parametrize("distance_m", [math.inf, 0.6])
def test_view_is_a_camera(distance_m):
    system = SYSTEMS["sphere"]
    view = CentralView(system, distance_m)
    pixels = np.array([[180.0, 200.0], [100.0, 150.0]])
    rays = view.ray_from_pixel(pixels)
    assert rays.valid.all()
    np.testing.assert_allclose(view.pixel_from_ray(rays.directions).positions_px, pixels, atol=1e-7)
    at_far = view.errors((distance_m,))[0] if math.isfinite(distance_m) else view.errors()[2]
    assert at_far.max_px < (1e-6 if math.isfinite(distance_m) else 0.2)


def test_view_tells_its_error():
    measured = measure_centrality(SYSTEMS["sphere"], (0.3, 1.0, 5.0))
    assert CentralView(SYSTEMS["sphere"]).errors() == measured.errors
    words = CentralView(SYSTEMS["sphere"]).caveat()
    assert f"{measured.errors[0].percentile_99_px:.2g} px at 0.3 m" in words


@pytest.mark.parametrize("distance_m", [0.0, -1.0, np.nan])
def test_impossible_distances(distance_m):
    with pytest.raises(OpticsError, match="distance_m: expected more than 0"):
        CentralView(SYSTEMS["sphere"], distance_m)


def test_axis_of_a_ball_that_is_aside_in_a_wide_image():
    """The ball's outline is in the middle of the image no more, and sees nearly all around."""
    camera = PerspectiveCamera(1280, 960, 1240.0, (639.5, 479.5))
    ball = Surface(Conic(0.02), poses.pose((0.0012, -0.0008, 0.0815)))
    (fitted,) = fit_central(OpticalSystem(camera, (ball,)), "opencv_fisheye").cameras
    assert fitted.residuals.max_px < 1.0


def test_residuals_stay_with_a_camera_that_is_fitted_again(tmp_path):
    system = dataclasses.replace(SYSTEMS["dome"], camera=FISHEYE.scaled(0.5))
    first = fit_central(system, "opencv_fisheye")
    again = first.save(tmp_path / "again.yaml", "kalibr", "eucm").cameras[0]
    assert again.residuals.source_model == "kannala_brandt"
    (loaded,) = load_calibration(tmp_path / "again.yaml").cameras
    assert loaded.residuals.at_distances == first.cameras[0].residuals.at_distances
    assert find_pose(loaded.poses, "optics", loaded.name) is not None
