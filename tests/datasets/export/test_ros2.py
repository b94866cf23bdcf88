"""ROS 2 bags, read by MCAP's own reader and by rosbags."""

import shutil
from collections import defaultdict
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from omnisim.core.errors import OmnisimError
from omnisim.core.files.image_files import read_image
from omnisim.core.poses import inverse
from omnisim.core.trajectories import read_trajectory
from omnisim.datasets.export.export import export_run
from omnisim.datasets.export.export_format import ExportSettings
from omnisim.datasets.export.recording import Recording
from tests.datasets.export.conftest import LIDAR_HEIGHT_M
from tests.scenes import ROOM_HALF_M

pytestmark = pytest.mark.usefixtures("needs_opengl")
START_NS = 1_769_860_800_000_000_000


@pytest.fixture(scope="module")
def bag(run, tmp_path_factory):
    """Messages of the MCAP file by topic, with log times and schemas."""
    pytest.importorskip("rosbags")
    reader = pytest.importorskip("mcap_ros2.reader")
    folder = tmp_path_factory.mktemp("bag") / "cart"
    notes = []
    settings = ExportSettings(START_NS, with_points=True)
    list(export_run(run, "ros2-mcap", folder, settings, print_note=notes.append))
    found = defaultdict(list)
    for message in reader.read_ros2_messages(str(folder / "cart.mcap")):
        found[message.channel.topic].append(message)
    return SimpleNamespace(folder=folder, notes=notes, topics=found)


def _messages(bag, topic):
    return [one.ros_msg for one in bag.topics[topic]]


def _array(message, dtype, *shape):
    return np.frombuffer(message.data, dtype=dtype).reshape(message.height, message.width, *shape)


def _stamp_ns(message):
    return message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec


def _pose(transform):
    pose = np.eye(4)
    q, t = transform.rotation, transform.translation
    pose[:3, :3] = Rotation.from_quat((q.x, q.y, q.z, q.w)).as_matrix()
    pose[:3, 3] = t.x, t.y, t.z
    return pose


def _transforms(message):
    return {
        (transform.header.frame_id, transform.child_frame_id): _pose(transform.transform)
        for transform in message.transforms
    }


def test_images_and_ranges_are_the_runs_own(bag, run):
    for camera in ("front", "fisheye", "mirror"):
        images, ranges = _messages(bag, f"/{camera}/image_raw"), _messages(bag, f"/{camera}/range")
        assert len(images) == len(ranges) == 4
        for step, (image, range_image) in enumerate(zip(images, ranges, strict=True)):
            rgb = read_image(run / camera / f"{step:06d}.png")[0]
            assert image.encoding == "rgb8"
            assert image.header.frame_id == f"{camera}_optical_frame"
            np.testing.assert_array_equal(_array(image, np.uint8, 3), rgb[..., :3])
            recorded = Recording.read(run, camera).cameras[0].channel(step, "range")
            assert range_image.encoding == "32FC1"
            np.testing.assert_array_equal(_array(range_image, np.float32), recorded)


def test_classes_are_the_runs_own_with_their_labels(bag, run):
    for step, image in enumerate(_messages(bag, "/mirror/semantic")):
        recorded = Recording.read(run, "mirror").cameras[0].channel(step, "semantic")
        assert image.encoding == "16UC1"
        np.testing.assert_array_equal(_array(image, np.uint16), recorded)
    (labels,) = _messages(bag, "/labels")
    assert labels.data == (run / "labels.json").read_text()


def test_frames_are_a_tree_from_the_map_to_the_sensors(bag, run):
    truth = read_trajectory(run / "ground_truth.tum")
    recording = Recording.read(run)
    (static,) = _messages(bag, "/tf_static")
    mounts = _transforms(static)
    assert {child for _, child in mounts} == {
        "front_optical_frame", "fisheye_optical_frame", "mirror_optical_frame",
        "kinect_optical_frame", "imu", "laser", "lidar", "sonar",
    }  # fmt: skip
    for step, message in enumerate(_messages(bag, "/tf")):
        moving = _transforms(message)
        assert set(moving) == {("map", "odom"), ("odom", "base_link")}
        map_from_base = moving["map", "odom"] @ moving["odom", "base_link"]
        np.testing.assert_allclose(map_from_base, truth.world_from_base[step], atol=1e-9)
    for camera in recording.cameras:
        mount = mounts["base_link", f"{camera.name}_optical_frame"]
        np.testing.assert_allclose(mount, camera.mount.base_from_optical, atol=1e-9)
    np.testing.assert_allclose(mounts["base_link", "laser"][:3, 3], (0.2, 0.0, 0.3), atol=1e-8)
    np.testing.assert_allclose(mounts["base_link", "lidar"][:3, 3], (0.0, 0.0, 0.9), atol=1e-8)
    np.testing.assert_allclose(
        mounts["base_link", "imu"][:3, :3], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-9
    )


def test_stamps_begin_at_the_start_and_follow_the_run(bag):
    for topic in ("/front/image_raw", "/odom", "/laser/scan", "/lidar/points"):
        stamps = [one.log_time_ns for one in bag.topics[topic]]
        assert stamps == [START_NS + 500_000_000 * step for step in range(4)]
        # a cloud is published at its revolution's end and, as drivers do, stamped with its start
        early_ns = 100_000_000 if topic == "/lidar/points" else 0
        for one in bag.topics[topic]:
            assert _stamp_ns(one.ros_msg) == one.log_time_ns - early_ns
    readings = bag.topics["/imu/data_raw"]
    times = np.array([reading.log_time_ns - START_NS for reading in readings])
    np.testing.assert_array_equal(np.diff(times), 50_000_000)
    assert len(readings) == 31
    assert readings[0].ros_msg.orientation_covariance[0] == -1.0
    assert readings[0].ros_msg.linear_acceleration.z == pytest.approx(9.8, abs=0.2)


def test_camera_info_is_there_only_where_it_projects_the_cameras_own_points(bag, run):
    cv2 = pytest.importorskip("cv2")
    assert "/mirror/camera_info" not in bag.topics
    assert sum("mirror" in note for note in bag.notes) == 1
    for camera in ("front", "fisheye"):
        info = _messages(bag, f"/{camera}/camera_info")[0]
        recorded = Recording.read(run, camera).cameras[0]
        points_m, hit = recorded.points_m(recorded.channel(0, "range"))
        matrix, distortion = np.array(info.k).reshape(3, 3), np.array(info.d)
        zero = np.zeros(3)
        if camera == "front":
            assert info.distortion_model == "plumb_bob"
            pixels, _ = cv2.projectPoints(points_m, zero, zero, matrix, distortion)
        else:
            assert info.distortion_model == "equidistant"
            pixels, _ = cv2.fisheye.projectPoints(points_m[:, None], zero, zero, matrix, distortion)
        v, u = np.nonzero(hit)
        np.testing.assert_allclose(pixels[:, 0], np.stack((u, v), axis=-1), atol=1e-3)


def test_the_calibration_of_any_camera_is_a_latched_text(bag, run):
    for camera in ("front", "fisheye", "mirror"):
        (message,) = _messages(bag, f"/{camera}/calibration")
        assert message.data == (run / camera / "calibration.json").read_text()
        channel = bag.topics[f"/{camera}/calibration"][0].channel
        assert "durability: 1" in channel.metadata["offered_qos_profiles"]


def test_points_of_ranges_lie_where_the_lidar_and_the_floor_are(bag, run):
    """Points of all sensors in the map: nothing below the floor, which most of them see."""
    (static,) = _messages(bag, "/tf_static")
    mounts = _transforms(static)
    truth = read_trajectory(run / "ground_truth.tum").world_from_base[0]
    topics = {
        "/mirror/points": "mirror_optical_frame",
        "/fisheye/points": "fisheye_optical_frame",
        "/lidar/points": "lidar",
        "/kinect/depth/points": "kinect_optical_frame",
    }
    for topic, frame in topics.items():
        cloud = _messages(bag, topic)[0]
        records = np.frombuffer(cloud.data, dtype=_cloud_type(cloud))
        points = np.stack([records[axis] for axis in "xyz"], axis=-1).astype(np.float64)
        assert len(points) == cloud.width > 20, topic
        map_from_sensor = truth @ mounts["base_link", frame]
        heights = (points @ map_from_sensor[:3, :3].T + map_from_sensor[:3, 3])[:, 2]
        assert heights.min() > -0.2, topic
        assert np.mean(np.abs(heights) < 0.1) > 0.2, topic


def _cloud_type(cloud):
    kinds = {1: "i1", 2: "u1", 4: "<u2", 6: "<u4", 7: "<f4", 8: "<f8"}
    return np.dtype({
        "names": [field.name for field in cloud.fields],
        "formats": [kinds[field.datatype] for field in cloud.fields],
        "offsets": [field.offset for field in cloud.fields],
        "itemsize": cloud.point_step,
    })  # fmt: skip


def test_stamp_plus_time_is_when_a_clouds_points_were_measured(fast_run, tmp_path):
    """As LIO-SAM's and FAST-LIO's readers take it: the points then lie on the room's walls."""
    pytest.importorskip("rosbags")
    reader = pytest.importorskip("mcap_ros2.reader")
    list(export_run(fast_run, "ros2-mcap", tmp_path / "bag"))
    found = defaultdict(list)
    for message in reader.read_ros2_messages(str(tmp_path / "bag" / "bag.mcap")):
        found[message.channel.topic].append(message.ros_msg)
    truth = [
        (1e-9 * _stamp_ns(one), one.pose.pose.position.x) for one in found["/ground_truth/odom"]
    ]
    assert len(found["/lidar/points"]) == 6
    for cloud in found["/lidar/points"]:
        points = np.frombuffer(cloud.data, dtype=_cloud_type(cloud))
        times_s = 1e-9 * _stamp_ns(cloud) + points["time"].astype(np.float64)
        assert np.ptp(times_s) > 0.09
        world_m = np.stack([points[axis] for axis in "xyz"], axis=-1).astype(np.float64)
        world_m[:, 0] += np.interp(times_s, *np.transpose(truth))
        world_m[:, 2] += LIDAR_HEIGHT_M - ROOM_HALF_M[2]  # the robot stands on the floor
        miss_m = np.abs(np.abs(world_m) - ROOM_HALF_M).min(axis=1)
        for ring in range(16):
            first, last = np.flatnonzero(points["ring"] == ring)[[0, -1]]
            assert max(miss_m[first], miss_m[last]) < 1e-3


def test_scans_and_ranges_are_the_runs_own(bag, run):
    scan = _messages(bag, "/laser/scan")[1]
    rows = np.genfromtxt(run / "laser" / "000001.csv", delimiter=",", comments="#", skip_header=0)
    rows = rows[~np.isnan(rows[:, 0])]
    angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    np.testing.assert_allclose(np.degrees(angles), rows[:, 1], atol=1e-4)
    np.testing.assert_array_equal(scan.ranges, rows[:, 2].astype(np.float32))
    assert scan.range_max == pytest.approx(8.19)
    sonar = _messages(bag, "/sonar/range")[1]
    text = (run / "sonar" / "000001.csv").read_text().splitlines()[-1]
    assert sonar.range == pytest.approx(float(text))
    assert sonar.radiation_type == 0


def test_odometry_reports_the_wheels_speed(bag, run):
    found = _messages(bag, "/odom")
    rows = np.genfromtxt(run / "odometry.csv", delimiter=",", names=True)
    for step, message in enumerate(found):
        position = message.pose.pose.position
        np.testing.assert_allclose((position.x, position.y), (rows["x_m"][step], rows["y_m"][step]))
        assert message.child_frame_id == "base_link"
        if step:
            assert message.twist.twist.linear.x == pytest.approx(2.0 * rows["distance_m"][step])
            assert message.twist.twist.angular.z == pytest.approx(2.0 * rows["turn_rad"][step])


def test_both_storages_hold_the_same_messages(bag, run, tmp_path):
    rosbags = pytest.importorskip("rosbags.highlevel")
    settings = ExportSettings(START_NS, with_points=True)
    list(export_run(run, "ros2-sqlite", tmp_path / "cart", settings))
    contents = []
    for folder in (bag.folder, tmp_path / "cart"):
        with rosbags.AnyReader([folder]) as reader:
            contents.append(
                sorted((c.topic, c.msgtype, time, data) for c, time, data in reader.messages())
            )
    assert contents[0] == contents[1]
    assert len(contents[0]) == sum(map(len, bag.topics.values()))


@pytest.mark.parametrize("storage", ["mcap", "sqlite"])
def test_two_exports_have_the_same_bytes_and_the_runs_compressed_images(run, tmp_path, storage):
    pytest.importorskip("rosbags")
    reader = pytest.importorskip("mcap_ros2.reader")
    exports = []
    for parent in ("a", "b"):
        (tmp_path / parent).mkdir()
        folder = tmp_path / parent / "cart"
        list(export_run(run, f"ros2-{storage}", folder, ExportSettings(compressed=True), "front"))
        exports.append({file.name: file.read_bytes() for file in folder.iterdir()})
    assert exports[0] == exports[1]
    if storage == "mcap":
        topic = "/front/image_raw/compressed"
        messages = reader.read_ros2_messages(str(folder / "cart.mcap"), [topic])
        files = [(run / "front" / f"{step:06d}.png").read_bytes() for step in range(4)]
        assert [bytes(message.ros_msg.data) for message in messages] == files


def test_stamps_past_what_ros_counts_are_refused(run, tmp_path):
    pytest.importorskip("rosbags")
    late = ExportSettings(2_147_483_646 * 1_000_000_000)
    with pytest.raises(OmnisimError, match=r"time 1 s: expected a stamp from 1970 to 2038"):
        list(export_run(run, "ros2-mcap", tmp_path / "bag", late))
    assert not any(tmp_path.iterdir())


def test_dynamic_objects_have_frames_of_the_map(run, tmp_path):
    """A run with an object, as a drive beside others has it; its frame must be its own."""
    pytest.importorskip("rosbags")
    reader = pytest.importorskip("mcap_ros2.reader")
    moving = tmp_path / "run"
    shutil.copytree(run, moving)
    (moving / "objects").mkdir()
    for name in ("odom", "front", "base link"):
        taken = moving / "objects" / f"{name}.tum"
        shutil.copy(run / "ground_truth.tum", taken)
        with pytest.raises(OmnisimError, match=f"unique topic and frame for {name}, got"):
            list(export_run(moving, "ros2-mcap", tmp_path / "bag"))
        taken.unlink()
    shutil.copy(run / "ground_truth.tum", moving / "objects" / "ball 1.tum")
    list(export_run(moving, "ros2-mcap", tmp_path / "bag", camera_name="front"))
    for message in reader.read_ros2_messages(str(tmp_path / "bag" / "bag.mcap"), ["/tf"]):
        found = _transforms(message.ros_msg)
        base = found["map", "odom"] @ found["odom", "base_link"]
        np.testing.assert_allclose(inverse(found["map", "ball_1"]) @ base, np.eye(4), atol=1e-8)
