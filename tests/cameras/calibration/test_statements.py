"""Two statements of one quantity in a file are compared, and other tools' statements are read."""

import dataclasses
import json
import math

import numpy as np
import pytest

from omnisim.cameras import (
    EquirectangularCamera,
    KannalaBrandtCamera,
    PerspectiveCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration import calibration_of, load_calibration
from omnisim.cameras.calibration.formats.ocamcalib import inverse_polynomial
from omnisim.cameras.models.field_of_view import field_of_view
from omnisim.core.errors import CalibrationError, NoticeWarning
from omnisim.core.files.image_files import write_image
from omnisim.core.poses import inverse, pose
from tests.cameras import formulas
from tests.cameras.calibration.sample_files import FOLDER

FRAME = {"file_path": "./train/r_0", "transform_matrix": np.eye(4).tolist()}
SIZE = {"w": 1920, "h": 1080}
FISHEYE = {"fl_x": 500.0, "fl_y": 500.0, "cx": 640.0, "cy": 480.0, "w": 1280, "h": 960}


def read_transforms(tmp_path, **keys):
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps({**keys, "frames": [FRAME]}))
    return load_calibration(path)


def test_a_fisheye_of_instant_ngp_is_no_pinhole(tmp_path):
    camera = read_transforms(tmp_path, is_fisheye=True, k1=0.1, k2=-0.01, **FISHEYE).cameras[0]
    assert isinstance(camera.camera, KannalaBrandtCamera)
    assert math.degrees(field_of_view(camera.camera).horizontal_rad) == pytest.approx(
        131.6, abs=0.1
    )
    for stated, model in ((True, "OPENCV"), (False, "OPENCV_FISHEYE")):
        with pytest.raises(
            CalibrationError, match=r"camera_model: expected .* as is_fisheye states"
        ):
            read_transforms(tmp_path, is_fisheye=stated, camera_model=model, **FISHEYE)
    for key in ("equirectangular", "orthographic", "k5"):
        with pytest.raises(CalibrationError, match=f"{key} = .*is not read: state a camera_model"):
            read_transforms(tmp_path, **{key: 1.5}, **FISHEYE)


def test_other_lenses_of_instant_ngp(tmp_path):
    panorama = read_transforms(tmp_path, latlong=True, w=200, h=100).cameras[0].camera
    assert panorama == EquirectangularCamera(200, 100)
    keys = {f"ftheta_p{power}": value for power, value in enumerate((0.0, 2e-3, 0.0, 1e-9, 0.0))}
    lens = read_transforms(tmp_path, cx=650.0, cy=470.0, w=1280, h=960, **keys).cameras[0].camera
    pixels = np.stack(np.meshgrid(np.arange(0.0, 1280.0, 99.0), np.arange(0.0, 960.0, 99.0)), -1)
    offset = pixels + 0.5 - (650.0, 470.0)
    r = np.hypot(*offset.transpose(2, 0, 1))
    alpha = r * (2e-3 + r * r * 1e-9)
    theirs = np.stack((*(np.sin(alpha) / r * offset.transpose(2, 0, 1)), np.cos(alpha)), axis=-1)
    np.testing.assert_allclose(lens.ray_from_pixel(pixels).directions, theirs, atol=1e-12)
    with pytest.raises(CalibrationError, match=r"ftheta_p0: expected 0, .* got 0.1"):
        read_transforms(tmp_path, **{**keys, "ftheta_p0": 0.1}, w=1280, h=960)
    for stated, model in ((True, "OPENCV"), (False, "EQUIRECTANGULAR")):
        with pytest.raises(CalibrationError, match="camera_model: expected none beside latlong"):
            read_transforms(tmp_path, latlong=stated, camera_model=model, w=200, h=100)


def test_keys_of_other_lenses_are_named(tmp_path):
    whole = {"w": 200, "h": 100, "fl_x": 100.0, "fl_y": 100.0, "cx": 100.0, "cy": 50.0}
    assert read_transforms(tmp_path, latlong=True, **whole).cameras[0].notes == ()
    with pytest.warns(NoticeWarning, match=r"fl_x = 90.0, k1 = 0.1: not read in a panorama"):
        read_transforms(tmp_path, latlong=True, **{**whole, "fl_x": 90.0}, k1=0.1)
    with pytest.warns(NoticeWarning, match=r"camera_angle_x = 2.0: not read in an f-theta lens"):
        read_transforms(tmp_path, camera_angle_x=2.0, ftheta_p1=2e-3, cx=99.0, w=200, h=100)


@pytest.mark.parametrize(
    ("keys", "focal_px"),
    [
        ({"camera_angle_x": 0.785398, "camera_angle_y": 0.6}, (2317.65, 1745.67)),
        ({"x_fov": 45.0, "y_fov": 40.0}, (2317.64, 1483.64)),
        ({"x_fov": 45.0}, (2317.64, 2317.64)),
        ({"camera_angle_y": 0.6}, (1745.67, 1745.67)),
    ],
)
def test_fields_of_view_along_both_axes(tmp_path, keys, focal_px):
    calibration = read_transforms(tmp_path, **keys, **SIZE)
    camera = calibration.cameras[0].camera
    assert isinstance(camera, PerspectiveCamera | UnifiedCamera)
    found = np.broadcast_to(camera.pixels_per_plane, 2)
    assert found == pytest.approx(focal_px, abs=0.01)
    assert calibration.notes == []


def test_a_field_of_view_is_compared_with_the_focal_length(tmp_path):
    keys = {"fl_x": 2317.65, "fl_y": 1745.67, "camera_angle_x": 0.785398, **SIZE}
    assert read_transforms(tmp_path, **keys).notes == []
    with pytest.warns(
        NoticeWarning, match=r"camera_angle_y = 0.7 is not read: .* fl_y states 1745"
    ):
        read_transforms(tmp_path, camera_angle_y=0.7, **keys)


def test_the_size_is_that_of_the_images(tmp_path):
    with pytest.raises(
        CalibrationError, match=r"w: missing: expected it, or the image ./train/r_0"
    ):
        read_transforms(tmp_path, camera_angle_x=0.69)
    (tmp_path / "train").mkdir()
    write_image(tmp_path / "train" / "r_0.png", np.zeros((6, 8, 3), np.uint8))
    camera = read_transforms(tmp_path, camera_angle_x=0.69).cameras[0].camera
    assert (camera.width_px, camera.height_px) == (8, 6)
    (note,) = read_transforms(tmp_path, camera_angle_x=0.69, w=16, h=12).notes
    assert note == "w, h = 16, 12, but ./train/r_0 has 8 × 6 px"


def test_the_inverse_extrinsics_of_openvins(tmp_path):
    text = (FOLDER / "kalibr_tum_vi.yaml").read_text()
    camera = load_calibration(FOLDER / "kalibr_tum_vi.yaml").cameras[0]
    (cam_from_imu,) = (one.target_from_source for one in camera.poses if one.source == "imu")
    own = f"  T_imu_cam: {inverse(cam_from_imu).tolist()}\n"
    path = tmp_path / "chain.yaml"
    path.write_text(text.replace("  camera_model:", f"{own}  camera_model:", 1))
    both = load_calibration(path)
    assert both.notes == []
    first, second = (one for one in both.cameras[0].poses if one.source == "imu")
    np.testing.assert_allclose(first.target_from_source, second.target_from_source, atol=1e-12)
    other = f"  T_imu_cam: {(pose((0.1, 0.0, 0.0)) @ inverse(cam_from_imu)).tolist()}\n"
    path.write_text(text.replace("  camera_model:", f"{other}  camera_model:", 1))
    (note,) = load_calibration(path).notes
    assert "cam0 from imu: expected the pose that the other extrinsics chain to" in note
    assert "100 mm" in note


def ocam_text(tmp_path, change):
    path = tmp_path / "calib_results.txt"
    text = (FOLDER / "ocamcalib.txt").read_text()
    lens = load_calibration(FOLDER / "ocamcalib.txt").cameras[0].camera
    inverse_line = next(line for line in text.splitlines() if line.startswith("12 "))
    coefficients = change(np.array(inverse_polynomial(lens)))
    numbers = " ".join(repr(float(coefficient)) for coefficient in coefficients)
    path.write_text(text.replace(inverse_line, f"{len(coefficients)} {numbers}"))
    return path


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda inverse: 0.0 * inverse, "the inverse polynomial is all zeros: it is not read"),
        (lambda inverse: inverse + np.eye(len(inverse))[0] * 5.0, "px off the direct one"),
        (lambda inverse: np.polynomial.Polynomial(inverse)(
            np.polynomial.Polynomial([-math.pi / 2, 1.0])).coef, "takes angles from the axis"),
        (lambda inverse: inverse, ""),
    ],
)  # fmt: skip
def test_an_inverse_polynomial_is_compared_with_the_direct_one(tmp_path, change, words):
    notes = load_calibration(ocam_text(tmp_path, change)).notes
    assert len(notes) == bool(words)
    assert all(words in note for note in notes)


def test_opencvs_matrices_under_two_names(tmp_path):
    text = (FOLDER / "opencv_fisheye.yaml").read_text()
    matrix = text[text.index("camera_matrix") : text.index("distortion_coeff")]
    path = tmp_path / "a.yaml"
    path.write_text(text + matrix.replace("camera_matrix", "K"))
    assert load_calibration(path).notes == []
    path.write_text(
        text + matrix.replace("camera_matrix", "K").replace("[ ", "[").replace("[", "[1")
    )
    with pytest.raises(CalibrationError, match=r"camera_matrix, K: expected the same numbers"):
        load_calibration(path)


def test_a_lens_that_folds_inside_its_image_is_named(tmp_path):
    path = tmp_path / "a.yaml"
    folding = KannalaBrandtCamera(320, 240, (90.0, 90.0), (159.5, 119.5), (-0.2, 0.0, 0.0, 0.0))
    calibration_of(folding).save(path, "opencv_fisheye")
    (note,) = load_calibration(path).notes
    assert note.startswith("the lens folds at 74.0°, inside the image: ")
    assert note.endswith(" % of the image is black")
    calibration_of(folding.ending_at(math.radians(60.0))).save(path, "opencv_fisheye")
    assert load_calibration(path).notes == []
    path.write_text(path.read_text().replace("1.047197551", "1.947197551"))
    (note,) = load_calibration(path).notes
    assert note == "θ_max = 111.6° is never reached: the lens folds at 74.0°"


def test_kitti_360_leaves_out_tangential_distortion(tmp_path):
    calibration = load_calibration(FOLDER / "kitti360_image_02.yaml")
    (note,) = calibration.save(tmp_path / "a.yaml", "kitti360").notes
    lens = calibration.cameras[0].camera
    radial = dataclasses.replace(lens, distortion=(*lens.distortion[:2], 0.0, 0.0))
    u, v = (np.linspace(0.0, side - 1.0, 65) for side in (lens.width_px, lens.height_px))
    rays = lens.ray_from_pixel(np.stack(np.meshgrid(u, v), axis=-1))
    seen = rays.directions[rays.valid].T
    off_px = formulas.brown(lens, *seen) - formulas.brown(radial, *seen)
    most_px = np.linalg.norm(off_px, axis=-1).max()
    assert note == f"KITTI-360's own code leaves out p1 and p2: it is up to {most_px:.2g} px off"
    assert calibration.save(tmp_path / "b.yaml", "opencv_omnidir").notes == []


def test_the_first_of_several_printed_messages_is_read(tmp_path):
    text = (FOLDER / "ros_echo.yaml").read_text()
    (tmp_path / "a.yaml").write_text(f"{text}---\n{text.replace('330.5', '331.5')}---\n")
    camera = load_calibration(tmp_path / "a.yaml").cameras[0]
    assert camera.camera == load_calibration(FOLDER / "ros_echo.yaml").cameras[0].camera
    assert camera.name == "front_camera"


T265 = """header: {{frame_id: camera_fisheye1_optical_frame}}
height: 800
width: 848
distortion_model: {model}
d: [-0.00217445590533, 0.0376055203378, -0.036404311657, 0.00593686196953, {last}]
k: [285.6466979980469, 0.0, 424.5740051269531, 0.0, 286.68499755859375, 408.1993103027344, 0, 0, 1]
---
"""


def test_the_five_numbers_of_a_t265_are_four(tmp_path):
    """As `rs2_project_point_to_pixel` of librealsense has them."""
    path = tmp_path / "echo.yaml"
    path.write_text(T265.format(model="equidistant", last="0.0"))
    camera = load_calibration(path).cameras[0].camera
    x, y = np.meshgrid(np.linspace(-3.0, 3.0, 31), np.linspace(-2.5, 2.5, 31))
    theta = np.arctan(np.hypot(x, y))
    k1, k2, k3, k4 = camera.coefficients
    t2 = theta * theta
    scale = (
        theta * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)))) / np.maximum(np.hypot(x, y), 1e-9)
    )
    expected = np.stack(
        (x * scale * 285.6466979980469 + 424.5740051269531,
         y * scale * 286.68499755859375 + 408.1993103027344), axis=-1,
    )  # fmt: skip
    seen = camera.pixel_from_ray(np.stack((x, y, np.ones_like(x)), axis=-1))
    assert np.abs(seen.positions_px - expected).max() < 1e-9
    path.write_text(T265.format(model="equidistant", last="0.1"))
    with pytest.raises(CalibrationError, match="D: expected 4 numbers: k1, k2, k3, k4"):
        load_calibration(path)
    path.write_text(T265.format(model="plumb_bob", last="0.0"))
    with pytest.warns(NoticeWarning, match="early RealSense drivers .* write equidistant"):
        load_calibration(path)


@pytest.mark.parametrize(
    ("file", "tool"),
    [
        ("kalibr_tum_vi.yaml", "Kalibr"), ("kalibr_openvins.yaml", "OpenVINS"),
        ("euroc_sensor.yaml", "EuRoC's data set"), ("ros_echo.yaml", "ros2 topic echo"),
        ("camera_info.yaml", "ROS's camera_calibration"), ("kitti360_image_02.yaml", "KITTI-360"),
        ("transforms.json", "Nerfstudio"),
    ],
)  # fmt: skip
def test_a_file_tells_the_tool_that_it_is_from(file, tool, tmp_path):
    calibration = load_calibration(FOLDER / file)
    assert calibration.tool == tool
    ours = dataclasses.replace(calibration, cameras=calibration.cameras[:1])
    ours.save(tmp_path / "fitted.json", "omnisim")
    assert load_calibration(tmp_path / "fitted.json").tool == "omnisim"
