"""Conversions of every format to every other: a file that loads again, or a reason in one line."""

from dataclasses import astuple, replace

import numpy as np
import pytest

from omnisim.cameras import MirroredCamera, pixel_grid
from omnisim.cameras.calibration import (
    FORMATS,
    calibration_of,
    calibration_text,
    fit,
    load_calibration,
)
from omnisim.core.errors import CalibrationError
from tests.camera_examples import CAMERA_EXAMPLES
from tests.cameras.calibration.sample_files import EXACT_SAMPLES, FOLDER, rig_rays

# Cameras that are like others' of the samples: files are read in other tests.
ALIKE = {
    "euroc_sensor.yaml", "kalibr_openvins.yaml", "kitti360_image_03.yaml", "matlab_pinhole.json",
    "orbslam3_old.yaml", "orbslam3_tum_vi.yaml", "ros_echo.yaml", "sfm_data.json",
}  # fmt: skip
CONVERTED = [path for path in EXACT_SAMPLES if path.name not in ALIKE]


@pytest.fixture
def quick_fits(monkeypatch):
    """Fits by their linear initialization alone: near, not the nearest."""
    monkeypatch.setattr(fit, "_refined", lambda start, *arguments: (start, np.eye(3)))


@pytest.mark.usefixtures("quick_fits")
@pytest.mark.parametrize("path", CONVERTED, ids=lambda path: path.name)
def test_any_format_converts_to_any_other_or_gives_the_reason(path, tmp_path):
    loaded = load_calibration(path)
    first, reached = loaded.only(loaded.names[0]), set()
    for name, form in FORMATS.items():
        try:
            text, written = calibration_text(first, name)
        except CalibrationError as reason:
            message = str(reason)
            assert "\n" not in message
            assert len(message) < 500
            continue
        reached.add(name)
        target = tmp_path / f"file{form.suffix}"
        target.write_text(text)
        again = load_calibration(target)
        assert again.format == name
        for before, after in zip(written.cameras, again.cameras, strict=True):
            (ours, valid), (theirs, still_valid) = (
                rig_rays(one.camera, 9) for one in (before, after)
            )
            np.testing.assert_allclose(theirs, ours, atol=1e-14)
            assert np.array_equal(valid, still_valid)
            stated, found = (one.residuals and astuple(one.residuals) for one in (before, after))
            assert (stated is None) == (found is None)
            if stated is not None:  # the cone goes through degrees
                assert found[:3] == pytest.approx(stated[:3], rel=1e-14)
    assert {"omnisim", loaded.format} <= reached


@pytest.mark.parametrize(
    ("form", "name", "words"),
    [
        ("ros", "kannala-brandt-tum-vi", r"sees up to 115\.6° from its axis: ros ends before 90°"),
        ("foxglove", "equirectangular", r"up to 180\.0° from its axis: foxglove ends before 90°"),
        ("kalibr", "equirectangular", "kalibr has no panorama model, got equirectangular"),
        ("colmap", "cylindrical", "colmap has no panorama model, got cylindrical"),
        ("opencv_omnidir", "equidistant-full-sphere",
         "opencv_omnidir cannot represent model 'equidistant': the nearest, 'unified', is up to"),
        ("gazebo", "hyperbolic-off-center",
         "gazebo cannot represent model 'hyperbolic'"),
        ("basalt", "orthographic-full", None),
    ],
)  # fmt: skip
@pytest.mark.usefixtures("quick_fits")
def test_unsupported_cameras_are_refused_with_the_reason(form, name, words, tmp_path):
    calibration = calibration_of(CAMERA_EXAMPLES[name])
    path = tmp_path / "file"
    if words is None:
        calibration.save(path, form)
        return
    with pytest.raises(CalibrationError, match=words) as info:
        calibration.save(path, form)
    assert "\n" not in str(info.value)
    assert not path.exists()


@pytest.mark.parametrize(
    ("name", "form", "model"),
    [
        ("double-sphere-tum-vi", "opencv_fisheye", None),
        ("kannala-brandt-tum-vi", "kalibr", "eucm"),
        ("hyperbolic-paper", "kalibr", "kannala_brandt"),
        ("f-theta-woodscape-like", "kitti360", "kannala_brandt"),
    ],
)
def test_stated_residuals_are_confirmed_by_every_pixel(name, form, model, tmp_path):
    """Every pixel's ray, projected again by the camera of the file, without the fit's own code."""
    camera = CAMERA_EXAMPLES[name]
    path = tmp_path / "file"
    calibration_of(camera).save(path, form, model)
    text = path.read_text()
    found = load_calibration(path).cameras[0]
    assert model in (None, found.camera.model_name)
    assert f'"rms_px": {found.residuals.rms_px!r}' in text
    assert f'"max_px": {found.residuals.max_px!r}' in text
    assert found.residuals.source_model == camera.model_name
    pixels = pixel_grid(camera.width_px, camera.height_px)
    rays = camera.ray_from_pixel(pixels)
    seen = found.camera.pixel_from_ray(rays.directions[rays.valid])
    assert seen.valid.mean() > 0.99
    off = np.linalg.norm(seen.positions_px - pixels[rays.valid], axis=-1)[seen.valid]
    # the fit's own pixels are others, and fewer, its edge half a pixel further out
    assert np.sqrt(np.mean(off**2)) == pytest.approx(found.residuals.rms_px, rel=0.25)
    assert off.max() <= 1.05 * found.residuals.max_px
    assert off.max() > 0.3 * found.residuals.max_px
    assert isinstance(found.camera, MirroredCamera) == (name == "hyperbolic-paper")


def test_poses_are_chained(tmp_path):
    """Kalibr's chain becomes Basalt's, the second camera's pose by way of the first's."""
    chain = load_calibration(FOLDER / "kalibr_tum_vi.yaml")
    chain.save(tmp_path / "basalt.json", "basalt")
    back = load_calibration(tmp_path / "basalt.json")
    first, second = (one.poses[0] for one in back.cameras)
    assert (second.target, second.source) == ("imu", "cam1")
    known = {(pose.target, pose.source): pose for camera in chain.cameras for pose in camera.poses}
    chained = (known[pair].target_from_source for pair in (("cam1", "cam0"), ("cam0", "imu")))
    cam1_from_cam0, cam0_from_imu = chained
    cam1_from_imu = cam1_from_cam0 @ cam0_from_imu
    np.testing.assert_allclose(second.target_from_source @ cam1_from_imu, np.eye(4), atol=1e-12)
    # as TUM-VI publishes it
    np.testing.assert_allclose(
        first.target_from_source[:3, 3], (0.0453656607, -0.0719960019, -0.0447818071), atol=1e-9
    )


def test_unknown_poses_are_not_made_up(tmp_path):
    calibration = load_calibration(FOLDER / "kalibr_models.yaml")
    (camera,) = (one for one in calibration.cameras if one.camera.model_name == "double_sphere")
    calibration.only(camera.name).save(tmp_path / "basalt.json", "basalt")
    assert load_calibration(tmp_path / "basalt.json").cameras[0].poses == ()


def test_several_cameras_need_a_format_that_takes_them(tmp_path):
    calibration = load_calibration(FOLDER / "kalibr_tum_vi.yaml")
    with pytest.raises(CalibrationError, match="2 cameras, and a ros file holds one"):
        calibration.save(tmp_path / "a.yaml", "ros")
    renamed = replace(calibration.cameras[0], name="left eye")
    one = replace(calibration, cameras=(renamed,))
    assert one.save(tmp_path / "a.yaml", "kalibr").names == ["cam0"]
    assert one.save(tmp_path / "a.json", "omnisim").names == ["left eye"]


def test_a_model_can_be_asked_for(tmp_path):
    calibration = calibration_of(CAMERA_EXAMPLES["perspective"])
    written = calibration.save(tmp_path / "a.yaml", "kalibr", model="eucm")
    assert written.cameras[0].camera.model_name == "eucm"
    assert written.cameras[0].residuals is None
    fitted = calibration_of(CAMERA_EXAMPLES["hyperbolic-paper"])
    written = fitted.save(tmp_path / "a.json", "omnisim", model="kannala_brandt").cameras[0]
    found = load_calibration(tmp_path / "a.json").cameras[0]
    assert found.camera == written.camera
    assert isinstance(found.camera, MirroredCamera)
    assert found.residuals.max_px < 0.01
    with pytest.raises(CalibrationError, match=r"--model gazebo: .* expected one of unified"):
        calibration.save(tmp_path / "a.yaml", "kalibr", model="gazebo")
