"""EuRoC: states read by evo, cameras by PyYAML and projected by OpenCV."""

import csv

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from omnisim.cameras.calibration import load_calibration
from omnisim.core.files.image_files import read_image
from omnisim.datasets.export.export import export_run
from omnisim.datasets.export.export_format import ExportSettings

pytestmark = pytest.mark.usefixtures("needs_opengl")
START_NS = 1_769_860_800_123_456_789


@pytest.fixture(scope="module")
def euroc(run, tmp_path_factory):
    folder = tmp_path_factory.mktemp("euroc") / "out"
    notes = []
    list(export_run(run, "euroc", folder, ExportSettings(START_NS), print_note=notes.append))
    return folder / "mav0"


def _rows(path):
    with path.open() as file:
        return [row for row in csv.reader(file) if not row[0].startswith("#")]


def _pose(document):
    return np.reshape(document["T_BS"]["data"], (4, 4))


def _poses(euroc):
    file_interface = pytest.importorskip("evo.tools.file_interface")
    path = euroc / "state_groundtruth_estimate0" / "data.csv"
    poses = file_interface.read_euroc_csv_trajectory(path).poses_se3
    stamps = [row[0] for row in _rows(path)]
    return [poses[stamps.index(row[0])] for row in _rows(euroc / "cam0" / "data.csv")]


def test_stamps_are_whole_nanoseconds_of_all_streams(euroc):
    stamps = [str(START_NS + 500_000_000 * step) for step in range(4)]
    for camera in ("cam0", "cam1", "cam2"):
        rows = _rows(euroc / camera / "data.csv")
        assert rows == [[stamp, f"{stamp}.png"] for stamp in stamps]
        assert all((euroc / camera / "data" / name).is_file() for _, name in rows)
    readings = [int(row[0]) for row in _rows(euroc / "imu0" / "data.csv")]
    assert readings == [START_NS + 50_000_000 * number for number in range(31)]
    states = _rows(euroc / "state_groundtruth_estimate0" / "data.csv")
    assert {*readings, *map(int, stamps)} <= {int(row[0]) for row in states}


@pytest.mark.parametrize("index", range(3))
def test_cameras_are_read_back(euroc, index):
    path = euroc / f"cam{index}" / "sensor.yaml"
    calibration = load_calibration(path)
    assert calibration.names == [f"cam{index}"]
    document = yaml.safe_load(path.read_text())
    (cam_from_imu,) = calibration.cameras[0].poses
    imu_from_cam = np.linalg.inv(cam_from_imu.target_from_source)
    np.testing.assert_allclose(imu_from_cam, _pose(document), atol=1e-12)
    parameters = calibration.cameras[0].camera.parameters()
    *_, pu, pv = document["intrinsics"]
    assert parameters["principal_point_px"] == pytest.approx([pu, pv])


@pytest.mark.parametrize(("index", "name"), [(0, "front"), (1, "fisheye"), (2, "mirror")])
def test_points_project_to_their_pixels(euroc, seen, check_pixels, index, name):
    cv2 = pytest.importorskip("cv2")
    document = yaml.safe_load((euroc / f"cam{index}" / "sensor.yaml").read_text())
    assert document["comment"] == name
    *shape, fu, fv, pu, pv = document["intrinsics"]
    matrix = np.array([[fu, 0.0, pu], [0.0, fv, pv], [0.0, 0.0, 1.0]])
    distortion = np.array(document["distortion_coefficients"])
    zero = np.zeros(3)
    stamps = [row[0] for row in _rows(euroc / f"cam{index}" / "data.csv")]
    for step, world_from_body in enumerate(_poses(euroc)):
        camera_from_world = np.linalg.inv(world_from_body @ _pose(document))
        points = seen(name, step).world_m @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
        kinds = document["camera_model"], document["distortion_model"]
        if name == "front":
            assert kinds == ("pinhole", "radial-tangential")
            pixels, _ = cv2.projectPoints(points, zero, zero, matrix, distortion)
        elif name == "fisheye":
            assert kinds == ("pinhole", "equidistant")
            pixels, _ = cv2.fisheye.projectPoints(points[:, None], zero, zero, matrix, distortion)
        else:
            assert kinds == ("omni", "radial-tangential")
            pixels, _ = cv2.omnidir.projectPoints(
                points[:, None], zero, zero, matrix, shape[0], distortion
            )
        image = read_image(euroc / f"cam{index}" / "data" / f"{stamps[step]}.png")[0]
        check_pixels(pixels.reshape(-1, 2), image, name, step)


def test_the_body_is_the_imu_and_feels_its_gravity(euroc, run):
    """At constant speed the specific force is gravity, along the body's z, and the turn is z's."""
    document = yaml.safe_load((euroc / "imu0" / "sensor.yaml").read_text())
    np.testing.assert_array_equal(_pose(document), np.eye(4))
    assert document["rate_hz"] == 20.0
    assert document["gyroscope_noise_density"] > 0.0
    readings = np.array([row[1:] for row in _rows(euroc / "imu0" / "data.csv")], dtype=float)
    np.testing.assert_allclose(readings[:, 5].mean(), 9.80665, atol=0.05)
    poses = _poses(euroc)
    turn = Rotation.from_matrix(poses[0][:3, :3].T @ poses[-1][:3, :3]).as_rotvec()
    np.testing.assert_allclose(readings[:, :3].mean(axis=0) * 1.5, turn, atol=0.02)
    # the IMU is turned by 90° on the base: its y looks back
    truth = np.loadtxt(run / "ground_truth.tum")
    np.testing.assert_allclose(poses[0][:3, 3], truth[0, 1:4] + (0.1, 0.0, 0.2), atol=1e-8)
    np.testing.assert_allclose(poses[0][:3, 1], (-1.0, 0.0, 0.0), atol=1e-8)


def test_velocities_are_the_motions_and_agree_with_the_imu(euroc, run):
    """Central differences of the positions, and biases as the run has recorded them."""
    states = np.array(_rows(euroc / "state_groundtruth_estimate0" / "data.csv"), dtype=float)
    times_s, places, velocities = states[:, 0] * 1e-9, states[:, 1:4], states[:, 8:11]
    moved = np.gradient(places, times_s - times_s[0], axis=0)
    # the third derivative of this path times the square of up to 50 ms over 6
    np.testing.assert_allclose(velocities[1:-1], moved[1:-1], atol=2e-3)
    biases = np.loadtxt(run / "imu" / "biases.csv", delimiter=",", skiprows=1)
    readings = [int(row[0]) for row in _rows(euroc / "imu0" / "data.csv")]
    stamps = [int(row[0]) for row in _rows(euroc / "state_groundtruth_estimate0" / "data.csv")]
    np.testing.assert_array_equal(states[np.isin(stamps, readings), 11:], biases[:, 1:])
    assert biases[1:, 1:].all()
