"""Faults of files: file, key, expected and actual value in one line, and remedies for others."""

import json
import re
import signal

import numpy as np
import pytest
import yaml

from omnisim.cameras.calibration import fit, load_calibration
from omnisim.core.errors import CalibrationError
from tests.cameras.calibration.sample_files import FOLDER

BAD = [
    ("kalibr_tum_vi.yaml", "camera_model: pinhole", "camera_model: fisheye",
     "cam0: camera_model: expected one of pinhole, omni, ds, eucm, got 'fisheye'"),
    ("kalibr_tum_vi.yaml", "distortion_model: equidistant", "distortion_model: equi",
     "cam0: distortion_model with pinhole: expected one of radtan, equidistant, .*, got 'equi'"),
    ("kalibr_tum_vi.yaml", "[190.97847715128717, ", "[",
     r"cam0: intrinsics: expected 4 numbers: fu, fv, pu, pv, got \[190\.9"),
    ("kalibr_tum_vi.yaml", "190.97847715128717,", "'190.97847715128717',",
     r"cam0: intrinsics\.0: expected a number.*, got '190.97847715128717'"),
    ("kalibr_tum_vi.yaml", "  resolution: [512, 512]\n", "", "cam0: resolution: missing"),
    ("kalibr_tum_vi.yaml", "resolution: [512, 512]", "resolution: [512, 512.5]",
     "resolution.1: expected a whole number from 1 to 32768.*, got 512.5"),
    ("kalibr_tum_vi.yaml", "resolution: [512, 512]", "resolution: [512, 32769]",
     "resolution.1: expected a whole number from 1 to 32768.*, got 32769"),
    ("kalibr_tum_vi.yaml", "resolution: [512, 512]", "resolution: [51, 51]",
     r"cam0: center: expected in or near the image of 51 × 51 px, got \(254\.932, 256\.897\)"),
    ("kalibr_tum_vi.yaml", "254.93170605935475", ".nan",
     "intrinsics.2: expected a finite number.*, got nan"),
    ("kalibr_tum_vi.yaml", "[0.0, 0.0, 0.0, 1.0]", "[0.0, 0.0, 0.0, 2.0]",
     "cam0: T_cam_imu: expected a rotation and a translation"),
    ("kalibr_tum_vi.yaml", "cam1:", "cam0:", "not YAML in line 15: duplicate key 'cam0'"),
    ("kalibr_models.yaml", "intrinsics: [-0.2, 0.6,", "intrinsics: [-0.2, 1.6,",
     "cam1: alpha: expected a number ≤ 1, got 1.6"),
    ("kalibr_models.yaml", "intrinsics: [1.6,", "intrinsics: [-1.6,",
     "cam0: xi: expected a number ≥ 0, got -1.6"),
    ("kalibr_models.yaml", "intrinsics: [0.6, 1.1,", "intrinsics: [0.6, -1.1,",
     "cam2: beta: expected a number > 0, got -1.1"),
    ("kitti360_image_02.yaml", "model_type: MEI", "model_type: SCARAMUZZA",
     "model_type: expected one of MEI, PINHOLE, KANNALA_BRANDT, got 'SCARAMUZZA'"
     ".*: pass calib_results.txt"),
    ("kitti360_image_02.yaml", "mirror_parameters:\n   xi: 2.2134047507854890e+00\n", "",
     "mirror_parameters: missing"),
    ("kitti360_image_02.yaml", "   k2: ", "   k3: 0.1\n   k2: ",
     "distortion_parameters.k3: unknown key"),
    ("kitti360_image_02.yaml", "   p2: 4.2462134260997584e-04", "   p2: -1e300",
     "distortion.3: expected a number ≥ -1e"),
    ("woodscape_fv.json", '"poly_order": 4', '"poly_order": 5',
     "intrinsic: poly_order: expected 4, got 5"),
    ("gazebo.sdf", "<horizontal_fov>", "<distortion><k1>0.1</k1></distortion><horizontal_fov>",
     "fisheye: distortion/k1: expected 0, .* got 0.1"),
    ("opencv_fisheye.yaml", "rows: 4", "rows: 5",
     "distortion_coefficients: expected 5 × 1 numbers, got 4"),
    ("opencv_fisheye.yaml", "fisheye_model: 1\n", "",
     "distortion_coefficients: 4 numbers, of a fisheye or of a pinhole camera: pass --format"),
    ("opencv_fisheye.yaml", "camera_matrix:", "intrinsics:", "camera_matrix: missing"),
    ("ocamcalib.txt", "5 -2.1", "6 -2.1",
     "line 3: polynomial: expected 6 numbers, got 5"),
    ("ocamcalib.txt", "-2.100075968610522e+02", "2.100075968610522e+02",
     "polynomial: expected coefficients with a0 < 0, got .210\\.0"),
    ("ocamcalib.txt", "480 640", "480", "line 19: image size: expected 2 numbers, got 1"),
    ("ocamcalib.txt", "0.999958", "1,0",
     "line 15: affine parameters: expected a number, got '1,0'"),
    ("basalt_tum_vi_ds.json", '"ds"', '"ds2"',
     "camera_type: expected one of pinhole, ucm, .* got 'ds2'"),
    ("basalt_tum_vi_ds.json", '"xi": -0.172131', '"k1": -0.172131',
     "intrinsics: expected fx, fy, cx, cy, xi, alpha, got 'fx, fy, cx, cy, k1, alpha'"),
    ("basalt_tum_vi_ds.json", '"fx": 158.28600', '"fx": "158.28600"',
     "intrinsics.fx: expected a number.*, got '158.28600'"),
    ("basalt_tum_vi_ds.json", '"value0": {', '"value0": {"intrinsics": [],',
     "not JSON: duplicate key 'intrinsics'"),
    ("colmap_cameras.txt", "SIMPLE_RADIAL 3072", "MODEL_T 3072",
     "line 4: MODEL: expected one of SIMPLE_PINHOLE, .* got 'MODEL_T'"),
    ("colmap_cameras.txt", "2560.56 2560.56 1536 1152", "2560.56 2560.56 1536",
     r"line 5: PINHOLE: expected 4 numbers: fx, fy, cx, cy, got \[2560\.56, "),
    ("colmap_cameras.txt", "2560.56 2560.56 1536 1152", "2560.56 2560.56 1536 nan",
     "line 5: expected a number, got 'nan'"),
    ("colmap_cameras.txt", "2048 1024 2048 1024", "2048 1024 2048 1000",
     r"line 9: EQUIRECTANGULAR: expected the image's 2048 1024, got \[2048.0, 1000.0\]"),
    ("colmap_cameras.txt", "2 PINHOLE", "1 PINHOLE",
     "expected different names, got two cameras '1'"),
    ("transforms.json", '"OPENCV_FISHEYE"', '"ORTHOPHOTO"',
     "camera_model: expected one of PINHOLE, .* got 'ORTHOPHOTO'"),
    ("transforms.json", '"fl_x": 1072.0,', "", "fl_x: missing"),
    ("transforms.json", '"fl_x": 1072.0,', '"camera_angle_x": 9,',
     "camera_angle_x: expected more than 0 and less than π, got 9"),
    ("transforms.json", "[0.0, 0.0, -1.0, -2.0]", "[0.0, 0.0, -2.0, -2.0]",
     "frames.0: transform_matrix: expected a rotation"),
    ("woodscape_fv.json", '"k1": 339.749', '"k1": -339.749',
     "intrinsic: coefficients_px: expected numbers, .* got .-339\\.749"),
    ("woodscape_fv.json", '"aspect_ratio": 1.0', '"aspect_ratio": 0.0',
     "intrinsic: aspect_ratio: expected a number ≥ 0.1, got 0"),
    ("woodscape_fv.json", "0.5946970238045494, ", "",
     "extrinsic: quaternion: expected 4 numbers: x, y, z, w"),
    ("gazebo.sdf", "<type>stereographic</type>", "<type>stereo</type>",
     "stereographic: lens/type: expected one of gnomonical, .* got 'stereo'"),
    ("gazebo.sdf", "<fun>tan</fun>", "<fun>cot</fun>",
     "fisheye: fun: expected one of sin, tan, id, got 'cot'"),
    ("gazebo.sdf", "<c2>4</c2>", "<c2>four</c2>",
     "custom_function/c2: expected a number, got 'four'"),
    ("gazebo.sdf", '<?xml version="1.0"?>', '<!DOCTYPE a [<!ENTITY b "c">]>',
     "expected XML without entities of its own, got a DOCTYPE"),
    ("gazebo.sdf", "</sdf>", "", "not XML: no element found"),
    ("camera_info.yaml", "plumb_bob", "thin_prism",
     "distortion_model: expected one of plumb_bob, rational_polynomial, .* got 'thin_prism'"),
    ("camera_info.yaml", "distortion_model: plumb_bob\n", "", "distortion_model: missing"),
    ("camera_info.yaml", "image_width", "width", "image_width: missing"),
    ("foxglove.json", '"kannala_brandt"', '"fisheye62"', "D: expected 8 numbers: k0, k1"),
    ("ros_echo.yaml", "equidistant", "fisheye62", "got 'fisheye62': Foxglove's alone"),
    ("foxglove.json", '"K": [330.5, 0.0', '"K": [330.5, -0.9', "K: expected no skew, got -0.9"),
    ("foxglove.json", "-0.0003]", "-0.0003, 1.0]", "D: expected 4 numbers: k1, k2, k3, k4, got"),
    ("colmap_cameras.txt", "6 EQUIRECTANGULAR 2048", "6 DIVISION 2048",
     "DIVISION: expected 5 numbers: fx, fy, cx, cy, k"),
    ("colmap_cameras.txt", "SIMPLE_RADIAL ", "SIMPLE_RADAIL ", "did you mean 'SIMPLE_RADIAL'"),
    ("basalt_tum_vi_ds.json", '"ds"', '"pinhole-radtan8"',
     "intrinsics: expected fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6, rpmax"),
    ("nurec.json", "[0.0, 473.6", "[0.5, 473.6",
     "angle_to_pixeldist_poly: expected 0 and then coefficients"),
    ("nurec.json", '"ANGLE_TO_PIXELDIST"', '"ANGLE"',
     "reference_poly: expected one of PIXELDIST_TO_ANGLE"),
    ("nurec.json", '"ftheta"', '"opencv-fisheye"', "camera_model.type: expected one of ftheta"),
    ("nurec.json", "0.9997570514678955", "-0.9997570514678955", "affine: expected c, d, e with c"),
    ("nurec.json", 'parameters": null', 'parameters": {"a": 1}',
     "the windshield bends rays before the lens"),
    ("isaac_ftheta.usda", "k1 = 0.00205", 'k1 = "a"', "ftheta:k1: expected a number, got 'a'"),
    ("isaac_ftheta.usda", "(970.9424, 600.3748)", "970.9424",
     "ftheta:opticalCenter: expected two numbers, got 970.9424"),
    ("isaac_ftheta.usda", "k0 = 0", "k0 = 0.5", "omnisim has no f-theta lens with k0 = 0.5"),
    ("isaac_ftheta.usda", '"ftheta"', '"lut"', "omnisim has no model lut"),
    ("isaac_ftheta.usda", "(1.5, 0.25, 1.125, 1)", "(1.5, 0.25, 1.125)",
     "xformOp:transform: expected 4 × 4 numbers"),
    ("isaac_ftheta.usda", "(0, -1, 0, 0)", "(0, -2, 0, 0)", "xformOp:transform: "),
    ("isaac_ftheta.usda", "(970.9424, 600.3748)", "(970.9424, 600.3748",
     "line 18: expected a value, got"),
    ("basalt_radtan8.json", "1.375", "-1.375", "rpmax: expected a number ≥ 0, got -1.375"),
    ("ros_fisheye.yaml", "camera_model: fisheye\n",
     "camera_model: fisheye\ndistortion_model: plumb_bob\n", "a fisheye's, as camera_model"),
    ("orbslam3_tum_vi.yaml", '"KannalaBrandt8"', '"KannalaBrandt"',
     "Camera.type: expected one of PinHole, KannalaBrandt8, Rectified, .*did you mean"),
    ("orbslam3_tum_vi.yaml", "Camera2.k4: 0.0003299517423931039\n", "", "Camera2.k4: missing"),
    ("orbslam3_tum_vi.yaml", "Camera.width: 512\nCamera.height: 512\n", "",
     "Camera.width, Camera.height: missing, as in settings of ORB-SLAM2"),
    ("orbslam3_tum_vi.yaml", "data: [0.999999", "data: [0.9", "Stereo.T_c1_c2: expected a rota"),
    ("orbslam3_old.yaml", "-0.06, 0.0, 0.0, 1.0, 0.01,", "", "Tbc: expected 4 × 4 numbers"),
    ("gyroflow.json", '"w": 2704', '"w": 0', "calib_dimension.w: expected"),
    ("gyroflow.json", '"distortion_coeffs": [', '"distortion_coeffs": [0.1,',
     "distortion_coeffs: expected 4 numbers"),
    ("gyroflow.json", '"distortion_model": null', '"distortion_model": "gopro_superview"',
     "distortion_model = 'gopro_superview': another lens model: calibrate with OpenCV's"),
    ("camera_models.json", '"fisheye_opencv",', '"fisheye63",', "expected one of perspective"),
    ("camera_models.json", '"focal_x": 0.6868,', "", "0.6666: focal_x: missing"),
    ("camera_models.json", '"k1": -0.0571', '"k1": "-0.0571"', "k1: expected a number, got '-"),
    ("camera_models.json", '"height": 2688', '"height": 2700', "expected an image of 2 : 1, got"),
    ("metashape.xml", "<projection>frame", "<projection>frames", "expected one of frame, fisheye"),
    ("metashape.xml", "<f>3713.29</f>", "<f>x</f>", "calibration: f: expected a number"),
    ("metashape.xml", "<f>3713.29</f>", "<fx>3713.29</fx>", "f: missing: a file of PhotoScan"),
    ("metashape.xml", "<width>5280</width>", "", "width, height: missing"),
    ("aria.json", '"FisheyeRadTanThinPrism"', '"Fisheye63"', "left: Projection: Name: expected"),
    ("aria.json", '"Label": "camera-slam-left"', '"Label": "front"', "front: ConfigData: expected"),
    ("insta360.txt", "113_2.0", "2.0", "offset_v3, 40 numbers of 2 lenses, got '39: "),
    ("insta360.txt", "2_2.000", "2_-2.000", "lens0: xi: expected a number ≥ 0, got -2"),
    ("matlab_fisheye.json", "[880.25, ", "[", "MappingCoefficients: expected 4 numbers: a0, a2"),
    ("matlab_fisheye.json", "-0.0004, 1]", "-0.0004, 2]", "StretchMatrix: expected"),
    ("matlab_pinhole.json", '"K": [[714', '"C": [[714', "K: missing"),
    ("sfm_data.json", '"focal_length": 1791.25,', "", r"intrinsics.1: expected focal_length, .*"),
    ("sfm_data.json", '"fisheye": [0.0241,', '"fisheye": [', "fisheye: expected 4 numbers: k1"),
    ("sfm_data.json", '{"key": 0, "value": {"polymorphic_id": 2147483649', '{"value": {"id": 1',
     "intrinsics: expected cereal's list"),
]  # fmt: skip
# Texts that are no calibration, and a part of the message: many are other tools' files.
OTHERS = {
    "fc = [ 600.1 ; 600.2 ];\ncc = [ 320 ; 240 ];\n": "this is MATLAB's calibration: write",
    "%YAML:1.0\nCamera.fx: 190.97\n": "Camera.width, Camera.height: missing, as in settings of ORB",
    "%YAML:1.0\nrelative_config_imucam: 'chain.yaml'\n": "relative_config_imucam: /",
    "%YAML:1.0\ncam0_calib: left.yaml\n": "cam0_calib: /",
    "%YAML:1.0\ncam0_calib: 3\n": "cam0_calib: expected the name of a file, got 3",
    "imu0:\n  accelerometer_noise_density: 0.002\n": "this is an IMU's parameters: pass the file",
    '{"value0": {"config.optical_flow_type": "patch"}}': "this is Basalt's settings: pass the",
    '{"CalibrationInformation": {"Cameras": [{"Intrinsics": {"ModelParameters": [0.5]}}]}}':
        "this is a headset's calibration (Windows Mixed Reality): write its numbers",
    "calib_time: 2012\nS_00: 1392 512\nK_00: 984 0 690\n": "KITTI's calib_cam_to_cam.txt: write",
    b"\x1f\x8b\x08\x00": "got an archive: extract it, and pass the file or folder",
    "sensor_type: camera\ncamera_model: omni\nintrinsics: []\nresolution: [9, 9]\n"
    "distortion_model: omni\n": "got 'omni': its polynomial is that of OCamCalib: pass calib_res",
    "target_type: aprilgrid\ntagCols: 6\n": "this is Kalibr's target: pass it as --board",
    "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n": "pass the cameras.txt beside it",
    '{"asset": {"version": "2.0"}, "cameras": []}': "this is a glTF scene: pass it as the scene",
    "#usda 1.0\n": "this is a USD scene: pass it as the scene",
    "mtllib a.mtl\nv 0 0 0\n": "this is an OBJ scene: pass it as the scene",
    "<robot name='a'/>": "this is a scene or a robot: pass it as the scene",
    "MATLAB 5.0 MAT-file\0": "got MATLAB's data without a structure of numbers: write it as JSON",
    "glTF\2\0": "got a scene: pass it as the scene",
    "cam0:\n\tcamera_model: pinhole\n\tintrinsics: [1]\n":
        "not YAML in line 2: expected spaces, got a tab",
    "": "got an empty one",
    " \n\n": "got an empty one",
    b"\x89PNG\r\n\x1a\n\x00\x00": "got an image: `omnisim calibration convert`",
    b"\xff\xd8\xff\xe0\x00": "got an image: `omnisim calibration convert`",
    b"\x00\xff": "got no text in UTF-8",
    "hello\n": "expected a calibration in one of the formats omnisim, euroc",
    "[lens]\nmodel = 'x'\n": "this looks like a sensor file",
    "a: &a [*a]\n": "expected a calibration in one of",
}  # fmt: skip


def _message(path, *arguments, **keywords):
    with pytest.raises(CalibrationError) as caught:
        load_calibration(path, *arguments, **keywords)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(("name", "old", "new", "words"), BAD)
def test_faults_name_file_key_and_value(name, old, new, words, tmp_path):
    text = (FOLDER / name).read_text()
    assert old in text
    (tmp_path / name).write_text(text.replace(old, new, 1))
    message = _message(tmp_path / name)
    assert re.search(rf"{name}: (line|\w|\[).*", message)
    assert re.search(words, message)


@pytest.mark.parametrize(("content", "words"), OTHERS.items(), ids=range(len(OTHERS)))
def test_files_that_are_no_calibration(content, words, tmp_path):
    path = tmp_path / "file.yaml"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    message = _message(path)
    assert message.startswith(f"{path}: ")
    assert words in message


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("image_width: 4\nimage_height: 4\ncamera_name: a\n", "; not ros: no camera_matrix"),
        (
            "cam0:\n  intrinsics: [1, 2, 3, 4]\n  resolution: [2, 3]\n",
            "; not kalibr: no camera_model",
        ),
        ("camera_matrix: [[1, 0, 0]]\ndist_coeffs: [0]\n", "; not opencv: no !!opencv-matrix"),
        ('{"image_width": 4, "camera_matrix": {"data": [1]}}', "; not ros: JSON, not YAML"),
        ("<camera><image><width>3</width></image></camera>", "; not gazebo: no lens"),
    ],
)
def test_an_unknown_file_says_why_the_nearest_formats_are_not_its_own(text, reason, tmp_path):
    path = tmp_path / "file"
    path.write_text(text)
    message = _message(path)
    assert reason in message
    assert message.count("; not ") <= 3


@pytest.mark.parametrize(
    ("file", "format", "camera", "words"),
    [
        ("colmap_cameras.txt", "kalibr", None, "looks like a colmap file .*pass --format colmap"),
        ("colmap_cameras.txt", "Kalbr", None, "format 'Kalbr': did you mean 'kalibr'"),
        ("colmap_cameras.txt", "opencv", None, "'opencv_omnidir' or 'opencv_.*' or 'opencv_"),
        ("colmap_cameras.txt", "word", None, "format 'word': expected one of omnisim, euroc"),
        ("colmap_cameras.txt", None, "cam0", "expected one of 1, 2, 3, .* got 'cam0'"),
        ("nothing.yaml", None, None, r"nothing\.yaml: cannot be read: No such file"),
        (".", None, None, "expected a calibration file, or KITTI-360's folder"),
    ],
)
def test_a_file_of_another_format_is_named(file, format, camera, words):
    assert re.search(words, _message(FOLDER / file, format, camera))


def test_yaml_in_other_styles_is_read(tmp_path):
    plain = FOLDER / "kalibr_tum_vi.yaml"
    text, cameras = plain.read_text(), yaml.safe_load(plain.read_text())
    styles = {
        "quoted": "".join(f'"{name}": {json.dumps(table)}\n' for name, table in cameras.items()),
        "crlf": "\ufeff" + text.replace("\n", "\r\n"),
        "yaml-1.2": text.replace("0.0034823894022493434", "34823894022493434e-19"),
    }
    known = load_calibration(plain).cameras
    for name, style in styles.items():
        (tmp_path / name).write_bytes(style.encode())
        found = load_calibration(tmp_path / name).cameras
        assert [one.camera for one in found] == [one.camera for one in known], name


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [
        (r'<camera name="[^"]*"', '<camera name="eye"', ["fisheye", "stereographic", "pinhole"]),
        (r' name="[^"]*"', "", ["camera0", "camera1", "camera2"]),
        (r' name="[^"]*"', ' name="eye"', ["camera0", "camera1", "camera2"]),
    ],
)
def test_gazebo_cameras_get_distinct_names(old, new, names, tmp_path):
    text = re.sub(old, new, (FOLDER / "gazebo.sdf").read_text())
    (tmp_path / "a.sdf").write_text(text)
    assert load_calibration(tmp_path / "a.sdf").names == names


def _aliases(levels, opening, item, closing):
    """A YAML text whose aliases make it nine times larger at each level."""
    lines = [f"a0: &a0 {opening}{item.format(0)}{closing}"]
    for level in range(1, levels):
        inner = ", ".join(item.format(f"*a{level - 1}").replace("#", str(at)) for at in range(9))
        lines.append(f"a{level}: &a{level} {opening}{inner}{closing}")
    return "\n".join(lines) + f"\ncam0:\n  camera_model: pinhole\n  intrinsics: *a{levels - 1}\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (_aliases(8, "[", "{}", "]"), "expected plain values, got aliases that grow"),
        (_aliases(8, "{{", "k#: {}", "}}"), "expected plain values, got aliases that grow"),
        ("model_type: &a [*a]\n", "expected plain values, got aliases that grow"),
        (
            "model_type: " + "[" * 5000 + "]" * 5000 + "\n",
            "expected plain values, got values nested",
        ),
        (
            '{"fl_x": ' + "[" * 200_000 + "]" * 200_000 + "}",
            "expected plain values, got values nested",
        ),
        ('{"fl_x": ' + "9" * 5000 + "}", "expected a camera's numbers, got one of thousands"),
        ("model_type: " + "9" * 5000 + "\n", "expected a camera's numbers, got one of thousands"),
    ],
)
def test_files_that_grow_without_bound_are_refused(text, words, tmp_path):
    (tmp_path / "bomb.yaml").write_text(text.replace("{{", "{").replace("}}", "}"))
    assert re.search(rf"bomb\.yaml: not (YAML|JSON): {words}", _message(tmp_path / "bomb.yaml"))


@pytest.fixture
def ends_hangs():
    """Failure of a test after a minute of its processor's time, whatever else runs beside it."""

    def fail(number, frame):
        pytest.fail("hangs")

    before = signal.signal(signal.SIGPROF, fail)
    signal.setitimer(signal.ITIMER_PROF, 60.0)  # a tenth of one; minutes by the length's square
    yield
    signal.setitimer(signal.ITIMER_PROF, 0.0)
    signal.signal(signal.SIGPROF, before)


@pytest.mark.parametrize(
    "text",
    ["\n" * 200_000 + "x: 1", '{"fl_x": 0' + ',"k": 0' * 60_000 + "}"],
    ids=["lines", "keys"],
)
def test_a_long_file_does_not_hang(text, tmp_path, ends_hangs):
    (tmp_path / "long").write_text(text)
    with pytest.raises(CalibrationError):
        load_calibration(tmp_path / "long")


def test_lens_of_another_model_states_its_residuals(monkeypatch):
    monkeypatch.setattr(fit, "_refined", lambda start, *arguments: (start, np.eye(3)))
    calibration = load_calibration(FOLDER / "kalibr_fov.yaml")
    (note,) = calibration.notes
    assert note.startswith("omnisim has no model fov: read as kannala_brandt, RMS")
