"""Calibrations of SLAM programs and of ROS: rigs in one file, in several files, and in messages."""

import dataclasses
import re
import shutil
import warnings

import numpy as np
import pytest
import yaml

from omnisim.cameras import KannalaBrandtCamera, RationalPolynomialCamera, UnifiedCamera
from omnisim.cameras.calibration import Calibration, calibration_text, load_calibration
from omnisim.cameras.calibration.calibrated_camera import CalibratedCamera, NamedPose
from omnisim.cameras.calibration.calibration import Rig
from omnisim.core.errors import CalibrationError, NoticeWarning
from omnisim.core.poses import inverse, pose
from tests.cameras.calibration.sample_files import FOLDER

LEFT = KannalaBrandtCamera(640, 480, (330.5, 331.25), (319.25, 240.75), (0.03, 0.005, 6e-4, -1e-4))
RIGHT = KannalaBrandtCamera(640, 480, (331.5, 332.0), (318.0, 241.5), (0.03, 0.005, 6e-4, -1e-4))
LEFT_FROM_RIGHT = pose((0.12, 0.002, -0.001), roll_deg=0.5, pitch_deg=1.0, yaw_deg=-0.7)
IMU_FROM_LEFT = pose((0.02, -0.06, 0.01), roll_deg=90.0, yaw_deg=30.0)


def stereo():
    """Pair of cameras on an IMU, with a time shift."""
    on_imu = (NamedPose("imu", "cam0", IMU_FROM_LEFT),)
    on_left = (NamedPose("cam0", "cam1", LEFT_FROM_RIGHT),)
    left = CalibratedCamera("cam0", LEFT, on_imu, time_shift_s=0.0125)
    return Calibration((left, CalibratedCamera("cam1", RIGHT, on_left, time_shift_s=0.0125)))


def left_from_right(calibration, left=0, right=1):
    """Pose of a camera of a calibration in another's frame."""
    first, second = (Rig.of(calibration).cameras[index] for index in (left, right))
    return inverse(first.body_from_camera) @ second.body_from_camera


def quiet(path):
    """Calibration of a file without its warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NoticeWarning)
        return load_calibration(path)


def rewritten(name, tmp_path, *changes):
    """Calibration of a sample with changes of its text."""
    text = (FOLDER / name).read_text()
    for old, new in changes:
        assert re.search(old, text)
        text = re.sub(old, new, text)
    (tmp_path / name).write_text(text)
    return quiet(tmp_path / name)


# ORB-SLAM3


def test_orb_slam3s_poses_are_those_of_the_chain():
    calibration = load_calibration(FOLDER / "orbslam3_tum_vi.yaml")
    rig = Rig.of(calibration)
    first, second = (camera.body_from_camera for camera in rig.cameras)
    assert rig.body == "imu"
    # published by the data set: T_cam_imu of its camchain
    camera_from_imu = [
        [-0.9995250378696743, 0.029615343885863205, -0.008522328211654736, 0.04727988224914392],
        [0.0075019185074052044, -0.03439736061393144, -0.9993800792498829, -0.047443232143367084],
        [-0.02989013031643309, -0.998969345370175, 0.03415885127385616, -0.0681999605066297],
        [0.0, 0.0, 0.0, 1.0],
    ]
    np.testing.assert_allclose(first, inverse(np.array(camera_from_imu)), atol=1e-12)
    assert np.linalg.norm(first[:3, 3] - second[:3, 3]) == pytest.approx(0.10108, abs=1e-5)
    assert calibration.notes == [
        "Camera2: ORB-SLAM3 itself takes k1, k2, k3 and k4 of Camera1 for both lenses"
    ]


def test_both_versions_of_orb_slam3s_settings_are_alike(tmp_path):
    new = quiet(FOLDER / "orbslam3_tum_vi.yaml")
    changes = [
        (r'File.version: "1.0"\n', ""), (r"Camera1\.", "Camera."), (r"IMU.T_b_c1", "Tbc"),
        (r"Stereo.T_c1_c2", "Tlr"), (r"Stereo.ThDepth", "ThDepth"),
        (r"(0.001015350132563),\s*0.0, 0.0, 0.0, 1.0", r"\1"),  # three rows
    ]  # fmt: skip
    old = rewritten("orbslam3_tum_vi.yaml", tmp_path, *changes)
    for before, after in zip(new.cameras, old.cameras, strict=True):
        assert after.camera == before.camera
        for first, second in zip(before.poses, after.poses, strict=True):
            np.testing.assert_array_equal(first.target_from_source, second.target_from_source)


def test_a_baseline_is_that_of_a_second_rectified_camera(tmp_path):
    rig = Rig.of(load_calibration(FOLDER / "orbslam3_old.yaml"))
    first, second = rig.cameras
    assert first.model == second.model
    found = inverse(first.body_from_camera) @ second.body_from_camera
    np.testing.assert_allclose(found, pose((47.905 / 435.5, 0.0, 0.0)), atol=1e-15)
    depth = rewritten("orbslam3_old.yaml", tmp_path, ("ThDepth:", "DepthMapFactor: 5000.0\nThD:"))
    assert depth.names == ["Camera1"]
    assert any("DepthMapFactor = 5000.0 is not read" in note for note in depth.notes)
    changes = [("PinHole", "Rectified"), (r"Camera\.[kp][12].*\n", "")]
    rectified = rewritten("orbslam3_old.yaml", tmp_path, *changes)
    assert rectified.names == ["Camera1", "Camera2"]
    assert rectified.notes == []
    # OpenCV reads keys without a space, which some of the examples have
    tight = rewritten("orbslam3_old.yaml", tmp_path, ("PointSize: 2", "PointSize:2"),
                      ("data: ", "data:"), ("Camera.cx: ", "Camera.cx:"))  # fmt: skip
    assert [one.camera for one in tight.cameras] == [first.model, second.model]


def test_contradicting_and_spare_baselines_are_named(tmp_path):
    name = "orbslam3_tum_vi.yaml"
    calibration = rewritten(name, tmp_path, ("Stereo.ThDepth", "Stereo.b: 0.2\nStereo.ThDepth"))
    assert any("states a baseline of 0.2 m, its pose one of 0.1011 m" in note
               for note in calibration.notes)  # fmt: skip
    calibration = rewritten(name, tmp_path, (r"Camera2\..*\n", ""))
    assert calibration.notes == [
        "the pose or baseline of a second camera is not read: there is no Camera2"
    ]


RAW = """
{name}.height: 480
{name}.width: 752
{name}.K: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data:{k}
{name}.D: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data:[-0.28, 0.07, 0.0002, 0.00002, 0.0]
{name}.R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: {r}
{name}.P: !!opencv-matrix
   rows: 3
   cols: 4
   dt: d
   data: {p}
"""


def rectification():
    """R and P of a pair by OpenCV, for each camera, from its K and the pair's pose."""
    cv2 = pytest.importorskip("cv2", reason="OpenCV is the oracle")
    matrices = [np.array([[458.0, 0, 367.0], [0, 457.0, 248.0], [0, 0, 1.0]]),
                np.array([[457.0, 0, 380.0], [0, 456.0, 255.0], [0, 0, 1.0]])]  # fmt: skip
    d = np.array([-0.28, 0.07, 0.0002, 0.00002, 0.0])
    right_from_left = inverse(LEFT_FROM_RIGHT)
    r1, r2, p1, p2, *_ = cv2.stereoRectify(
        matrices[0], d, matrices[1], d, (752, 480), *np.hsplit(right_from_left[:3], [3]),
        flags=cv2.CALIB_ZERO_DISPARITY, alpha=0,
    )  # fmt: skip
    return list(zip(matrices, (r1, r2), (p1, p2), strict=True))


def numbers(matrix):
    return str(matrix.ravel().tolist())


def test_cameras_before_rectification_have_opencvs_pose(tmp_path):
    parts = rectification()
    text = (FOLDER / "orbslam3_old.yaml").read_text()
    text = re.sub(r"Camera\.[kp][12].*\n", "", text)
    p = parts[1][2].tolist()
    for key, value in (("fx", p[0][0]), ("fy", p[1][1]), ("cx", p[0][2]), ("cy", p[1][2]),
                       ("bf", -p[0][3])):  # fmt: skip
        text = re.sub(rf"Camera\.{key}: .*", f"Camera.{key}: {value!r}", text)
    for name, (k, r, projection) in zip(("LEFT", "RIGHT"), parts, strict=True):
        values = {"k": numbers(k), "r": numbers(r), "p": numbers(projection)}
        text += RAW.format(name=name, **values)
    (tmp_path / "a.yaml").write_text(text)
    calibration = load_calibration(tmp_path / "a.yaml")
    assert calibration.names == ["Camera1", "Camera2", "LEFT", "RIGHT"]
    np.testing.assert_allclose(left_from_right(calibration, 2, 3), LEFT_FROM_RIGHT, atol=1e-12)
    np.testing.assert_allclose(
        left_from_right(calibration, 0, 1), pose((-p[0][3] / p[0][0], 0.0, 0.0)), atol=1e-12
    )
    (tmp_path / "a.yaml").write_text(re.sub(r"Camera\.cx: .*", "Camera.cx: 300.5", text))
    with pytest.warns(NoticeWarning, match=r"LEFT\.P: expected fx, cx, fy, cy of Camera"):
        load_calibration(tmp_path / "a.yaml")


def test_opencv_reads_the_settings_that_we_write(tmp_path):
    cv2 = pytest.importorskip("cv2", reason="OpenCV is the oracle")
    calibration = stereo()
    calibration.save(tmp_path / "a.yaml", "orbslam3")
    file = cv2.FileStorage(str(tmp_path / "a.yaml"), cv2.FILE_STORAGE_READ)
    found = file.getNode("Stereo.T_c1_c2").mat()
    assert found.dtype == np.float32  # as ORB-SLAM3 takes it
    np.testing.assert_allclose(found, LEFT_FROM_RIGHT, atol=1e-7)
    np.testing.assert_allclose(file.getNode("IMU.T_b_c1").mat(), IMU_FROM_LEFT, atol=1e-7)
    assert file.getNode("Camera.fps").isInt()
    assert file.getNode("Camera2.k1").real() == RIGHT.coefficients[0]
    again = load_calibration(tmp_path / "a.yaml")
    assert [one.camera for one in again.cameras] == [LEFT, RIGHT]
    np.testing.assert_allclose(left_from_right(again), LEFT_FROM_RIGHT, atol=1e-15)


def test_orb_slam3_takes_two_alike_cameras_at_most():
    first, second = stereo().cameras
    pinhole = UnifiedCamera(640, 480, (300.0,) * 2, (320.0, 240.0), 0.0, (0.1, 0.0, 0.0, 0.0))
    others = [
        (first, second, CalibratedCamera("cam2", LEFT)),
        (first, CalibratedCamera("cam1", pinhole, second.poses)),
        (first, CalibratedCamera("cam1", RIGHT)),
    ]
    for cameras in others:
        with pytest.raises(CalibrationError, match="orbslam3: expected one camera, or two of one"):
            calibration_text(Calibration(cameras), "orbslam3")


# OpenVINS, OKVIS2, VINS-Fusion, EuRoC, Kimera


@pytest.mark.parametrize("form", ["kalibr", "omnisim", "basalt"])
def test_time_shifts_are_kept(form, tmp_path):
    path = tmp_path / ("a.yaml" if form == "kalibr" else "a.json")
    stereo().save(path, form)
    again = load_calibration(path)
    assert [one.time_shift_s for one in again.cameras] == [0.0125, 0.0125]
    np.testing.assert_allclose(left_from_right(again), LEFT_FROM_RIGHT, atol=1e-12)


def test_basalt_has_one_time_shift():
    first, second = stereo().cameras
    cameras = (first, CalibratedCamera("cam1", RIGHT, second.poses))
    with pytest.raises(CalibrationError, match=r"expected one time shift, got \[0\.0, 0\.0125\] s"):
        calibration_text(Calibration(cameras), "basalt")


def test_openvins_settings_name_their_chain(tmp_path):
    shutil.copy(FOLDER / "kalibr_openvins.yaml", tmp_path / "kalibr_imucam_chain.yaml")
    text = (
        '%YAML:1.0 # the file type\nmax_cameras: 2\nrelative_config_imu: "kalibr_imu_chain.yaml"\n'
    )
    text += 'relative_config_imucam: "kalibr_imucam_chain.yaml"\n'
    (tmp_path / "estimator_config.yaml").write_text(text)
    calibration = load_calibration(tmp_path / "estimator_config.yaml")
    assert calibration.source == str(tmp_path / "kalibr_imucam_chain.yaml")
    assert calibration.cameras[0].time_shift_s == 0.005
    assert (
        calibration.cameras[0].camera
        == load_calibration(FOLDER / "kalibr_openvins.yaml").cameras[0].camera
    )


def test_okvis_settings_are_a_chain(tmp_path):
    eight = [0.1, -0.02, 1e-4, 2e-4, 0.003, 0.05, -0.01, 1e-3]
    cameras = [
        {"T_SC": IMU_FROM_LEFT.ravel().tolist(), "image_dimension": [640, 480],
         "distortion_coefficients": list(LEFT.coefficients), "distortion_type": "equidistant",
         "focal_length": [330.5, 331.25], "principal_point": [319.25, 240.75],
         "camera_type": "gray", "slam_use": "okvis"},
        {"T_SC": (IMU_FROM_LEFT @ LEFT_FROM_RIGHT).ravel().tolist(), "image_dimension": [640, 480],
         "distortion_coefficients": eight, "distortion_type": "radialtangential8",
         "focal_length": [330.5, 331.25], "principal_point": [319.25, 240.75]},
    ]  # fmt: skip
    settings = {"cameras": cameras, "camera_parameters": {"image_delay": 0.002}}
    (tmp_path / "a.yaml").write_text("%YAML:1.0\n" + yaml.safe_dump(settings))
    calibration = load_calibration(tmp_path / "a.yaml")
    first, second = calibration.cameras
    assert first.camera == LEFT
    assert second.camera == RationalPolynomialCamera(
        640, 480, (330.5, 331.25), (319.25, 240.75), tuple(eight)
    )
    assert [first.time_shift_s, second.time_shift_s] == [-0.002, -0.002]
    assert calibration.notes == []
    np.testing.assert_allclose(left_from_right(calibration), LEFT_FROM_RIGHT, atol=1e-12)


MEI = """%YAML:1.0
---
model_type: MEI
camera_name: camera
image_width: 752
image_height: 480
mirror_parameters:
   xi: 0.8
distortion_parameters:
   k1: 0.1
   k2: 0.0
   p1: 0.0
   p2: 0.0
projection_parameters:
   gamma1: {gamma}
   gamma2: {gamma}
   u0: 361.5
   v0: 248.25
"""


def matrix(key, values, rows=4, columns=4):
    data = np.asarray(values).ravel().tolist()
    return (f"{key}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n"
            f"   data: {data}\n")  # fmt: skip


def test_vins_settings_name_a_file_for_each_camera(tmp_path):
    for index, gamma in enumerate((500.0, 501.0)):
        (tmp_path / f"cam{index}_mei.yaml").write_text(MEI.format(gamma=gamma))
    text = '%YAML:1.0\nnum_of_cam: 2\ncam0_calib: "cam0_mei.yaml"\ncam1_calib: "cam1_mei.yaml"\n'
    text += matrix("body_T_cam0", IMU_FROM_LEFT)
    text += matrix("body_T_cam1", IMU_FROM_LEFT @ LEFT_FROM_RIGHT) + "td: 0.01\nfreq: 10\n"
    (tmp_path / "vins.yaml").write_text(text)
    calibration = load_calibration(tmp_path / "vins.yaml")
    assert calibration.names == ["cam0", "cam1"]
    assert [one.camera.focal_lengths_px[0] for one in calibration.cameras] == [500.0, 501.0]
    assert [one.time_shift_s for one in calibration.cameras] == [0.01, 0.01]
    np.testing.assert_allclose(left_from_right(calibration), LEFT_FROM_RIGHT, atol=1e-12)
    (tmp_path / "vins.yaml").write_text(text.replace("num_of_cam: 2", "num_of_cam: 1"))
    assert load_calibration(tmp_path / "vins.yaml").names == ["cam0"]
    bad = MEI.format(gamma=-1.0)
    (tmp_path / "cam1_mei.yaml").write_text(bad + "rolling_shutter: 1\n")
    (tmp_path / "vins.yaml").write_text(text)
    with pytest.raises(CalibrationError, match=r"vins\.yaml: cam1: focal_lengths_px"):
        load_calibration(tmp_path / "vins.yaml")
    (tmp_path / "cam1_mei.yaml").write_text(MEI.format(gamma=501.0) + "rolling_shutter: 1\n")
    with pytest.warns(NoticeWarning, match=r"cam1\.rolling_shutter = 1 is not read"):
        load_calibration(tmp_path / "vins.yaml")


def test_vins_mono_has_the_pose_in_the_cameras_file(tmp_path):
    text = MEI.format(gamma=500.0) + "td: -0.02\n"
    text += matrix("extrinsicRotation", IMU_FROM_LEFT[:3, :3], 3, 3)
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(CalibrationError, match="extrinsicTranslation: expected 3 numbers"):
        load_calibration(tmp_path / "a.yaml")
    (tmp_path / "a.yaml").write_text(text + matrix("extrinsicTranslation", [0.1, 0.2, 0.3], 3, 1))
    (camera,) = load_calibration(tmp_path / "a.yaml").cameras
    assert camera.time_shift_s == -0.02
    expected = IMU_FROM_LEFT.copy()
    expected[:3, 3] = 0.1, 0.2, 0.3
    np.testing.assert_allclose(camera.poses[0].target_from_source, expected, atol=1e-15)


def test_a_folder_of_euroc_is_a_rig(tmp_path):
    for camera, on_imu in zip(
        stereo().cameras, (IMU_FROM_LEFT, IMU_FROM_LEFT @ LEFT_FROM_RIGHT), strict=True
    ):
        folder = tmp_path / "mav0" / camera.name
        folder.mkdir(parents=True)
        on_imu = dataclasses.replace(camera, poses=(NamedPose("imu", camera.name, on_imu),))
        Calibration((on_imu,)).save(folder / "sensor.yaml", "euroc")
    for folder in (tmp_path, tmp_path / "mav0"):
        calibration = load_calibration(folder)
        assert (calibration.format, calibration.names) == ("euroc", ["cam0", "cam1"])
        assert [one.camera for one in calibration.cameras] == [LEFT, RIGHT]
        np.testing.assert_allclose(left_from_right(calibration), LEFT_FROM_RIGHT, atol=1e-12)
    assert load_calibration(tmp_path / "mav0" / "cam1").names == ["cam1"]
    # Kimera's files have names of their own
    for name, side in (("cam0", "left"), ("cam1", "right")):
        text = (tmp_path / "mav0" / name / "sensor.yaml").read_text()
        (tmp_path / f"{side.title()}CameraParams.yaml").write_text(
            text.replace(f'"{name}"', f"{side}_cam").replace("sensor_type: camera\n", "")
        )
    shutil.rmtree(tmp_path / "mav0")
    calibration = load_calibration(tmp_path)
    assert calibration.names == ["left_cam", "right_cam"]
    np.testing.assert_allclose(left_from_right(calibration), LEFT_FROM_RIGHT, atol=1e-12)
    for file in tmp_path.glob("*Params.yaml"):
        file.write_text(file.read_text().replace("left_cam", "cam").replace("right_cam", "cam"))
    with pytest.raises(CalibrationError, match="expected different names, got two cameras 'cam'"):
        load_calibration(tmp_path)


def test_a_rotation_of_rounded_numbers_is_the_nearest_one(tmp_path):
    rounded = pose((0.02, -0.06, 0.01), roll_deg=23.0, pitch_deg=-7.0, yaw_deg=30.0).round(4)
    text = (FOLDER / "euroc_sensor.yaml").read_text()
    data = f"data: {numbers(rounded)}"
    text = re.sub(r"data: \[(.|\n)*?\]", data, text)
    (tmp_path / "a.yaml").write_text(text)
    rotation = load_calibration(tmp_path / "a.yaml").cameras[0].poses[0].target_from_source[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(rotation.T, rounded[:3, :3], atol=1e-4)


# ROS


def echo(k, r, p, frame="left_camera", ros1=False):
    """A message as `ros2 topic echo`, or `rostopic echo`, prints it."""
    d = [-0.28, 0.07, 0.0002, 0.00002, 0.0]
    rows = {"d": d, "k": k.ravel().tolist(), "r": r.ravel().tolist(), "p": p.ravel().tolist()}
    head = f"header:\n  stamp:\n    sec: 17\n    nanosec: 0\n  frame_id: {frame}\n"
    head += "height: 480\nwidth: 752\ndistortion_model: plumb_bob\n"
    if ros1:
        head = (
            head.replace("sec", "secs")
            .replace("nanosecs", "nsecs")
            .replace("stamp", "seq: 1\n  stamp")
        )
        lists = "".join(f"{key.upper()}: {value}\n" for key, value in rows.items())
    else:
        lists = "".join(f"{key}:\n" + "".join(f"- {value!r}\n" for value in row)
                        for key, row in rows.items())  # fmt: skip
    roi = "roi: \n  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n  do_rectify: False\n"
    return head + lists + "binning_x: 0\nbinning_y: 0\n" + roi


@pytest.mark.parametrize("ros1", [False, True])
def test_messages_of_a_pair_are_a_rig(tmp_path, ros1):
    left, right = (echo(*part, ros1=ros1) for part in rectification())
    moved = left.replace("17", "18")
    (tmp_path / "echo.yaml").write_text("---\n".join((left, right, moved, left[:200])))
    calibration = load_calibration(tmp_path / "echo.yaml")
    assert calibration.names == ["left_camera", "left_camera_2"]
    assert Rig.of(calibration).body == "rectified"
    assert calibration.notes == []
    np.testing.assert_allclose(left_from_right(calibration), LEFT_FROM_RIGHT, atol=1e-12)
    (tmp_path / "echo.yaml").write_text(left + "---\n" + moved + "---\n")
    assert load_calibration(tmp_path / "echo.yaml").names == ["left_camera"]


def test_the_first_of_a_rectified_pair_has_a_pose_too(tmp_path):
    (_, _, p1), (_, _, p2) = rectification()
    left, right = (echo(p1[:, :3], np.eye(3), p, name) for name, p in (("l", p1), ("r", p2)))
    (tmp_path / "echo.yaml").write_text(left + "---\n" + right + "---\n")
    found = left_from_right(load_calibration(tmp_path / "echo.yaml"))
    np.testing.assert_allclose(found, pose((-p2[0, 3] / p2[0, 0], 0.0, 0.0)), atol=1e-15)


def ost(name, k, r, p):
    """camera_calibration's ost.txt."""
    blocks = {"camera matrix": k, "distortion": np.array([[-0.28, 0.07, 0.0002, 0.00002, 0.0]]),
              "rectification": r, "projection": p}  # fmt: skip
    text = f"# oST version 5.0 parameters\n\n\n[image]\n\nwidth\n752\n\nheight\n480\n\n[{name}]\n\n"
    for title, rows in blocks.items():
        text += title + "\n" + "\n".join(" ".join(f"{value:8f}" for value in row) for row in rows)
        text += "\n\n"
    return text


def test_ost_txt_is_read(tmp_path):
    parts = rectification()
    names = ("narrow_stereo/left", "narrow_stereo/right")
    text = "".join(ost(name, *part) for name, part in zip(names, parts, strict=True))
    (tmp_path / "ost.txt").write_text(text)
    calibration = load_calibration(tmp_path / "ost.txt")
    assert (calibration.format, calibration.names) == ("ros", [*names])
    first = calibration.cameras[0].camera
    assert first == UnifiedCamera(
        752, 480, (458.0, 457.0), (367.0, 248.0), 0.0, (-0.28, 0.07, 0.0002, 0.00002)
    )
    # six decimals, of focal lengths and rotations
    np.testing.assert_allclose(left_from_right(calibration), LEFT_FROM_RIGHT, atol=1e-5)
    alone = ost("cam", parts[0][0], np.eye(3), np.eye(3, 4))
    four = alone.replace(" 0.000000\n\nrect", "\n\nrect")
    (tmp_path / "ost.ini").write_text(four)
    (camera,) = load_calibration(tmp_path / "ost.ini").cameras
    assert isinstance(camera.camera, KannalaBrandtCamera)
    assert camera.poses == ()
    for old, new, words in (
        ("752", "7x52", "width: expected a number, got '7x52'"),
        ("camera matrix\n458.000000", "camera matrix\n", "camera_matrix: expected 9 numbers"),
        ("distortion", "distortoin", "distortion_coefficients: missing"),
        ("752\n\n", "", "image_width: expected a whole number"),
    ):
        (tmp_path / "ost.ini").write_text(alone.replace(old, new))
        with pytest.raises(CalibrationError, match=words):
            load_calibration(tmp_path / "ost.ini")


def test_the_files_of_a_pair_are_a_rig(tmp_path):
    for (k, r, p), side in zip(rectification(), ("left", "right"), strict=True):
        (tmp_path / "echo.yaml").write_text(echo(k, r, p, f"stereo/{side}"))
        load_calibration(tmp_path / "echo.yaml").save(tmp_path / f"{side}.yaml", "ros")
    calibration = load_calibration(tmp_path)
    assert (calibration.format, calibration.names) == ("ros", ["stereo/left", "stereo/right"])
    np.testing.assert_allclose(left_from_right(calibration), LEFT_FROM_RIGHT, atol=1e-12)
    text, _ = calibration_text(calibration.only("stereo/right"), "foxglove")
    (tmp_path / "a.json").write_text(text)
    (right,) = load_calibration(tmp_path / "a.json").cameras
    np.testing.assert_allclose(
        right.poses[0].target_from_source,
        calibration.camera("stereo/right").poses[0].target_from_source, atol=1e-12,
    )  # fmt: skip


@pytest.mark.parametrize(
    "text",
    ["model_type: MEI\ncam0: 3\n", "k: [1]\ncameras: {a: 1}\ndistortion_model: plumb_bob\n"],
)
def test_other_keys_are_no_joined_files(tmp_path, text):
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(CalibrationError, match=r"(image_width|width): missing"):
        load_calibration(tmp_path / "a.yaml")
