"""`omnisim measure geometry`: sensor file, report, corners and plot of a simulated lens."""

import json

import pytest

from omnisim.cameras import KannalaBrandtCamera
from omnisim.cameras.optics.system_calibration import BoardCorners, write_corners
from omnisim.core.files.image_files import write_numbers
from omnisim.rendering.camera.omnicamera import OmniCamera
from tests.measurement.geometry.board_pictures import (
    LENS,
    board_image,
    chessboard_texture,
    corner_grid,
    noisy_views,
    varied_poses,
)

CORNERS = ("measure", "geometry", "corners.csv", "--size", "400", "300")


def _write_corners(folder, count, sigma_px):
    views = noisy_views(LENS, varied_poses(count), corner_grid(), sigma_px)
    corners = [BoardCorners(view.points_m, view.pixels_px) for view in views]
    write_corners(folder / "corners.csv", corners)


def test_corners_become_a_sensor_file(ran, tmp_path):
    _write_corners(tmp_path, 7, 0.05)
    output = tmp_path / "camera.toml"
    out, err = ran(*CORNERS, "--model", "kannala_brandt", "-o", output)
    assert "RMS is more than" not in err
    assert "kannala_brandt: 0.06" in out  # 0.05 px along each axis, less what the poses take
    camera = OmniCamera.from_file(output).model
    assert isinstance(camera, KannalaBrandtCamera)
    assert camera.focal_lengths_px == pytest.approx(LENS.focal_lengths_px, rel=0.01)
    report = json.loads(output.with_suffix(".json").read_text())["geometry"]
    assert len(report["images"]) == 7
    names = {quantity["name"] for quantity in report["quantities"]}
    assert names > {"focal_lengths_px.0", "coefficients.3"}
    assert (tmp_path / "camera-corners.csv").exists()
    assert (tmp_path / "camera-residuals.png").exists()


def test_corners_that_fit_badly_leave_a_note(ran, tmp_path):
    _write_corners(tmp_path, 5, 0.5)
    _, error = ran(*CORNERS, "--model", "kannala_brandt", "-o", "camera.toml")
    assert "px RMS is more than sharp images have; possible causes: several cameras" in error


@pytest.mark.slow
def test_images_become_a_sensor_file(ran, tmp_path):
    pytest.importorskip("cv2")
    for index, pose in enumerate(varied_poses(9, widest_deg=40.0)):
        pose[:3, 3] += pose[:3, :3] @ (-0.105, -0.075, 0.0)
        image = board_image(LENS, pose, chessboard_texture())
        write_numbers(tmp_path / f"{index}.png", image)
    output = tmp_path / "camera.toml"
    options = ("--board", "8x6:30mm", "--model", "kannala_brandt", "--model", "unified")
    ran("measure", "geometry", tmp_path, *options, "-o", output)
    report = json.loads(output.with_suffix(".json").read_text())["geometry"]
    assert report["held_out_rms_px"] < 0.15


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--free", "surfaces.0.tilt_deg"], "--free: requires --optics, whose keys it names"),
        (["--optics", "mirror.toml"], "--optics: requires --free KEY, such as surfaces.0.tilt_deg"),
        (["--optics", "mirror.toml", "--free", "surfaces.0.k", "--model", "unified"],
         "--model: expected none with --optics, which states the model"),
        (["--optics", "mirror.toml", "--free", "surfaces.1.k"],
         "mirror.toml: surfaces.1.k: expected a number, got no such key"),
        (["--optics", "mirror.toml", "--free", "surfaces.0.tilt_deg.0"],
         "corners.csv: 400 × 300 px: expected 360 × 360 px as in mirror.toml"),
    ],
)  # fmt: skip
def test_faults_of_optics_are_named(refused, tmp_path, arguments, message):
    _write_corners(tmp_path, 5, 0.05)
    (tmp_path / "mirror.toml").write_text(
        "[camera]\nmodel = 'perspective'\nwidth_px = 360\nheight_px = 360\n"
        "focal_length_px = 1330\n[[surfaces]]\nshape = 'hyperbolic'\nrim_radius_m = 0.0119\n"
    )
    assert refused(*CORNERS, *arguments, "-o", "c.toml") == message
