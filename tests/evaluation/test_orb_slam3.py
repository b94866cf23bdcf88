"""ORB-SLAM3 on a handheld rig whose truth is known, and what it is given."""

import dataclasses
import gzip
import json
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from omnisim.cameras import KannalaBrandtCamera
from omnisim.core.errors import EstimatorError
from omnisim.core.extras import is_installed
from omnisim.core.poses import inverse, pose
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.estimator_registry import estimator_named
from omnisim.evaluation.estimators import orb_slam3, orb_slam3_program
from omnisim.evaluation.estimators.orb_slam3 import (
    VOCABULARY,
    ImuSettings,
    settings_text,
    unpacked_vocabulary,
)
from omnisim.evaluation.trajectory_errors import trajectory_errors

LENS = KannalaBrandtCamera(
    320, 320, (120.0, 121.0), (159.5, 160.0), (0.01, -0.002, 0.0, 1e-4), np.radians(75.0)
)
LENS_FILE = """
[lens]
model = "kannala_brandt"
width_px = 320
height_px = 320
focal_lengths_px = [120.0, 121.0]
principal_point_px = [159.5, 160.0]
coefficients = [0.01, -0.002, 0.0, 1e-4]
theta_max_deg = 75.0
"""
CAMERA = 'type = "omnicamera"\nfile = "lens.toml"\nrate_hz = 5.0'
RIG = f"""
name = "rig"
[[sensors]]
name = "left"
{CAMERA}
position_m = [0.1, 0.1, 0.0]
yaw_deg = 3.0
[[sensors]]
name = "right"
{CAMERA}
position_m = [0.1, -0.1, 0.0]
roll_deg = 2.0
[[sensors]]
name = "imu"
type = "imu"
device = "bmi160"
rate_hz = 200.0
position_m = [0.05, 0.03, -0.05]
yaw_deg = 90.0
"""
DURATION_S = 20.0  # its second inertial adjustment comes after 15 s


def write_sway(path):
    """Handheld motion: most of a loop, swaying in six degrees of freedom."""
    times_s = np.arange(0.0, DURATION_S + 1e-9, 0.02)
    along = 0.3 * times_s

    def sway(*parts):
        return sum(size * np.sin(2.0 * np.pi * (hz * times_s + 0.37 * hz)) for hz, size in parts)

    x_m = 2.0 * np.cos(along) + sway((0.7, 0.05), (1.6, 0.02))
    y_m = 2.0 * np.sin(along) + sway((0.6, 0.05), (1.7, 0.02))
    z_m = 1.2 + sway((0.5, 0.05), (1.9, 0.025))
    yaw = along + 0.5 * np.pi + sway((0.3, 0.15), (0.9, 0.03))
    tilts = sway((0.4, 0.08), (1.1, 0.03)), sway((0.35, 0.08), (1.2, 0.03))
    turns = Rotation.from_euler("ZYX", np.column_stack((yaw, *tilts))).as_quat()
    np.savetxt(path, np.column_stack((times_s, x_m, y_m, z_m, turns)), fmt="%.9f")


@pytest.fixture(scope="module")
def rig_run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rig")
    (folder / "lens.toml").write_text(LENS_FILE)
    (folder / "rig.toml").write_text(RIG)
    write_sway(folder / "sway.tum")
    words = ["record", "courtyard", "--robot", "rig.toml", "--trajectory", "sway.tum"]
    subprocess.run(
        [sys.executable, "-m", "omnisim", *words, "--quality", "fast", "-o", "run"],
        cwd=folder, check=True, capture_output=True,
    )  # fmt: skip
    return Recording.read(folder / "run")


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.usefixtures("needs_opengl")
def test_it_finds_the_way_and_with_an_imu_scale_and_gravity(rig_run, tmp_path):
    """Asked: 1 % of the path; with an IMU the scale within 1 %, and gravity within 0.2°."""
    if not is_installed("pyorbslam3"):
        pytest.skip("ORB-SLAM3 is not installed")
    stereo = _errors(rig_run, "orb-slam3-stereo", tmp_path)
    assert stereo.ate_m < 0.01 * stereo.path_length_m
    assert stereo.lost < 0.1
    inertial = _errors(rig_run, "orb-slam3-stereo-imu", tmp_path)
    if abs(inertial.scale - 1.0) > 0.01 or inertial.gravity_deg > 0.2:  # it is not deterministic
        inertial = _errors(rig_run, "orb-slam3-stereo-imu", tmp_path / "again")
    assert inertial.ate_m < 0.01 * inertial.path_length_m
    assert inertial.scale == pytest.approx(1.0, abs=0.01)
    assert inertial.gravity_deg < 0.2


def _errors(run, name, folder):
    estimator, work = estimator_named(name), folder / name
    work.mkdir(parents=True)
    estimate = estimator.estimate(run, work)
    return trajectory_errors(estimate, run.fine_truth, estimator.alignment)


def test_the_settings_are_those_of_the_rig():
    """Read back by the parser of the file's own library."""
    cv2 = pytest.importorskip("cv2")
    second_pose = pose((0.2, 0.01, -0.02), yaw_deg=2.0)
    noise = {"NoiseGyro": 8e-5, "NoiseAcc": 1.4e-3, "GyroWalk": 2.2e-6, "AccWalk": 0.0}
    imu = ImuSettings(pose((0.1, 0.2, 0.3), roll_deg=40.0), 200.0, noise)
    text = settings_text([LENS, LENS], 8.0, second_pose, imu)
    file = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    names = ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4")
    values = (*LENS.focal_lengths_px, *LENS.principal_point_px, *LENS.coefficients)
    for camera in ("Camera1", "Camera2"):
        nodes = [file.getNode(f"{camera}.{name}") for name in names]
        assert all(node.isReal() for node in nodes)
        assert [node.real() for node in nodes] == list(values)
    assert np.allclose(file.getNode("Stereo.T_c1_c2").mat(), second_pose, atol=1e-7)
    assert np.allclose(file.getNode("IMU.T_b_c1").mat(), imu.imu_from_camera, atol=1e-7)
    assert file.getNode("IMU.NoiseAcc").real() == 1.4e-3
    assert file.getNode("IMU.AccWalk").real() > 0.0  # none at all is singular
    assert file.getNode("Camera.fps").isInt()


def test_lenses_of_other_coefficients_are_refused():
    other = dataclasses.replace(LENS, coefficients=(0.02, -0.002, 0.0, 1e-4))
    with pytest.raises(EstimatorError, match="uses the first lens's coefficients for both"):
        orb_slam3._check_pair([LENS, other])
    orb_slam3._check_pair([LENS, dataclasses.replace(LENS, focal_lengths_px=(118.0, 118.0))])


def test_no_keyframe_is_an_error_and_poses_are_of_the_base(tmp_path):
    with pytest.raises(EstimatorError, match="tracked no image"):
        orb_slam3._trajectory(tmp_path, np.arange(3.0), np.eye(4))
    (tmp_path / orb_slam3_program.FRAMES).write_text("0 0 0 0 0 0 0 1\n1000000000 1 0 0 0 0 0 1\n")
    turned = "0 5 0 0 0 0 0.7071067811865476 0.7071067811865476\n"
    (tmp_path / orb_slam3_program.KEYFRAMES).write_text(turned)
    base_from_body = pose((0.1, 0.0, 0.2), yaw_deg=90.0)
    found = orb_slam3._trajectory(tmp_path, np.arange(3.0) + 1e-7, base_from_body)
    assert found.times_s.tolist() == [1e-7, 1.0 + 1e-7]
    second = pose((5.0, 1.0, 0.0), yaw_deg=90.0) @ inverse(base_from_body)
    assert np.allclose(found.world_from_base[1], second)


def test_a_border_gets_the_nearest_pixels():
    mask = np.zeros((5, 5), dtype=bool)
    mask[1:4, 1:4] = True
    image = np.arange(25).reshape(5, 5)
    filled = image[orb_slam3._nearest_shown(mask)]
    assert np.array_equal(filled[1:4, 1:4], image[1:4, 1:4])
    assert filled[0].tolist() == [6, 6, 7, 8, 8]
    assert orb_slam3._nearest_shown(None) is None


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        ("import sys; sys.exit('no such key')", "exit status 1: no such key"),
        ("import os; os.abort()", "exit status -6: without a message"),
    ],
)
def test_the_end_of_its_process_is_an_error(tmp_path, monkeypatch, code, reason):
    toy = tmp_path / "toy.py"
    toy.write_text(code)
    monkeypatch.setattr(orb_slam3_program, "__file__", str(toy))
    with pytest.raises(EstimatorError, match=reason):
        orb_slam3._run_program(tmp_path, iter([b"x" * 1_000_000]))


def test_a_thread_that_only_looks_for_work_is_not_busy(tmp_path):
    """Also not while it waits for a processor, as it nearly always does on a loaded machine."""

    def is_busy(state, used_ns, count):
        (tmp_path / "stat").write_text(f"7 (a) b) {state} 1 7")
        (tmp_path / "schedstat").write_text(f"{used_ns} 123 {count}\n")
        return orb_slam3_program._is_busy(tmp_path, seen)

    seen = {}
    assert is_busy("R", 5_000, 3)  # it has not run yet since the image came
    assert is_busy("R", 5_000, 3)
    assert not is_busy("S", 9_000_000, 4)  # it has mapped, and sleeps
    assert is_busy("R", 12_000_000, 5)
    assert not is_busy("R", 12_020_000, 6)
    assert is_busy("R", 15_000_000, 7)
    (tmp_path / "stat").unlink()
    assert not orb_slam3_program._is_busy(tmp_path, seen)  # it has ended


def test_nothing_else_imports_it():
    """It is under the GPL: its process has nothing of omnisim, and omnisim's nothing of it."""
    program = Path(orb_slam3_program.__file__)
    texts = {path: path.read_text("utf-8") for path in program.parents[2].rglob("*.py")}
    assert [path for path, text in texts.items() if "import pyorbslam3" in text] == [program]
    assert not re.search(r"^\s*(from|import) omnisim", texts[program], re.MULTILINE)


def test_the_package_has_a_vocabulary():
    """As DBoW2 reads it: without a line break at the end, which it would take for a node."""
    assert VOCABULARY.stat().st_size < 2_000_000
    head, *nodes = gzip.decompress(VOCABULARY.read_bytes()).decode().split("\n")
    branching, depth, *_ = map(int, head.split())
    levels, parents, words = [0], [], set()
    for number, node in enumerate(nodes, start=1):
        parent, is_word, *descriptor, weight = node.split()
        parents.append(int(parent))
        levels.append(levels[int(parent)] + 1)  # a parent stands before its children
        assert len(descriptor) == 32
        assert all(0 <= int(byte) <= 255 for byte in descriptor)
        if is_word == "1":
            words.add(number)
        else:
            assert float(weight) == 0.0
    assert max(levels) <= depth
    assert max(Counter(parents).values()) <= branching
    assert words == {*range(1, len(levels))} - {*parents}
    assert len(words) > 5000


def test_a_run_without_its_sensors_is_an_error(tmp_path):
    estimator = estimator_named("orb-slam3-stereo")
    with pytest.raises(EstimatorError, match="the run has no camera"):
        estimator.estimate(SimpleNamespace(cameras=()), tmp_path)
    with pytest.raises(EstimatorError, match="the run has one camera: expected two"):
        estimator.estimate(SimpleNamespace(cameras=(None,)), tmp_path)


@pytest.mark.slow
def test_black_images_are_a_row_of_the_report(tmp_path):
    """The real library, which finds no corner."""
    if not is_installed("pyorbslam3"):
        pytest.skip("ORB-SLAM3 is not installed")
    (tmp_path / orb_slam3_program.SETTINGS).write_text(settings_text([LENS], 10.0))
    np.save(tmp_path / orb_slam3_program.TIMES, 0.1 * np.arange(5))
    request = {
        "vocabulary": str(unpacked_vocabulary(tmp_path)), "width_px": LENS.width_px,
        "height_px": LENS.height_px, "cameras": 1, "fps": 10.0,
    }  # fmt: skip
    (tmp_path / orb_slam3_program.REQUEST).write_text(json.dumps(request))
    orb_slam3._run_program(tmp_path, iter([bytes(LENS.width_px * LENS.height_px)] * 5))
    with pytest.raises(EstimatorError, match="tracked no image"):
        orb_slam3._trajectory(tmp_path, 0.1 * np.arange(5), np.eye(4))
