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


def test_corners_become_a_sensor_file(omnisim, tmp_path):
    views = noisy_views(LENS, varied_poses(10), corner_grid(), 0.05)
    corners = tmp_path / "corners.csv"
    write_corners(corners, [BoardCorners(one.points_m, one.pixels_px) for one in views])
    output = tmp_path / "camera.toml"
    arguments = [str(corners), "--size", "400", "300", "--model", "kannala_brandt"]
    status, out, err = omnisim("measure", "geometry", *arguments, "-o", output)
    assert status == 0, err
    assert "RMS is more than" not in err
    assert "kannala_brandt: 0.06" in out  # 0.05 px along each axis, less what the poses take
    camera = OmniCamera.from_file(output).model
    assert isinstance(camera, KannalaBrandtCamera)
    assert camera.focal_lengths_px == pytest.approx(LENS.focal_lengths_px, rel=0.01)
    report = json.loads(output.with_suffix(".json").read_text())["geometry"]
    assert len(report["images"]) == 10
    assert {one["name"] for one in report["quantities"]} > {"focal_lengths_px.0", "coefficients.3"}
    assert (tmp_path / "camera-corners.csv").exists()
    assert (tmp_path / "camera-residuals.png").exists()


def test_corners_that_fit_badly_leave_a_note(omnisim, tmp_path):
    views = noisy_views(LENS, varied_poses(5), corner_grid(), 0.5)
    corners = [BoardCorners(one.points_m, one.pixels_px) for one in views]
    write_corners(tmp_path / "corners.csv", corners)
    options = ("--size", "400", "300", "--model", "kannala_brandt", "-o", "camera.toml")
    status, _, error = omnisim("measure", "geometry", "corners.csv", *options)
    assert status == 0, error
    assert "px RMS is more than sharp images have; possible causes: several cameras" in error


@pytest.mark.slow
def test_images_become_a_sensor_file(omnisim, tmp_path):
    pytest.importorskip("cv2")
    for index, pose in enumerate(varied_poses(9, widest_deg=40.0)):
        pose[:3, 3] += pose[:3, :3] @ (-0.105, -0.075, 0.0)
        image = board_image(LENS, pose, chessboard_texture())
        write_numbers(tmp_path / f"{index}.png", image)
    output = tmp_path / "camera.toml"
    options = ("--board", "8x6:30mm", "--model", "kannala_brandt", "--model", "unified")
    status, _, err = omnisim("measure", "geometry", tmp_path, *options, "-o", output)
    assert status == 0, err
    report = json.loads(output.with_suffix(".json").read_text())["geometry"]
    assert report["held_out_rms_px"] < 0.15


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--free", "surfaces.0.tilt_deg"], "--free: expected --optics, whose keys it names"),
        (["--optics", "mirror.toml"], "--optics: expected --free KEY, such as surfaces.0.tilt_deg"),
        (
            ["--optics", "mirror.toml", "--free", "surfaces.0.k", "--model", "unified"],
            "--model: expected none, as --optics states the model",
        ),
        (
            ["--optics", "mirror.toml", "--free", "surfaces.1.k"],
            "mirror.toml: surfaces.1.k: expected a number, got no such key",
        ),
        (
            ["--optics", "mirror.toml", "--free", "surfaces.0.tilt_deg.0"],
            "corners.csv: 400 × 300 px: expected 360 × 360 px as in mirror.toml",
        ),
    ],
)
def test_faults_of_optics_are_named(omnisim, tmp_path, arguments, message):
    views = noisy_views(LENS, varied_poses(5), corner_grid(), 0.05)
    corners = [BoardCorners(one.points_m, one.pixels_px) for one in views]
    write_corners(tmp_path / "corners.csv", corners)
    (tmp_path / "mirror.toml").write_text(
        "[camera]\nmodel = 'perspective'\nwidth_px = 360\nheight_px = 360\n"
        "focal_length_px = 1330\n[[surfaces]]\nshape = 'hyperbolic'\nrim_radius_m = 0.0119\n"
    )
    status, _, error = omnisim(
        "measure", "geometry", "corners.csv", "--size", "400", "300", *arguments, "-o", "c.toml"
    )
    assert (status, error) == (1, f"error: {message}\n")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["corners.csv", "mirror.toml"]
