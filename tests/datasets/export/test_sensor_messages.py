"""ROS messages of sensors: those of a bag and of instruments, and what drivers and readers have.

The tables of `docs/reference/ros-messages.md` are checked against messages: the fields of each
layout, and those that each reader of clouds looks for by name and type, as PCL does.
"""

import re
import shutil
from types import SimpleNamespace

import numpy as np
import pytest

from omnisim.core.errors import OutputError, RunError
from omnisim.datasets.export.export import export_run
from omnisim.datasets.export.export_format import ExportSettings
from omnisim.datasets.export.recording import read_cloud
from omnisim.datasets.export.ros2 import CloudLayout
from omnisim.rendering import Stage
from omnisim.rendering.sensor import Moment
from omnisim.robots import parse_robot
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner
from omnisim.sensors.lidar.point_files import PLAIN_POINT, POINT
from tests.datasets.export.conftest import LENSES, LIDAR_HEIGHT_M
from tests.docs.pages import text_of
from tests.scenes import ROOM_HALF_M, room, scene_of

pytest.importorskip("rosbags")
from omnisim.datasets.export.ros2 import ros_messages as messages
from omnisim.datasets.export.ros2 import sensor_messages as of_sensors

LAYOUTS = CloudLayout.__args__
START_NS = 1_769_860_800_000_000_000
TYPES = {"uint8": (2, "u1"), "uint16": (4, "<u2"), "uint32": (6, "<u4"), "float32": (7, "<f4"),
         "float64": (8, "<f8")}  # fmt: skip
PAGE = "docs/reference/ros-messages.md"
SENSORS = [
    {"name": "front", "type": "omnicamera", "file": "pinhole.toml", "position_m": [0.3, 0.0, 0.5]},
    {"name": "mirror", "type": "omnicamera", "file": "mirror.toml", "position_m": [0.0, 0.0, 0.7]},
    {"name": "kinect", "type": "depth_camera", "position_m": [0.25, 0.0, 0.4], "noise": False,
     "width_px": 32, "height_px": 24, "focal_length_px": 29.0},
    {"name": "laser", "type": "lms200", "position_m": [0.2, 0.0, 0.3]},
    {"name": "3d lidar", "type": "lidar", "position_m": [0.0, 0.0, 0.9], "firings": 36},
    {"name": "sonar", "type": "usarsim_sonar", "position_m": [0.3, 0.0, 0.2]},
    {"name": "ir", "type": "usarsim_ir_sensor", "position_m": [0.3, 0.0, 0.2]},
]  # fmt: skip


def _rows(heading):
    """Cells of the first table below a heading of the page, without code marks."""
    section = text_of(PAGE).split(f"## {heading}\n")[1]
    table = section[section.index("\n| ") :].strip().split("\n\n")[0].replace("`", "")
    rows = [line.strip("|").split("|") for line in table.splitlines()]
    return [[cell.strip() for cell in row] for row in rows[2:]]


def _fields(cloud):
    return {field.name: field for field in cloud.fields}


def _records(cloud):
    names = {number: kind for number, kind in TYPES.values()}
    fields = cloud.fields
    return np.frombuffer(cloud.data.tobytes(), np.dtype({
        "names": [field.name for field in fields],
        "formats": [names[field.datatype] for field in fields],
        "offsets": [field.offset for field in fields],
        "itemsize": cloud.point_step,
    }))  # fmt: skip


def _points(count=64, rings=16):
    """Points of a revolution, with the intensities of black, white and a glint."""
    points = np.zeros(count, dtype=POINT)
    points["ring"] = np.arange(count) % rings
    points["time"] = 0.1 * np.arange(count) / count
    points["range"] = np.linspace(1.0, 80.0, count)
    points["x"], points["return"], points["instance"] = points["range"], 1, 7
    points["intensity"] = np.resize([0.0, 1.0, 300.0, 0.5], count)
    return points


def _cloud(layout, points=None, rings=16):
    points = _points(rings=rings) if points is None else points
    end_ns = START_NS + 100_000_000
    (cloud,) = of_sensors.cloud_messages("lidar", end_ns, points, rings, 10.0, layout).values()
    return cloud


@pytest.mark.usefixtures("needs_opengl")
def test_instruments_and_bags_have_the_same_messages(tmp_path):
    """A robot at rest: the bytes of each topic, but for the decimals of a scan's table."""
    reader = pytest.importorskip("rosbags.highlevel")
    (tmp_path / "pinhole.toml").write_text(LENSES["pinhole.toml"])
    (tmp_path / "mirror.toml").write_text("[camera]\nwidth_px = 48\nheight_px = 48\n")
    (tmp_path / "path.csv").write_text("t_s,x_m,y_m,yaw_deg\n0,0,0,0\n0.1,0,0,0\n")
    robot = parse_robot({"name": "cart", "sensors": SENSORS}, "robot", tmp_path)
    vehicle, scene = Vehicle.from_robot(robot).with_cameras(quality="fast"), scene_of([room()])
    drive = Drive(scene, vehicle, Route(str(tmp_path / "path.csv")), channels=("range", "instance"))
    list(drive.plan().record(tmp_path / "run"))
    list(export_run(tmp_path / "run", "ros2-mcap", tmp_path / "bag", ExportSettings(START_NS)))
    with reader.AnyReader([tmp_path / "bag"]) as bag:
        recorded = {(one.topic, time): data for one, time, data in bag.messages()}
    stamp_ns, compared = START_NS + 100_000_000, []
    pose = np.array(np.eye(4))
    pose[2, 3] = -ROOM_HALF_M[2]
    with Stage(scene) as stage:
        for mount in vehicle.sensors:
            moment = Moment(lambda _: pose, 1, 0.1, 0.0, channels=("range", "instance"))
            with stage.open(mount) as instrument:
                reading = instrument.measure(moment)
            model = getattr(mount.sensor, "model", None)
            lens = None if model is None else of_sensors.true_lens(mount.name, model)
            found = of_sensors.of_reading(mount.name, reading, stamp_ns, lens=lens, period_s=0.1)
            for topic, message in found.items():
                data = recorded[topic, stamp_ns]
                if topic == "/laser/scan":
                    stored = messages.STORE.deserialize_cdr(data, messages.message_type(message))
                    np.testing.assert_allclose(message.ranges, stored.ranges, atol=1e-6)
                    message.ranges = stored.ranges
                    assert message.angle_min == pytest.approx(stored.angle_min, abs=1e-6)
                    message.angle_min, message.angle_max = stored.angle_min, stored.angle_max
                    message.angle_increment = stored.angle_increment
                assert messages.serialized(message) == bytes(data), topic
                compared.append(topic)
    assert compared == [
        "/front/image_raw", "/front/camera_info", "/front/instance", "/front/range",
        "/mirror/image_raw", "/mirror/instance", "/mirror/range",
        "/kinect/depth/image_rect", "/kinect/depth/camera_info",
        "/laser/scan", "/_3d_lidar/points", "/sonar/range", "/ir/range",
    ]  # fmt: skip


def test_each_layout_has_the_fields_of_its_table():
    rows = _rows("Layouts of clouds")
    assert [layout for layout, *_ in rows] == list(LAYOUTS)
    for layout, size, listed in rows:
        words = [field.split() for field in listed.split(", ")]
        cloud = _cloud(layout)
        if layout == "livox-custom":
            kind = messages.STORE.fielddefs["livox_ros_driver2/msg/CustomPoint"][1]
            assert [[name, field[1][0]] for name, field in kind] == [word[:2] for word in words]
            continue
        assert cloud.point_step == int(size)
        expected = {name: (int(offset), TYPES[kind][0], 1) for name, kind, offset in words}
        found = {name: (field.offset, field.datatype, field.count)
                 for name, field in _fields(cloud).items()}  # fmt: skip
        assert found == expected
        assert (cloud.height, cloud.is_dense, cloud.is_bigendian) == (1, True, False)


def test_clouds_have_the_fields_that_their_readers_look_for():
    """By name and type, as `pcl::fromROSMsg` matches them: another type is left at zero."""
    rows = [row for row in _rows("What readers look for") if row[1] == "cloud"]
    readers = {row[0] for row in rows}
    assert {name.split(" ")[0] for name in readers} == {"KISS-ICP", "LIO-SAM", "FAST-LIO"}
    for reader, _, names, kind, _, layouts in rows:
        for layout in layouts.split(", "):
            cloud = _cloud(layout)
            for name in names.split():
                if layout == "livox-custom":
                    field = dict(messages.STORE.fielddefs["livox_ros_driver2/msg/CustomPoint"][1])
                    assert field[name][1][0] == kind, (reader, layout, name)
                else:
                    assert _fields(cloud)[name].datatype == TYPES[kind][0], (reader, layout, name)


def _times_ns(cloud, layout):
    """Times of all points, as their readers take them."""
    if layout == "livox-custom":
        since_ns = np.array([point.offset_time for point in cloud.points], dtype=np.int64)
        return cloud.timebase + since_ns
    stamp = cloud.header.stamp
    stamp_ns, records = stamp.sec * 1_000_000_000 + stamp.nanosec, _records(cloud)
    if layout == "livox":
        return records["timestamp"].astype(np.int64)
    if layout.startswith("ouster"):
        return stamp_ns + records["t"].astype(np.int64)
    return stamp_ns + np.rint(1e9 * records["time"].astype(np.float64)).astype(np.int64)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_times_of_points_rise_from_the_revolutions_start(layout):
    times_ns = _times_ns(_cloud(layout), layout)
    expected = START_NS + np.rint(1e9 * _points()["time"].astype(np.float64)).astype(np.int64)
    # a float64 counts nanoseconds since 1970 in steps of 256
    np.testing.assert_allclose(times_ns - START_NS, expected - START_NS, atol=128)
    assert np.all(np.diff(times_ns) > 0)


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize("layout", LAYOUTS)
def test_points_lie_on_the_walls_at_their_own_times(fast_run, tmp_path, layout):
    reader = pytest.importorskip("rosbags.highlevel")
    settings = ExportSettings(START_NS, cloud_layout=layout)
    list(export_run(fast_run, "ros2-sqlite", tmp_path / "bag", settings))
    clouds, truth = [], []
    with reader.AnyReader([tmp_path / "bag"], default_typestore=messages.STORE) as bag:
        for one, _, data in bag.messages():
            if one.topic == "/lidar/points":
                clouds.append(bag.deserialize(data, one.msgtype))
            elif one.topic == "/ground_truth/odom":
                odometry = bag.deserialize(data, one.msgtype)
                stamp = odometry.header.stamp
                moment_ns = stamp.sec * 1_000_000_000 + stamp.nanosec
                truth.append((moment_ns - START_NS, odometry.pose.pose.position.x))
    assert len(clouds) == 6
    for cloud in clouds:
        custom = layout == "livox-custom"
        points = cloud.points if custom else _records(cloud)[["x", "y", "z"]].tolist()
        xyz = [(point.x, point.y, point.z) for point in points] if custom else points
        world_m = np.array(xyz, dtype=np.float64)
        times_ns = _times_ns(cloud, layout) - START_NS
        assert np.ptp(times_ns) > 0.09e9
        world_m[:, 0] += np.interp(times_ns, *np.transpose(truth))
        world_m[:, 2] += LIDAR_HEIGHT_M - ROOM_HALF_M[2]  # the robot stands on the floor
        miss_m = np.abs(np.abs(world_m) - ROOM_HALF_M).min(axis=1)
        assert miss_m.max() < 3e-6  # float32, and a livox time's 128 ns at 4 m/s


def test_scales_of_intensities_are_the_drivers():
    """Black, white, a glint and gray, by the drivers' scales; photons fall with squared range."""
    expected = {"generic": (0.0, 1.0, 300.0, 0.5), "velodyne": (0, 100, 255, 50),
                "livox": (0, 150, 255, 75)}  # fmt: skip
    for layout, levels in expected.items():
        np.testing.assert_array_equal(_records(_cloud(layout))["intensity"][:4], levels)
    assert [point.reflectivity for point in _cloud("livox-custom").points[:4]] == [0, 150, 255, 75]
    ouster, points = _records(_cloud("ouster")), _points()
    np.testing.assert_array_equal(ouster["reflectivity"][:4], (0, 100, 255, 50))
    np.testing.assert_array_equal(ouster["range"], np.rint(1e3 * points["range"].astype(float)))
    white = points["intensity"] == 1.0
    photons = ouster["intensity"][white] * points["range"][white].astype(float) ** 2
    np.testing.assert_allclose(photons, 1e5, rtol=0.05)  # whole photons
    assert ouster["intensity"].max() == 65535
    assert not ouster["ambient"].any()


def test_rings_count_as_the_drivers_do():
    """Ouster's ring 0 is its highest beam, Velodyne's the lowest; second returns have a tag."""
    rings = _points()["ring"]
    for layout in ("generic", "velodyne"):
        np.testing.assert_array_equal(_records(_cloud(layout))["ring"], rings)
    for layout in ("ouster", "ouster-u8"):
        np.testing.assert_array_equal(_records(_cloud(layout))["ring"], 15 - rings)
    points = _points()
    points["return"][1::2] = 2
    livox = _records(_cloud("livox", points))
    np.testing.assert_array_equal(livox["line"], rings)
    np.testing.assert_array_equal(livox["tag"] >> 4, points["return"] - 1)
    for layout in ("ouster-u8", "livox", "livox-custom"):
        with pytest.raises(OutputError, match=f"{layout}: expected at most 256 rings, got 300"):
            _cloud(layout, rings=300)
    assert _records(_cloud("ouster", rings=300))["ring"].max() == 299


@pytest.mark.parametrize("count", [0, 1, 64])
def test_livox_clouds_have_the_bytes_of_their_points_as_objects(count):
    cloud = _cloud("livox-custom", _points(count))
    point = messages.STORE.types["livox_ros_driver2/msg/CustomPoint"]
    parts = {**vars(cloud), "points": [point(*values) for values in cloud.points.tolist()]}
    kind = messages.message_type(cloud)
    same = messages.STORE.types[kind](**parts)
    assert messages.serialized(cloud) == bytes(messages.STORE.serialize_cdr(same, kind))
    assert (cloud.point_num, cloud.timebase) == (count, START_NS)


def test_clouds_of_older_runs_have_no_intensity():
    plain = np.zeros(4, dtype=PLAIN_POINT)
    plain["range"], plain["x"] = 2.0, 2.0
    records = _records(_cloud("generic", plain))
    assert not records["intensity"].any()
    np.testing.assert_array_equal(records["return"], 1)
    np.testing.assert_array_equal(records["x"], 2.0)


def test_a_cloud_before_1970_has_negative_times():
    for layout, least in (("generic", -0.1), ("ouster", 0.0)):
        (cloud,) = of_sensors.cloud_messages("lidar", 0, _points(), 16, 10.0, layout).values()
        assert (cloud.header.stamp.sec, cloud.header.stamp.nanosec) == (0, 0)
        times = _records(cloud)["time" if layout == "generic" else "t"]
        assert times[0] == pytest.approx(least)


SCANNERS = (
    LaserScanner.lms200(1.0), LaserScanner.lms200(0.5), LaserScanner.lms200(0.25),
    LaserScanner.usarsim(), LaserScanner(field_of_view_deg=270.0, resolution_deg=0.25),
    LaserScanner(field_of_view_deg=360.0, resolution_deg=1.0),
    LaserScanner(field_of_view_deg=359.0, resolution_deg=1.0),
    LaserScanner(field_of_view_deg=360.0, resolution_deg=0.33),
)  # fmt: skip


@pytest.mark.parametrize("scanner", SCANNERS, ids=repr)
def test_slam_toolbox_expects_as_many_ranges_as_a_scan_has(scanner):
    """Its formula, with the message's float32: src/laser_utils.cpp and Karto.h, `Update`."""
    ranges_m = np.ones(scanner.beams)
    limits_m = scanner.range_min_m, scanner.range_max_m
    found = of_sensors.scan_messages("laser", 0, scanner.angles_rad, ranges_m, limits_m, 0.1)
    sent = messages.STORE.deserialize_cdr(
        messages.serialized(found["/laser/scan"]), "sensor_msgs/msg/LaserScan"
    )
    span, step = abs(sent.angle_max - sent.angle_min), sent.angle_increment
    is_full = abs(span - 2.0 * np.pi) < step - 2.0 * np.pi * np.finfo(np.float32).eps
    if span > 6.10865 and round(span / step) + 1 == len(sent.ranges):
        is_full = False
    assert round(span / step + (0 if is_full else 1)) == len(sent.ranges) == scanner.beams
    assert (sent.time_increment, sent.scan_time) == (0.0, pytest.approx(0.1))


def test_the_clock_comes_before_each_moment(fast_run, tmp_path):
    reader = pytest.importorskip("rosbags.highlevel")
    settings = ExportSettings(START_NS, with_map=False)
    list(export_run(fast_run, "ros2-mcap", tmp_path / "bag", settings))
    with reader.AnyReader([tmp_path / "bag"]) as bag:
        sent = [(one, time, data) for one, time, data in bag.messages()]
        stores = {one.topic for one, *_ in sent}
        clocks = [bag.deserialize(data, one.msgtype).clock for one, _, data in sent
                  if one.topic == "/clock"]  # fmt: skip
        frames = {
            frame
            for one, _, data in sent if one.topic == "/tf"
            for transform in bag.deserialize(data, one.msgtype).transforms
            for frame in (transform.header.frame_id, transform.child_frame_id)
        }  # fmt: skip
    assert {"/clock", "/ground_truth/odom", "/lidar/points"} <= stores
    assert frames == {"odom", "base_link"}
    times_ns = [clock.sec * 1_000_000_000 + clock.nanosec for clock in clocks]
    assert np.all(np.diff(times_ns) > 0)
    assert set(times_ns) == {time for _, time, _ in sent}
    seen = -1
    for one, time, _ in sent:
        if one.topic == "/clock":
            seen = time
        elif one.topic != "/tf_static" and not re.search("calibration|labels", one.topic):
            assert time == seen, one.topic


@pytest.mark.usefixtures("needs_opengl")
def test_kiss_icps_own_reader_finds_points_and_times(fast_run, tmp_path):
    reader = pytest.importorskip("rosbags.highlevel")
    read_point_cloud = pytest.importorskip("kiss_icp.tools.point_cloud2").read_point_cloud
    expected = read_cloud(fast_run / "lidar" / "000003.ply")
    for layout in (name for name in LAYOUTS if name != "livox-custom"):
        folder, settings = tmp_path / layout, ExportSettings(START_NS, cloud_layout=layout)
        list(export_run(fast_run, "ros2-sqlite", folder, settings))
        with reader.AnyReader([folder]) as bag:
            (clouds,) = [one for one in bag.connections if one.topic == "/lidar/points"]
            sent = [bag.deserialize(data, one.msgtype) for one, _, data in bag.messages([clouds])]
        points_m, times = read_point_cloud(sent[3])
        np.testing.assert_array_equal(points_m, expected.points_m)
        shares = (times - times.min()) / np.ptp(times)  # as its node normalizes them
        np.testing.assert_allclose(
            shares, expected.points["time"] / np.ptp(expected.points["time"]), atol=5e-6
        )


@pytest.mark.usefixtures("needs_opengl")
def test_a_damaged_number_of_rings_is_refused(fast_run, tmp_path):
    run = tmp_path / "run"
    shutil.copytree(fast_run, run)
    cloud = run / "lidar" / "000002.ply"
    content = re.sub(rb"elevations_deg: \[[^\]]*\]", b"elevations_deg: 16", cloud.read_bytes())
    cloud.write_bytes(content)
    with pytest.raises(RunError, match=r"000002\.ply: elevations_deg: expected a list, got 16"):
        list(export_run(run, "ros2-mcap", tmp_path / "bag"))
    assert not (tmp_path / "bag").exists()


def test_types_that_are_no_reading_are_refused():
    with pytest.raises(TypeError, match="front: there is no message for SimpleNamespace"):
        of_sensors.of_reading("front", SimpleNamespace(), 0)
