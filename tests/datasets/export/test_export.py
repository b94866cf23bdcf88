"""Exports of runs, whatever the format: whole or not at all, and errors in one line."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from omnisim.apps.cli.runs.export import parse_start_time
from omnisim.cameras.optics import read_optics_file
from omnisim.core.errors import OmnisimError, OutputError
from omnisim.core.extras import missing_packages
from omnisim.core.files.atomic_file import atomic_folder, partials, remove_partials
from omnisim.core.files.image_files import read_image
from omnisim.core.poses import pose
from omnisim.core.trajectories import Trajectory
from omnisim.core.trajectories.odometry import OdometryErrors
from omnisim.datasets.export.export import export_run
from omnisim.datasets.export.export_format import ExportSettings
from omnisim.datasets.export.export_formats import FORMATS, format_named
from omnisim.datasets.export.recording import RecordedCamera, Recording
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.sensor import Mount
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.scene import load_scene

NOON_NS = 1_769_860_800_000_000_000  # of 31 January 2026
EXAMPLES = Path(__file__).resolve().parents[3] / "examples"


def test_every_format_of_the_registry_is_found_by_its_name():
    for name, entry in FORMATS.items():
        if entry.extra is None or not missing_packages(entry.extra):
            assert format_named(name).name == name


def _fill(folder):
    assert folder.name == "out"
    (folder / "half").write_text("half")
    assert not (folder.parent.parent / "out").exists()
    raise OSError(28, "disk is full")


def test_a_folder_is_there_whole_or_not_at_all(tmp_path):
    writing = atomic_folder(tmp_path / "out")
    with (
        pytest.raises(OutputError, match="out: cannot be written: disk is full"),
        writing as folder,
    ):
        _fill(folder)
    assert not any(tmp_path.iterdir())
    with atomic_folder(tmp_path / "out") as folder:
        (folder / "whole").write_text("whole")
    assert [file.name for file in tmp_path.iterdir()] == ["out"]
    assert (tmp_path / "out" / "whole").read_text() == "whole"


def test_the_end_of_the_process_removes_folders_that_are_being_written(tmp_path):
    writing = atomic_folder(tmp_path / "out")
    (writing.__enter__() / "half").write_text("half")
    remove_partials()
    assert not any(tmp_path.iterdir())
    assert not partials


@pytest.mark.parametrize(
    ("text", "stamp_ns"),
    [("0", 0), ("1.5", 1_500_000_000), ("2026-01-31T12:00:00", NOON_NS),
     ("2026-01-31T13:00:00+01:00", NOON_NS), ("2026-01-31", NOON_NS - 43_200_000_000_000),
     ("1769860800.123456789", NOON_NS + 123_456_789),
     ("2026-01-31T12:00:00.123456+00:00", NOON_NS + 123_456_000)],
)  # fmt: skip
def test_start_times_are_seconds_or_dates_to_the_nanosecond(text, stamp_ns):
    assert parse_start_time(text) == stamp_ns


@pytest.mark.parametrize("text", ["noon", "-1", "1e400", "", "3000000000", "1969-12-31", "1_000"])
def test_impossible_start_times_are_refused(text):
    with pytest.raises(OmnisimError, match=r"--start-time .*: expected seconds since 1970"):
        parse_start_time(text)


@pytest.mark.usefixtures("needs_opengl")
class TestRefusals:
    def test_of_a_run_that_is_not_finished(self, run, tmp_path):
        shutil.copytree(run, tmp_path / "run")
        (tmp_path / "run" / "front" / "000002.png").unlink()
        with pytest.raises(OmnisimError, match=r"000002\.png: is missing: expected a finished run"):
            list(export_run(tmp_path / "run", "ros2-mcap", tmp_path / "out"))
        assert not (tmp_path / "out").exists()

    @pytest.mark.parametrize("format", FORMATS)
    def test_of_a_damaged_image_or_table_leave_nothing(self, run, tmp_path, format):
        shutil.copytree(run, tmp_path / "run")
        for name in ("front/000003.png", "front/calibration.json", "imu/sensor.yaml"):
            (tmp_path / "run" / name).write_text("damaged")
        with pytest.raises(OmnisimError):
            list(export_run(tmp_path / "run", format, tmp_path / "out", camera_name="front"))
        assert [file.name for file in tmp_path.iterdir()] == ["run"]

    @pytest.mark.parametrize(
        ("format", "settings", "option"),
        [
            ("euroc", {"compressed": True}, "--compressed"),
            ("tum", {"with_points": True}, "--points"),
            ("kitti", {"cloud_layout": "velodyne"}, "--cloud-layout"),
            ("euroc", {"with_map": False}, "--no-map"),
            ("colmap", {"start_ns": 1}, "--start-time"),
        ],
    )
    def test_of_options_that_a_format_has_no_use_for(self, run, tmp_path, format, settings, option):
        with pytest.raises(OmnisimError, match=f"{option}: requires --to .*, got --to {format}"):
            list(export_run(run, format, tmp_path / "out", ExportSettings(**settings)))

    def test_of_folders_and_cameras(self, run, tmp_path):
        (tmp_path / "there").mkdir()
        (tmp_path / "file").touch()
        for output, camera, words in (
            (tmp_path / "there", None, "there: already exists: expected the name of a new"),
            (run / "out", None, "is inside the run"),
            (tmp_path / "file" / "out", None, "file: is a file: expected a folder"),
            (tmp_path / "out", "fron", "camera 'fron': not found; did you mean 'front'"),
        ):
            with pytest.raises(OmnisimError, match=words):
                list(export_run(run, "ros2-mcap", output, camera_name=camera))


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize("format", FORMATS)
def test_sensors_and_channels_that_a_format_has_no_place_for_are_named(run, tmp_path, format):
    """The run's sensors beside cameras, and its channels, are taken or named in a note."""
    extra = FORMATS[format].extra
    if extra is not None and missing_packages(extra):
        pytest.skip(f"the extra {extra} is not installed")
    notes = []
    list(export_run(run, format, tmp_path / "out", None, "front", notes.append))
    form = format_named(format)
    sensors = [note for note in notes if "cannot hold" in note and "channels" not in note]
    channels = [note for note in notes if "cannot hold the channels" in note]
    if format.startswith("ros2"):
        assert not sensors
        assert channels == [f"{format} cannot hold the channels flow, occluded: left out"]
    else:
        assert "laser" in sensors[0]
        assert ("lidar" in sensors[0]) == (format not in ("kitti", "kitti360"))
        named = "".join(channels).partition("channels ")[2].partition(":")[0].split(", ")
        recorded = {"range", "semantic", "instance", "flow", "occluded"}
        assert set(named) == recorded - set(form.channels)


@pytest.fixture
def without(run, tmp_path):
    """Runs as the drive's robot without some of its sensors records them."""

    def remove(*left_out):
        folder = tmp_path / "run"
        shutil.copytree(run, folder)
        manifest = json.loads((folder / "manifest.json").read_text())
        for name in left_out:
            del manifest["sensors"][name]
            shutil.rmtree(folder / name)
        manifest["channels"] = []
        (folder / "manifest.json").write_text(json.dumps(manifest))
        return folder

    return remove


CAMERAS = "front", "fisheye", "mirror"


@pytest.mark.usefixtures("needs_opengl")
class TestWithoutCameras:
    @pytest.mark.parametrize(
        ("format", "held", "file"),
        [("kitti", "lidar", "sequences/00/velodyne/000003.bin"),
         ("kitti360", "lidar", "calibration/calib_cam_to_velo.txt"),
         ("euroc", "imu", "mav0/imu0/data.csv"), ("tum", "kinect", "depth/1.500000000.png")],
    )  # fmt: skip
    def test_formats_take_what_they_have_a_place_for(self, without, tmp_path, format, held, file):
        notes, folder = [], without(*CAMERAS)
        list(export_run(folder, format, tmp_path / "out", print_note=notes.append))
        names = {"imu", "kinect", "laser", "lidar", "sonar"} - {held}
        assert f"{format} cannot hold {', '.join(sorted(names))}: left out" in notes
        assert (tmp_path / "out" / file).stat().st_size > 0
        assert not list((tmp_path / "out").rglob("*image*")) + list((tmp_path / "out").rglob("rgb"))

    def test_a_bag_has_all_sensors(self, without, tmp_path):
        reader = pytest.importorskip("mcap_ros2.reader")
        list(export_run(without(*CAMERAS), "ros2-mcap", tmp_path / "out"))
        messages = reader.read_ros2_messages(str(tmp_path / "out" / "out.mcap"))
        assert {message.channel.topic for message in messages} >= {
            "/lidar/points", "/imu/data_raw", "/kinect/depth/image_rect", "/laser/scan",
            "/sonar/range", "/odom", "/ground_truth/pose",
        }  # fmt: skip

    @pytest.mark.parametrize("format", ["nerfstudio", "colmap", "tartanair"])
    def test_formats_that_hold_nothing_of_a_run_refuse_it(self, without, tmp_path, format):
        expected = f"a sensor of type omnicamera for {format}, got imu, kinect, laser, lidar, sonar"
        with pytest.raises(OmnisimError, match=expected):
            list(export_run(without(*CAMERAS), format, tmp_path / "out"))
        assert not (tmp_path / "out").exists()

    def test_types_that_a_format_holds_are_named(self, without, tmp_path):
        folder = without(*CAMERAS, "kinect", "lidar", "imu")
        expected = "of type omnicamera or depth_camera for tum, got laser, sonar"
        with pytest.raises(OmnisimError, match=expected):
            list(export_run(folder, "tum", tmp_path / "out"))

    def test_depths_are_the_cameras_own(self, without, run, tmp_path):
        """Millimeters of the run as 5000ths of a meter; +inf, 0."""
        list(export_run(without(*CAMERAS), "tum", tmp_path / "out"))
        own = read_image(run / "kinect" / "000001.png")[0][..., 0].astype(int)
        depths = read_image(tmp_path / "out" / "depth" / "0.500000000.png")[0][..., 0]
        np.testing.assert_array_equal(depths, np.where(own * 5 < 65536, own * 5, 0))


@pytest.mark.usefixtures("needs_opengl")
def test_an_interrupted_export_leaves_nothing(run, tmp_path, monkeypatch):
    def interrupt(self, step):
        raise KeyboardInterrupt

    monkeypatch.setattr(RecordedCamera, "image", interrupt)
    with pytest.raises(KeyboardInterrupt):
        list(export_run(run, "ros2-mcap", tmp_path / "out"))
    assert not any(tmp_path.iterdir())


@pytest.fixture(scope="module")
def optics(tmp_path_factory):
    """Run of a camera without one viewpoint, two steps, with ranges."""
    model = read_optics_file(EXAMPLES / "optics" / "sphere.toml")
    camera = Mount(OmniCamera(model).resized(40), "ball", "omnicamera")
    vehicle = Vehicle("rig", "rig", None, None, OdometryErrors(), None, (camera,))
    drive = Drive(load_scene("soccer"), vehicle, Route("line"), channels=("range",))
    poses = np.array([pose((x, 0.0, 0.6)) for x in (0.0, 0.2)])
    folder = tmp_path_factory.mktemp("optics") / "run"
    list(drive.along(Trajectory(np.array([0.0, 0.5]), poses)).record(folder))
    return folder


@pytest.mark.usefixtures("needs_opengl")
class TestOptics:
    def test_a_bag_has_their_images_ranges_and_points(self, optics, tmp_path):
        """Points of rays that do not meet in one point lie on the floor."""
        rosbags = pytest.importorskip("rosbags.highlevel")
        settings = ExportSettings(with_points=True)
        list(export_run(optics, "ros2-mcap", tmp_path / "out", settings))
        recorded = Recording.read(optics).cameras[0]
        with rosbags.AnyReader([tmp_path / "out"]) as reader:
            assert {connection.topic for connection in reader.connections} == {
                "/ball/image_raw", "/ball/range", "/ball/points", "/ball/calibration", "/tf",
                "/tf_static", "/ground_truth/pose", "/ground_truth/odom", "/clock",
            }  # fmt: skip
            (clouds,) = [one for one in reader.connections if one.topic == "/ball/points"]
            _, _, data = next(reader.messages([clouds]))
            cloud = reader.deserialize(data, clouds.msgtype)
        points_m = np.frombuffer(cloud.data.tobytes(), "<f4").reshape(-1, 4)[:, :3]
        world_from_optical = pose((0.0, 0.0, 0.6)) @ recorded.mount.base_from_optical
        heights_m = points_m @ world_from_optical[2, :3] + world_from_optical[2, 3]
        assert np.mean(np.abs(heights_m) < 1e-3) > 0.3
        assert heights_m.min() > -0.3

    @pytest.mark.parametrize("format", [name for name in FORMATS if not name.startswith("ros2")])
    def test_formats_of_lenses_refuse_them(self, optics, tmp_path, format):
        expected = "central camera, got optics|that is a pinhole, or a lidar, for kitti, got ball"
        with pytest.raises(OmnisimError, match=expected):
            list(export_run(optics, format, tmp_path / "out"))
        assert not any(tmp_path.iterdir())
