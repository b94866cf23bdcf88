"""`omnisim record`: lenses and rigs along poses of a file."""

import dataclasses
import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from omnisim.cameras import camera_from_parameters
from omnisim.cameras.calibration import Calibration, NamedPose, load_calibration
from omnisim.core.bilinear import sample
from omnisim.core.files.image_files import read_channels, read_image
from omnisim.core.poses import inverse, pose
from omnisim.core.trajectories import Trajectory, read_trajectory, write_trajectory
from omnisim.datasets.export.recording import Recording
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.sensors.imu.imu import Imu

pytestmark = pytest.mark.usefixtures("needs_opengl")
SAMPLES = Path(__file__).parents[3] / "cameras" / "calibration" / "samples"
TUM_VI = SAMPLES / "kalibr_tum_vi.yaml"
SKY_M = 1e6  # where nothing is hit
FAST = ("--size", 64, "--quality", "fast")
# of an IMU whose z is up when its x looks south, as TUM VI's cameras look along its −y
POSES = np.array(
    [
        pose((0.0, 0.5, 1.4), yaw_deg=20.0),
        pose((0.2, 0.4, 1.5), roll_deg=2.0, pitch_deg=-3.0, yaw_deg=35.0),
    ]
)


@pytest.fixture
def record(omnisim):
    """Records along poses of an IMU in the file poses.tum, into the folder run."""

    def command(*options, scene="courtyard"):
        if not Path("poses.tum").exists():
            write_trajectory(Path("poses.tum"), Trajectory(np.array([0.5, 1.0]), POSES))
        status, out, err = omnisim("record", scene, *options, "-o", "run")
        assert (status, out == "") in ((0, False), (1, True)), err
        return err if status else out

    return command


def _poses(camera):
    return read_trajectory(Path("run", camera, "poses.tum")).world_from_base


def test_the_right_image_of_a_chain_is_a_single_image_at_the_composed_pose(record):
    record("--trajectory", "poses.tum", "--camera", TUM_VI, *FAST)
    right = load_calibration(TUM_VI).camera("cam1")
    chain = {
        p.source: p.target_from_source for c in load_calibration(TUM_VI).cameras for p in c.poses
    }
    world_from_optical = POSES @ inverse(chain["imu"]) @ inverse(chain["cam0"])
    np.testing.assert_allclose(_poses("cam1"), world_from_optical, atol=1e-8)
    sensor = OmniCamera(right.camera, polygons=None).with_quality("fast").resized(64)
    rig_from_optical = np.eye(4)
    rig_from_optical[:3, :3] = sensor.model.rig_from_optical
    with open_sensor("courtyard", sensor) as renderer:
        for step in range(2):
            frame = renderer.render(world_from_optical[step] @ inverse(rig_from_optical))
            pixels, _ = read_image(Path(f"run/cam1/{step:06d}.png"))
            off = np.abs(pixels.astype(int) - frame.rgb)
            # poses that were composed in another order differ in their last bits
            assert off.max() <= 1
            assert np.count_nonzero(off) <= 1e-3 * off.size
    assert frame.rgb.std() > 20.0


def test_a_point_seen_by_both_cameras_reprojects_by_opencv(record):
    size = ("--size", 256, "--quality", "fast")
    record("--trajectory", "poses.tum", "--camera", TUM_VI, *size, "--also", "range")
    left, right = (_OpencvFisheye(name) for name in ("cam0", "cam1"))
    pixels = np.stack(np.meshgrid(np.arange(20, 236, 6), np.arange(20, 236, 6)), axis=-1)
    pixels = pixels.reshape(-1, 2).astype(np.float64)
    points = right.points(pixels)
    seen = left.project(points)
    inside = ((seen > 1.0) & (seen < 254.0)).all(axis=-1) & (np.abs(points) < SKY_M).all(axis=-1)
    pixels, points, seen = pixels[inside], points[inside], seen[inside]
    again = left.points(seen)
    # beside an edge, or behind one, both see different surfaces
    same = left.is_smooth(seen) & (np.linalg.norm(again - points, axis=-1) < 0.1)
    assert same.sum() > 0.5 * len(pixels) > 300
    error_px = np.linalg.norm(right.project(again[same]) - pixels[same], axis=-1)
    assert error_px.max() < 0.1


class _OpencvFisheye:
    """Camera of the run at its second step: OpenCV's fisheye with the file's poses and ranges."""

    def __init__(self, name):
        folder = Path("run", name)
        camera = camera_from_parameters(
            json.loads((folder / "calibration.json").read_text())["camera"]
        )
        (fx, fy), (u, v) = camera.focal_lengths_px, camera.principal_point_px
        self._matrix = np.array([[fx, 0.0, u], [0.0, fy, v], [0.0, 0.0, 1.0]])
        self._coefficients = np.array(camera.coefficients)
        self._world_from_optical = _poses(name)[1]
        self._ranges = read_channels(folder / "000001.channels.exr").values["range"].astype(float)
        self._ranges[~np.isfinite(self._ranges)] = 2.0 * SKY_M

    def points(self, pixels):
        """Points (n, 3) in the world that pixels (n, 2) show, by their ranges."""
        plane = cv2.fisheye.undistortPoints(pixels[:, None], self._matrix, self._coefficients)[:, 0]
        rays = np.column_stack((plane, np.ones(len(plane))))
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
        points = rays * sample(self._ranges, pixels)[:, None]
        return points @ self._world_from_optical[:3, :3].T + self._world_from_optical[:3, 3]

    def project(self, points):
        """Pixels (n, 2) of points in the world."""
        optical_from_world = inverse(self._world_from_optical)
        rotation = cv2.Rodrigues(optical_from_world[:3, :3])[0]
        pixels, _ = cv2.fisheye.projectPoints(
            points[:, None], rotation, optical_from_world[:3, 3], self._matrix, self._coefficients
        )
        return pixels[:, 0]

    def is_smooth(self, pixels):
        """Ranges around the pixels differ by little: one surface."""
        corners = [self._ranges[tuple((np.floor(pixels).astype(int) + d)[:, ::-1].T)]
                   for d in ((0, 0), (1, 0), (0, 1), (1, 1))]  # fmt: skip
        return np.ptp(corners, axis=0) < 0.02 * np.min(corners, axis=0)


def test_an_interrupted_run_goes_on_and_another_is_refused(record):
    options = ("--trajectory", "poses.tum", "--camera", TUM_VI, *FAST, "--also", "range,instance")
    assert "2 steps; " in record(*options, scene="compass")
    files = {path: path.read_bytes() for path in sorted(Path("run").rglob("*")) if path.is_file()}
    for name in ("cam0/000001.png", "cam1/000001.channels.exr", "cam1/poses.tum"):
        Path("run", name).unlink()
    assert "1 of them recorded before" in record(*options, scene="compass")
    assert files == {path: path.read_bytes() for path in files}
    assert "another run is in this folder" in record(*options, "--unlit", scene="compass")
    assert files == {path: path.read_bytes() for path in files}
    assert "2 steps; " in record(*options, "--camera-name", "cam1", "--force", scene="compass")
    assert not Path("run/cam0").exists()
    for name in ("000001.png", "000001.channels.exr", "poses.tum"):
        assert Path("run/cam1", name).read_bytes() == files[Path("run/cam1", name)]


def test_transforms_of_nerfstudio_bring_poses_and_camera_and_come_back(record, omnisim):
    source = SAMPLES / "transforms.json"
    record("--trajectory", source, *FAST)
    opengl = np.diag([1.0, -1.0, -1.0, 1.0])
    frames = json.loads(source.read_text())["frames"]
    expected = np.array([frame["transform_matrix"] for frame in frames]) @ opengl
    np.testing.assert_allclose(_poses("camera"), expected, atol=1e-8)
    _, metadata = read_image(Path("run/camera/000001.png"))
    np.testing.assert_allclose(metadata["world_from_optical"], expected[1], atol=1e-12)
    # back to a file of nerfstudio's, and along it again
    camera = load_calibration(Path("run/camera/calibration.json")).cameras[0]
    poses = tuple(
        NamedPose("world", f"{step:06d}.png", pose) for step, pose in enumerate(_poses("camera"))
    )
    returned = Calibration((dataclasses.replace(camera, poses=poses),))
    returned.save("transforms.json", "nerfstudio")
    first = Path("run/camera/000001.png")
    pixels, _ = read_image(first)
    assert "2 steps; " in record("--trajectory", "transforms.json", "--quality", "fast", "--force")
    np.testing.assert_array_equal(read_image(first)[0], pixels)


def test_other_calibrations_go_along_a_trajectory(record):
    calibration = SAMPLES / "kitti360_image_02.yaml"
    poses = ("--trajectory", "poses.tum", "--trajectory-frame", "camera")
    record(*poses, "--camera", calibration, *FAST)
    np.testing.assert_allclose(_poses("image_02"), POSES, atol=1e-8)
    pixels, metadata = read_image(Path("run/image_02/000001.png"))
    assert min(pixels.shape[:2]) == 64
    assert metadata["camera"]["model"] == load_calibration(calibration).cameras[0].camera.model_name
    assert pixels.std() > 20.0


def test_a_bare_sensor_is_carried_by_a_vehicle_and_placed(record):
    record("--trajectory", "poses.tum", "--at", 1, 0, 0, "--yaw", 90, *FAST)
    placed = pose((1.0, 0.0, 0.0), yaw_deg=90.0) @ POSES
    truth = read_trajectory(Path("run/ground_truth.tum"))
    np.testing.assert_allclose(truth.world_from_base, placed, atol=1e-8)
    np.testing.assert_array_equal(truth.times_s, [0.5, 1.0])
    optical = OmniCamera().base_from_optical
    np.testing.assert_allclose(_poses("camera"), placed @ optical, atol=1e-8)


def test_poses_outside_of_the_scene_are_noted(ran):
    write_trajectory(Path("poses.tum"), Trajectory(np.array([0.5, 1.0]), POSES))
    line = ("record", "rings", "--trajectory", "poses.tum", *FAST)
    assert "outside" not in ran(*line, "-o", "inside")[1]
    _, err = ran(*line, "--at", 500, 0, 0, "-o", "outside")
    assert "poses.tum: 2 of 2 poses outside the scene, which spans (" in err


def test_a_run_of_a_rig_is_plotted_and_has_no_odometry_to_localize_by(record, ran, refused):
    pytest.importorskip("matplotlib")
    record("--trajectory", "poses.tum", *FAST, scene="soccer")
    ran("plot", "run")
    line = refused("localize", "run", "-o", "found")
    assert "run: expected the run of a robot with wheels, got that of a rig" in line


def test_a_robots_sensors_go_along_a_trajectory_without_wheels(ran, omnisim):
    """An IMU and a lidar on a rig: each at the mount, and no odometry."""
    write_trajectory(Path("poses.tum"), Trajectory(np.array([0.5, 1.0]), POSES))
    Path("rig.toml").write_text(
        'name = "rig"\n[[sensors]]\nname = "imu"\ntype = "imu"\nposition_m = [0.0, 0.0, 0.1]\n'
        '[[sensors]]\nname = "lidar"\ntype = "lidar"\nposition_m = [0.1, 0.0, 0.4]\nfirings = 36\n'
    )
    line = "record", "rings", "--trajectory", "poses.tum", "--robot", "rig.toml", "-o", "run"
    assert "poses of the rig's base" in ran(*line)[1]
    assert not Path("run", "odometry.csv").exists()
    recording = Recording.read(Path("run"))
    np.testing.assert_allclose(recording.truth.world_from_base, POSES, atol=1e-9)
    assert recording.sensors(Imu) == ["imu"]
    mount = recording.base_from_lidar("lidar")
    np.testing.assert_allclose(mount, pose((0.1, 0.0, 0.4)), atol=1e-9)
    status, _, err = omnisim(*line[:-1], "other", "--trajectory-frame", "camera")
    assert "poses.tum: --trajectory-frame: expected body, got no camera" in err
    status, _, err = omnisim(*line[:-1], "other", "--camera", TUM_VI)
    assert (status, "--camera: expected none with --robot" in err) == (1, True)
    assert not Path("other").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--trajectory", "poses.tum", "--camera-name", "all"], "--camera-name: requires --camera"),
        (["--trajectory", "poses.tum", "--camera", TUM_VI, "--camera-name", "cam7"], "got 'cam7'"),
        (["--trajectory", SAMPLES / "transforms.json", "--preset", "webcam"],
         "has no times, and the exposure of camera depends on them: pass --rate HZ"),
        (["--trajectory", "poses.tum", "--camera", SAMPLES / "kalibr_models.yaml"],
         "cam1: expected its pose from cam0, got no extrinsics"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_one_line(record, options, words):
    text = record(*options)
    assert words in text
    assert len([line for line in text.splitlines() if line.startswith("error")]) == 1
    assert not Path("run").exists()


def test_a_single_viewpoint_tilts(ran):
    options = ("render", "courtyard", "--camera", TUM_VI, *FAST, "--at", 0, 0, 1.2, "--yaw", 30)
    out, _ = ran(*options, "--pitch", 20, "--roll", -10, "-o", "tilted.png")
    assert "at yaw 30°, pitch 20°, roll -10°" in out
    _, metadata = read_image(Path("tilted.png"))
    down, forward = np.array(metadata["world_from_optical"])[:3, 1:3].T
    assert np.degrees(np.arcsin(-forward[2])) == pytest.approx(20.0)  # the front is down
    assert np.degrees(np.arctan2(forward[1], forward[0])) == pytest.approx(30.0)
    np.testing.assert_allclose(
        metadata["world_from_base"], pose((0, 0, 1.2), roll_deg=-10.0, pitch_deg=20.0, yaw_deg=30.0)
    )
    assert down[2] < -0.9
