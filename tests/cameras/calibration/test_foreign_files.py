"""Files that are recognized but not read: the line names the tool, and what to pass instead."""

import pytest

from omnisim.cameras.calibration import load_calibration
from omnisim.core.errors import CalibrationError
from tests.cameras.calibration.sample_files import FOLDER

FILES = {
    '{"name": "a", "calib_dimension": {"w": 4, "h": 3}, "distortion_model": "opencv_fisheye"}':
        "this is Gyroflow's lens profile: write its numbers as an opencv_fisheye",
    '{"v2 a 4 3 brown": {"projection_type": "brown", "width": 4, "focal_x": 0.8}}':
        "this is OpenSfM's camera_models.json: write its numbers",
    '{"sfm_data_version": "0.3", "intrinsics": []}': "this is OpenMVG's sfm_data.json: write",
    "<?xml version='1.0'?>\n<calibration>\n  <projection>fisheye</projection>\n</calibration>":
        "this is Metashape's calibration: export it",
    "fc = [ 600.1 ; 600.2 ];\ncc = [ 320 ; 240 ];\n": "this is MATLAB's calibration: write",
    "%YAML:1.0\nCamera.type: KannalaBrandt8\nCamera1.fx: 190.97\n": "this is ORB-SLAM's settings",
    "%YAML:1.0\nrelative_config_imucam: kalibr_imucam_chain.yaml\n": "the chain that they name",
    "target_type: aprilgrid\ntagCols: 6\n": "this is Kalibr's target: pass it as --board",
    "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n": "pass the cameras.txt beside it",
    '{"asset": {"version": "2.0"}, "cameras": []}': "this is a glTF scene: pass it as the scene",
    "#usda 1.0\n": "this is a USD scene: pass it as the scene",
    "mtllib a.mtl\nv 0 0 0\n": "this is an OBJ scene: pass it as the scene",
    "<robot name='a'/>": "this is a scene or a robot: pass it as the scene",
    "MATLAB 5.0 MAT-file\0": "got MATLAB's data: export it with OCamCalib's Export Data",
    "glTF\2\0": "got a scene: pass it as the scene",
    "cam0:\n\tcamera_model: pinhole\n\tintrinsics: [1]\n":
        "not YAML in line 2: expected spaces, got a tab",
}  # fmt: skip


@pytest.mark.parametrize(("text", "words"), FILES.items(), ids=range(len(FILES)))
def test_the_line_names_the_tool_and_the_remedy(text, words, tmp_path):
    (tmp_path / "a.txt").write_text(text)
    with pytest.raises(CalibrationError) as info:
        load_calibration(tmp_path / "a.txt")
    assert words in str(info.value)
    assert "\n" not in str(info.value)


@pytest.mark.parametrize(
    ("name", "old", "new", "words"),
    [
        ("colmap_cameras.txt", "SIMPLE_RADIAL ", "SIMPLE_DIVISION ", "let COLMAP estimate OPENCV"),
        ("colmap_cameras.txt", "SIMPLE_RADIAL ", "SIMPLE_RADAIL ", "did you mean 'SIMPLE_RADIAL'"),
        ("basalt_tum_vi_ds.json", '"ds"', '"pinhole-radtan8"', "pass them as an opencv_pinhole"),
        ("foxglove.json", '"kannala_brandt"', '"fisheye62"', "with four coefficients"),
        ("kitti360_image_02.yaml", "MEI", "SCARAMUZZA", "pass calib_results.txt"),
        ("ros_fisheye.yaml", "[330.5, 0.,", "[330.5, -0.9,",
         "with --fisheye-fix-skew; a 0 in its place moves pixels by up to 0.65 px"),
        ("ros_fisheye.yaml", "camera_model: fisheye\n",
         "camera_model: fisheye\ndistortion_model: plumb_bob\n", "a fisheye's, as camera_model"),
    ],
)  # fmt: skip
def test_models_that_are_not_read_have_a_remedy(name, old, new, words, tmp_path):
    text = (FOLDER / name).read_text()
    assert old in text
    (tmp_path / name).write_text(text.replace(old, new, 1))
    with pytest.raises(CalibrationError) as info:
        load_calibration(tmp_path / name)
    assert words in str(info.value)
