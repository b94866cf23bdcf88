import math

import numpy as np
import pytest

from omnisim.core.errors import OutputError, TrajectoryError
from omnisim.core.poses import pose, rotation_from_quaternion
from omnisim.core.trajectories.formats.pose_csv import heading_along
from omnisim.core.trajectories.trajectory import Trajectory
from omnisim.core.trajectories.trajectory_files import (
    FORMATS,
    parse_trajectory,
    read_trajectory,
    write_trajectory,
)

# Half a unit of the ninth digit; rotations are brought back to length 1, radians are from degrees.
PRINTED = 0.5e-9 + 1e-15
TURNED = 1.5e-9


def _trajectory(count=300, seed=0):
    """Any rotation and any position within a kilometer."""
    rng = np.random.default_rng(seed)
    poses = np.zeros((count, 4, 4))
    poses[:, :3, :3] = rotation_from_quaternion(rng.normal(size=(count, 4)))
    poses[:, :3, 3] = rng.uniform(-1e3, 1e3, (count, 3))
    poses[:, 3, 3] = 1.0
    return Trajectory(np.cumsum(rng.uniform(1e-3, 1.0, count)), poses)


def _write(tmp_path, name, text):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize("format_name", FORMATS)
@pytest.mark.parametrize("count", [1, 300])
def test_there_and_back(tmp_path, format_name, count):
    trajectory = _trajectory(count)
    suffix = {"euroc": "csv"}.get(format_name, format_name)
    path = tmp_path / f"a.{suffix}"
    write_trajectory(path, trajectory, format_name)
    again = parse_trajectory(path)  # recognized
    if format_name == "kitti":
        assert again.times_s is None
    else:
        np.testing.assert_allclose(again.times_s, trajectory.times_s, rtol=0, atol=PRINTED)
    back, poses = again.world_from_base, trajectory.world_from_base
    np.testing.assert_allclose(back[:, :3, 3], poses[:, :3, 3], rtol=0, atol=PRINTED)
    apart = np.linalg.norm(back[:, :3, :3] - poses[:, :3, :3], axis=(1, 2)) / math.sqrt(2.0)
    assert np.max(apart) < 2 * TURNED  # an angle from half a unit in each of four or nine numbers
    again.trajectory(10.0 if format_name == "kitti" else None)  # its rotations are rotations


KITTI_AHEAD = "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0.25 0 1 0 -0.5 0 0 1 2\n"  # right, up, ahead


def test_kitti_poses_are_a_camera_s(tmp_path):
    path = _write(tmp_path, "a.kitti", KITTI_AHEAD)
    recording = parse_trajectory(path)
    assert recording.axes == "kitti"
    np.testing.assert_array_equal(recording.world_from_base[1], pose((2, -0.25, 0.5)))
    as_it_is = parse_trajectory(path, axes="world").world_from_base[1]
    np.testing.assert_array_equal(as_it_is, pose((0.25, -0.5, 2)))
    # a turn to the right is about the camera's y, down
    right = "0 0 1 0 0 1 0 0 -1 0 0 0\n"
    turned = parse_trajectory(_write(tmp_path, "b.kitti", right)).trajectory(1.0)
    np.testing.assert_allclose(np.degrees(turned.yaw_rad), [-90.0], atol=1e-12)


@pytest.mark.parametrize("format_name", ["tum", "kitti", "euroc"])
@pytest.mark.parametrize("axes", ["kitti", "world"])
def test_axes_there_and_back(tmp_path, format_name, axes):
    trajectory = _trajectory(20)
    write_trajectory(tmp_path / "a", trajectory, format_name, axes)
    # recognized by its columns, where its name has no suffix
    recognized = format_name if format_name == "euroc" else None
    back = parse_trajectory(tmp_path / "a", recognized, axes).world_from_base
    np.testing.assert_allclose(back, trajectory.world_from_base, rtol=0, atol=2 * TURNED)


def test_kitti_file_is_the_same_there_and_back(tmp_path):
    path = _write(tmp_path, "a.kitti", KITTI_AHEAD)
    write_trajectory(tmp_path / "b.kitti", read_trajectory(path, rate_hz=1.0))
    as_numbers = [np.loadtxt(tmp_path / name) for name in ("a.kitti", "b.kitti")]
    np.testing.assert_array_equal(*as_numbers)


def test_axes_that_cannot_be(tmp_path):
    path = _write(tmp_path, "a.csv", "x_m,y_m,yaw_deg\n0,0,0\n")
    with pytest.raises(TrajectoryError, match="axes 'kitti': expected world: headings of a CSV"):
        parse_trajectory(path, axes="kitti")
    with pytest.raises(TrajectoryError, match="axes 'ros': expected one of world, kitti"):
        parse_trajectory(path, axes="ros")


def test_euroc_as_published(tmp_path):
    """Stamp, order of the quaternion, a header that is a comment, line ends of Windows."""
    line = "1403636580838555648,4.688319,-1.786938,0.783338,0.5,0.5,-0.5,0.5" + 9 * ",0"
    text = f"#timestamp, p_RS_R_x [m], ...\r\n{line}\r\n"
    trajectory = read_trajectory(_write(tmp_path, "data.csv", text))
    assert trajectory.times_s[0] == pytest.approx(1403636580.838555648, abs=3e-7)
    np.testing.assert_array_equal(trajectory.positions_m[0], (4.688319, -1.786938, 0.783338))
    expected = rotation_from_quaternion((0.5, -0.5, 0.5, 0.5))
    np.testing.assert_allclose(trajectory.world_from_base[0, :3, :3], expected, atol=1e-15)


def test_euroc_writes_the_velocities_of_the_smooth_motion(tmp_path):
    path = tmp_path / "v.csv"
    even = Trajectory.on_ground([0.0, 0.5, 1.0], [(0, 0), (1, 0), (4, 0)], [0, 0, 0])
    write_trajectory(path, even, "euroc")
    rows = [line.split(",") for line in path.read_text().splitlines()[1:]]
    velocities = [tuple(map(float, row[8:11])) for row in rows]
    # accelerated by 8 m/s² from rest
    assert velocities == [(0, 0, 0), (4, 0, 0), (8, 0, 0)]
    assert {len(row) for row in rows} == {17}


def test_header_in_any_order_and_spaced(tmp_path):
    path = _write(tmp_path, "a.csv", "\ufeff# a comment\n\nyaw_deg, y_m ,x_m,t_s\n90, 2, 1, 0.5\n")
    trajectory = read_trajectory(path)
    np.testing.assert_allclose(trajectory.world_from_base[0], pose((1, 2, 0), yaw_deg=90))
    assert trajectory.times_s[0] == 0.5


def test_csv_has_all_three_angles(tmp_path):
    path = _write(tmp_path, "a.csv", "x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg\n1,2,3,10,20,30\n")
    expected = pose((1, 2, 3), roll_deg=10, pitch_deg=20, yaw_deg=30)
    np.testing.assert_allclose(parse_trajectory(path).world_from_base[0], expected)


def test_without_yaw_it_looks_along_its_path(tmp_path):
    path = _write(tmp_path, "a.csv", "x_m,y_m\n0,0\n1,0\n1,0\n1,2\n0,2\n0,2\n")
    recording = parse_trajectory(path)
    assert recording.times_s is None
    yaw = np.degrees(recording.trajectory(1.0).yaw_rad)
    np.testing.assert_allclose(yaw, (0, 90, 90, 180, 180, 180), atol=1e-13)


def test_heading_of_what_stands_still():
    np.testing.assert_array_equal(heading_along(np.ones((4, 2))), np.zeros(4))


@pytest.mark.parametrize(
    "text",
    [
        "a/0001.png 1 2 3 0 0 0 1\nb.jpg 4 5 6 0 0 0 1\n",
        "image,x_m,y_m,z_m,yaw_deg\na/0001.png,1,2,3,0\nb.jpg,4,5,6,0\n",
        "x_m,y_m,z_m,yaw_deg,image\n1,2,3,0,a/0001.png\n4,5,6,0,b.jpg\n",
    ],
)
def test_poses_with_names_of_images(tmp_path, text):
    parsed = parse_trajectory(_write(tmp_path, "poses.txt", text))
    assert parsed.names == ("a/0001.png", "b.jpg")
    assert parsed.times_s is None
    assert parsed.world_from_base[:, :3, 3].tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]


def test_rate(tmp_path):
    path = tmp_path / "a.kitti"
    write_trajectory(path, _trajectory(5))
    np.testing.assert_allclose(read_trajectory(path, rate_hz=4.0).times_s, (0, 0.25, 0.5, 0.75, 1))
    with pytest.raises(TrajectoryError, match=r"a\.kitti: has no times: expected a rate in Hz, or"):
        read_trajectory(path)
    for rate_hz in (0.0, math.nan, math.inf, 1e-300):
        with pytest.raises(TrajectoryError, match="expected a finite number above 0"):
            read_trajectory(path, rate_hz=rate_hz)
    timed = _write(tmp_path, "b.tum", "0 0 0 0 0 0 0 1\n")
    with pytest.raises(TrajectoryError, match=r"b\.tum: has times of its own: expected no rate"):
        read_trajectory(timed, rate_hz=1.0)


def test_jump_is_named_by_its_line(tmp_path):
    path = _write(tmp_path, "a.tum", "# t\n0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n\n2 9 0 0 0 0 0 1\n")
    with pytest.raises(TrajectoryError, match=r"a\.tum:5: step 1 → 2: 8 m in 1 s: .* most 2 m$"):
        read_trajectory(path, max_step_m=2.0)
    with pytest.raises(TrajectoryError, match=r"a\.tum:5: step 1 → 2: .* most 1\.2 m/s$"):
        read_trajectory(path, max_speed_mps=1.2)


def test_quaternion_is_normalized_within_a_thousandth(tmp_path):
    path = _write(tmp_path, "a.tum", "0 0 0 0 0 0 0 1.0009\n1 0 0 0 0 0 0.7071 0.7071\n")
    trajectory = read_trajectory(path)
    np.testing.assert_allclose(np.degrees(trajectory.yaw_rad), (0, 90), atol=1e-12)


GOOD = "0 0 0 0 0 0 0 1\n"
EUROC = "0,0,0,0,1,0,0,0" + ",0" * 9 + "\n"
KITTI = "1 0 0 0 0 1 0 0 0 0 1 0\n"


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.tum", "", r"a\.tum: empty: expected at least one line of numbers"),
        ("a.csv", "t_s,x_m,y_m\n", r"a\.csv: only a header"),
        ("a.tum", b"\x89PNG\r\n\x1a\n\0\0", r"a\.tum: not a text file"),
        ("a.tum", b"\xff\xfe0\x000\x00", r"a\.tum: not a text file"),
        ("a.tum", GOOD + "1 x 0 0 0 0 0 1", r"a\.tum:2: x = 'x': expected a number"),
        ("a.tum", GOOD + "1 ١ 0 0 0 0 0 1", r"a\.tum:2: x = '١': expected a number"),
        ("a.tum", GOOD + "1 0 nan 0 0 0 0 1", r"a\.tum:2: y = nan: expected a finite number"),
        ("a.tum", GOOD + "1 0 0 1e999 0 0 0 1", r"a\.tum:2: z = 1e999: expected less than 1e\+20"),
        ("a.tum", "1 0 0 1e16 0 0 0 1", r"a\.tum:1: position .*: expected less than 1e\+15 m"),
        ("a.tum", GOOD + "1 0 0 0 0 0 1", r"a\.tum:2: 7 columns: expected 8: t x y z qx qy qz qw"),
        ("a.tum", GOOD + "0 0 0 0 0 0 0 1", r"a\.tum:2: time 0 s repeats 0 s of line 1"),
        ("a.tum", GOOD + "-1 0 0 0 0 0 0 1", r"a\.tum:2: time -1 s is before 0 s of line 1"),
        ("a.tum", "1e13 0 0 0 0 0 0 1", r"a\.tum:1: time 1e\+13 s: expected less than 1e\+12 s"),
        ("a.tum", "0 0 0 0 0 0 0 1.002", r"a\.tum:1: quaternion of length 1\.002: expected 1"),
        ("a.kitti", GOOD, r"a\.kitti:1: 8 columns: expected 12: x0 y0 z0 t0 x1"),
        ("a.kitti", KITTI + KITTI.replace("1", "2"), r"a\.kitti:2: the matrix scales, shears"),
        ("a.kitti", KITTI.replace("1", "1e18"), r"a\.kitti:1: the matrix scales"),
        ("a.csv", EUROC + EUROC, r"a\.csv:2: time 0 ns repeats 0 ns of line 1"),
        ("a.csv", "1.5" + EUROC, r"a\.csv:1: timestamp = 1\.50: expected whole nanoseconds"),
        ("a.csv", EUROC + "1,2,3\n", r"a\.csv:2: 3 columns: expected 17: timestamp p_x"),
        ("a.csv", "t_s,x_m,y_m\n0,0,0\n0,0,0\n", r"a\.csv:3: time 0 s repeats 0 s of line 2"),
        ("a.csv", "t_s,x_m\n0,0\n", r"a\.csv:1: no column 'y_m': expected at least x_m and y_m"),
        ("a.csv", "x_m,y_m,x_m\n0,0,0\n", r"a\.csv:1: column 'x_m' appears twice"),
        ("a.csv", "x_m,y_m,yaw\n0,0,0\n", r"a\.csv:1: column 'yaw': did you mean 'yaw_deg'\?"),
        ("a.csv", "x_m,y_m,!\n0,0,0\n", r"a\.csv:1: column '!': expected one of t_s, x_m, y_m"),
        ("a.csv", GOOD, r"a\.csv:1: 8 space-separated columns, first '0': expected 8"),
        ("a.txt", "1 2 3\n", r"a\.txt:1: 3 space-separated columns, first '1': expected 8 space-"),
        ("a.txt", "0,0,0\n", r"a\.txt:1: 3 comma-separated columns, first '0': expected"),
        ("a.txt", "x" * 9999, r"a\.txt:1: 1 space-separated column, first 'x{40}…'"),
    ],
)
def test_bad_files(tmp_path, name, text, words):
    path = _write(tmp_path, name, text)
    with pytest.raises(TrajectoryError, match=words) as caught:
        read_trajectory(path)
    assert "\n" not in str(caught.value)


def test_file_that_is_not_there(tmp_path):
    with pytest.raises(TrajectoryError, match=r"none\.tum: cannot be read: No such file"):
        read_trajectory(tmp_path / "none.tum")
    with pytest.raises(TrajectoryError, match="cannot be read: Is a directory"):
        read_trajectory(tmp_path)


def test_format_must_be_known(tmp_path):
    with pytest.raises(TrajectoryError, match=r"suffix '\.txt' names no format: expected \.tum"):
        write_trajectory(tmp_path / "a.txt", _trajectory(2))
    message = "format 'tumm': expected one of tum, kitti, euroc, csv"
    with pytest.raises(TrajectoryError, match=message):
        write_trajectory(tmp_path / "a.txt", _trajectory(2), "tumm")
    with pytest.raises(TrajectoryError, match="format 'tumm'"):
        read_trajectory(_write(tmp_path, "a.txt", GOOD), format_name="tumm")


@pytest.mark.parametrize("format_name", ["tum", "euroc", "csv"])
def test_what_cannot_be_written_leaves_the_old_file(tmp_path, format_name):
    path = _write(tmp_path, "a.csv", "old")
    close = Trajectory([0.0, 1e-10], np.stack((pose(), pose())))
    with pytest.raises(TrajectoryError, match="times 0 and 1 are less than a nanosecond apart"):
        write_trajectory(path, close, format_name)
    assert path.read_text() == "old"


def test_no_folder_to_write_to(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="file: is a file: expected a folder"):
        write_trajectory(tmp_path / "file" / "a.tum", _trajectory(2))
