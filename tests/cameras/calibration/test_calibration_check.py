"""Findings of the check on files that have one fault each, and a lens in all formats."""

import dataclasses
import math

import numpy as np
import pytest

from omnisim.cameras import KannalaBrandtCamera, UnifiedCamera
from omnisim.cameras.calibration import CalibratedCamera, Calibration, NamedPose, load_calibration
from omnisim.cameras.calibration import calibration_check as checks
from omnisim.cameras.calibration.formats.format import ParsedCamera
from omnisim.cameras.calibration.formats.ocamcalib import Ocamcalib, inverse_polynomial
from omnisim.core.errors import NoticeWarning
from omnisim.core.poses import inverse
from tests.camera_examples import CAMERA_EXAMPLES
from tests.cameras.calibration.sample_files import FOLDER

FISHEYE = KannalaBrandtCamera(640, 480, (200.0, 200.0), (319.5, 239.5), (0.01, -0.003, 0.0, 0.0))
PINHOLE = UnifiedCamera(640, 480, (400.0, 400.0), (319.5, 239.5), 0.0, (-0.2, 0.03, 0.0, 0.0))


def findings(camera, **attributes):
    """Statuses and texts of a camera's findings by subject."""
    found = checks.check_camera(CalibratedCamera("cam0", camera, **attributes))
    return {each.subject: each for each in found}


def test_a_usual_camera_has_no_findings():
    for camera in (FISHEYE, PINHOLE, CAMERA_EXAMPLES["hyperbolic-paper"]):
        assert {each.status for each in findings(camera).values()} == {checks.OK}


MODELS = {camera.model_name: name for name, camera in reversed(CAMERA_EXAMPLES.items())}


@pytest.mark.parametrize("name", MODELS.values())
def test_every_model_is_checked(name):
    found = findings(CAMERA_EXAMPLES[name])
    assert found["inverse"].status == checks.OK
    assert found["field of view"].text[0].isdigit()


@pytest.mark.parametrize(
    ("camera", "subject", "text", "remedy"),
    [
        (dataclasses.replace(FISHEYE, principal_point_px=(159.5, 119.5)),
         "principal point", "(-160, -120) px", "it is the middle of 320 × 240 px"),
        (dataclasses.replace(FISHEYE, focal_lengths_px=(200.0, 150.0)),
         "aspect", "fx/fy = 1.3333", "shares of width and height"),
        (dataclasses.replace(FISHEYE, focal_lengths_px=(220.0, 200.0)),
         "aspect", "fx/fy = 1.1", "stretched (anamorphic)"),
        (dataclasses.replace(PINHOLE, skew_px=4.0), "skew", "0.573° from", "calibrate without it"),
        (dataclasses.replace(FISHEYE, coefficients=(-0.17, 0.0, 0.0, 0.0)),
         "limit", "folds at 80.2°, inside", "mask the image beyond it"),
        (dataclasses.replace(FISHEYE, coefficients=(0.0, 0.0, 0.02, -0.006)),
         "rim", "px beyond", "calibrate with the board at edges and corners"),
        (dataclasses.replace(FISHEYE, coefficients=(0.8, -2.1, 2.2, -0.55)),
         "rim", "smooth lens", "calibrate with fewer"),
    ],
    ids=["center", "aspect", "anamorphic", "skew", "fold", "rim", "wild"],
)  # fmt: skip
def test_an_unusual_camera_says_what_to_do(camera, subject, text, remedy):
    found = findings(camera)[subject]
    assert found.status == checks.UNUSUAL
    assert text in found.text
    assert remedy in found.remedy


def test_a_lens_that_shows_little_is_wrong():
    folded = dataclasses.replace(FISHEYE, coefficients=(-2.0, 0.0, 0.0, 0.0))
    assert findings(folded)["limit"].status == checks.WRONG


def test_a_contradictory_inverse_is_wrong(tmp_path):
    lens = load_calibration(FOLDER / "ocamcalib.txt").cameras[0].camera
    text = Ocamcalib().encode([ParsedCamera("camera", lens)])
    inverse_line = " ".join(map(repr, inverse_polynomial(lens)))
    assert inverse_line in text
    zeros = " ".join(["0.0"] * len(inverse_line.split()))
    (tmp_path / "c.txt").write_text(text.replace(inverse_line, zeros))
    with pytest.warns(NoticeWarning, match="inverse polynomial"):
        (camera,) = load_calibration(tmp_path / "c.txt").cameras
    (found,) = (each for each in checks.check_camera(camera) if each.status == checks.WRONG)
    assert "--to ocamcalib" in found.remedy


def test_a_time_shift_in_milliseconds_is_unusual():
    assert findings(FISHEYE, time_shift_s=0.004)["time shift"].status == checks.OK
    assert findings(FISHEYE, time_shift_s=4.0)["time shift"].remedy == "is it in milliseconds?"


def rig_of(poses, names=("left", "right"), camera=PINHOLE):
    """Cameras of a calibration with poses on a body."""
    cameras = tuple(
        CalibratedCamera(name, camera, (NamedPose("body", name, pose),))
        for name, pose in zip(names, poses, strict=True)
    )
    return Calibration(cameras)


def pose_at(x_m=0.0, y_m=0.0, z_m=0.0, yaw_deg=0.0):
    """Pose at an offset, turned about y (down): to the right."""
    sine, cosine = math.sin(math.radians(yaw_deg)), math.cos(math.radians(yaw_deg))
    pose = np.eye(4)
    pose[:3, :3] = [[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]]
    pose[:3, 3] = x_m, y_m, z_m
    return pose


def test_a_pair_states_baseline_angle_and_overlap():
    (found,) = checks.check_rig(rig_of([np.eye(4), pose_at(0.11, yaw_deg=10.0)]))
    assert found.status == checks.OK
    assert found.text.startswith("110 mm and 10.0° apart, ")
    shared = float(found.text.split(", ")[1].split(" %")[0])
    # 640 columns at 400 px per tangent: the right camera loses what is left of its own left edge
    assert shared == pytest.approx(100 - 100 * 10 / 77, abs=6)


@pytest.mark.parametrize(
    ("poses", "names", "remedy"),
    [
        ([np.eye(4), pose_at(-0.11)], ("left", "right"), "right is left of left"),
        ([pose_at(-0.11), np.eye(4)], ("right_cam", "left_cam"), "right_cam is left of left_cam"),
        ([np.eye(4), pose_at(-0.11)], ("cam0", "cam1"), "cam1 is left of cam0"),
        ([np.eye(4), pose_at(110.0)], ("left", "right"), "are these millimeters?"),
        ([np.eye(4), np.eye(4)], ("left", "right"), "one camera twice"),
        ([np.eye(4), pose_at(0.0, 0.11)], ("left", "right"), "110 mm down"),
    ],
)
def test_a_suspicious_pair_says_why(poses, names, remedy):
    (found,) = checks.check_rig(rig_of(poses, names))
    assert found.status == checks.UNUSUAL
    assert remedy in found.remedy


@pytest.mark.parametrize("names", [("left", "right"), ("right", "left"), ("cam0", "cam1")])
def test_a_usual_pair_is_ok(names):
    poses = [np.eye(4), pose_at(-0.11 if names[0] == "right" else 0.11)]
    assert checks.check_rig(rig_of(poses, names))[0].status == checks.OK


def test_the_order_of_more_than_two_cameras_means_nothing():
    poses = [np.eye(4), pose_at(-0.11), pose_at(-0.22)]
    found = checks.check_rig(rig_of(poses, ("cam0", "cam1", "cam2")))
    assert [each.status for each in found] == [checks.OK] * 3


def test_notes_on_the_file_are_findings():
    calibration = dataclasses.replace(rig_of([np.eye(4)], ("cam0",)), file_notes=("unknown keys",))
    assert checks.check_rig(calibration) == [(checks.UNUSUAL, "file", "unknown keys", "")]


def test_inverted_poses_of_a_ring_are_suspected():
    angles = (0.0, 90.0, 180.0, 270.0)
    ring = [
        pose_at(
            0.5 * math.sin(math.radians(angle)), 0.0, 0.5 * math.cos(math.radians(angle)), angle
        )
        for angle in angles
    ]
    names = ("front", "starboard", "rear", "port")
    assert "poses" not in {each.subject for each in checks.check_rig(rig_of(ring, names))}
    found = checks.check_rig(rig_of([inverse(pose) for pose in ring], names))[-1]
    assert (found.status, found.subject) == (checks.UNUSUAL, "poses")
    assert "the wrong way round" in found.remedy


def test_contradictory_poses_are_wrong():
    calibration = rig_of([np.eye(4), pose_at(0.11)])
    first, second = calibration.cameras
    other = NamedPose("left", "right", pose_at(0.12))
    second = dataclasses.replace(second, poses=(*second.poses, other))
    (found,) = checks.check_rig(Calibration((first, second)))
    assert found.status == checks.WRONG
    assert "10 mm" in found.text


def test_cameras_without_poses_are_no_rig():
    cameras = (CalibratedCamera("1", PINHOLE), CalibratedCamera("2", PINHOLE))
    (found,) = checks.check_rig(Calibration(cameras))
    assert found == (checks.OK, "poses", "no rig: 2 has no pose on a body", "")


def test_a_fitted_lens_that_ends_at_its_edge_gives_no_warning(monkeypatch):
    monkeypatch.setattr(checks, "FORMATS", {"colmap": checks.FORMATS["colmap"]})
    full = CAMERA_EXAMPLES["orthographic-full"]
    (found,) = checks.other_formats(CalibratedCamera("cam0", full))
    assert found.formats == ["colmap"]


def test_other_formats_hold_a_lens_exactly_fitted_or_not():
    found = checks.other_formats(CalibratedCamera("cam0", FISHEYE))
    by_format = {name: each for each in found for name in each.formats}
    assert by_format["kalibr"].is_exact
    assert by_format["kalibr"].model == "kannala_brandt"
    assert by_format["opencv_omnidir"].residuals.max_px > 0.0
    assert not by_format["opencv_pinhole"].is_exact
    assert by_format["opencv_pinhole"].camera is None
    assert "COLMAP's own projection ends at 90°" in by_format["colmap"].note
    order = [each.camera is None for each in found]
    assert order == sorted(order)
