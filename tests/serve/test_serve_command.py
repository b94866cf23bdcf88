"""`omnisim serve` as a process: several robots, a run played back, and the files that it writes."""

import numpy as np
import pytest
from click.testing import CliRunner

pytest.importorskip("rosbags", reason="rosbags is not installed")

from omnisim.apps.cli.app import app
from omnisim.core.files.image_files import read_image
from omnisim.serve import ServeConnectionError, connect
from tests.serve.server_process import serving

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("needs_opengl")]
IMAGE = ("--size", "64", "--quality", "fast")
LOCKSTEP = ("--protocols", "plain", "--lockstep")


def _omnisim(*words):
    done = CliRunner().invoke(app, [str(word) for word in words])
    assert done.exit_code == 0, done.output


def _received(robot):
    messages = {}
    while (message := robot.next()) is not None:
        messages.setdefault(message.topic, []).append(message)
    return messages


def _positions_m(messages):
    """Positions (n, 2) of odometry messages."""
    found = (message.fields["pose"]["pose"]["position"] for message in messages)
    return np.array([(position["x"], position["y"]) for position in found])


def _recorded(path):
    """Numbers of an MCAP file's messages by topic."""
    reader = pytest.importorskip("mcap.reader", reason="mcap is not installed")
    with path.open("rb") as file:
        summary = reader.make_reader(file, validate_crcs=True).get_summary()
        counts = summary.statistics.channel_message_counts
        return {summary.channels[number].topic: count for number, count in counts.items()}


@pytest.mark.long
def test_several_robots_have_prefixes_and_a_drive_repeats_the_first(tmp_path):
    pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
    words = ("red=p2at", "blue=p2at", *LOCKSTEP, *IMAGE, "--rate", 5, "--at", -1, 0, "--yaw", 30)
    files = ("--commands", "red.csv", "--record", "both.mcap")
    with serving(tmp_path, *words, *files) as address, connect(address, ["*"]) as robots:
        assert robots.about["robots"] == ["red", "blue"]
        for command in ((0.5, 0.4), (0.3, -0.6)):
            robots.command(*command)  # the first
            robots.command(-0.2, 0.0, robot="blue")
            robots.step(0.4)
        messages = _received(robots)
        with pytest.raises(ServeConnectionError, match="no such robot"):
            robots.set_pose(0.0, 0.0, 0.0, robot="green")
    shared = {topic for topic in messages if topic.count("/") == 1}
    assert shared == {"/clock", "/tf", "/tf_static", "/map"}
    mine, other = (
        {topic.removeprefix(f"/{name}/") for topic in messages if topic.startswith(f"/{name}/")}
        for name in ("red", "blue")
    )
    assert mine == other >= {"odom", "omnicam/image_raw", "lms200/scan", "robot_description"}
    frames = {
        (each["header"]["frame_id"], each["child_frame_id"])
        for message in messages["/tf"]
        for each in message.fields["transforms"]
    }
    assert frames == {
        ("map", "red/odom"), ("red/odom", "red/base_link"),
        ("map", "blue/odom"), ("blue/odom", "blue/base_link"),
    }  # fmt: skip
    assert {each.fields["header"]["frame_id"] for each in messages["/blue/omnicam/image_raw"]} == {
        "blue/omnicam_optical_frame"
    }
    red_m, blue_m = (
        _positions_m(messages[f"/{name}/ground_truth/odom"]) for name in ("red", "blue")
    )
    assert red_m[0] == pytest.approx((-1.0, 0.0))
    assert np.linalg.norm(blue_m[-1] - blue_m[0]) > 0.05
    assert _recorded(tmp_path / "both.mcap") == {
        topic: len(each)
        for topic, each in messages.items()
        if topic != "/clock"  # log times
    }

    path = ("--path", tmp_path / "red.csv", "--rate", 5)
    _omnisim("drive", "soccer", "--robot", "p2at", *path, *IMAGE, "-o", tmp_path / "again")
    truth = np.loadtxt(tmp_path / "again/ground_truth.tum")
    np.testing.assert_allclose(red_m, truth[:, 1:3], atol=1e-6)  # printed digits


def test_a_run_is_played_back(tmp_path):
    pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
    (tmp_path / "way.csv").write_text("x_m,y_m\n0,0\n0.5,0\n")
    path = ("--path", tmp_path / "way.csv", "--rate", 2)
    _omnisim("drive", "soccer", "--robot", "p2at", *path, *IMAGE, "-o", tmp_path / "run")
    truth = np.loadtxt(tmp_path / "run/ground_truth.tum")
    end_s = float(truth[-1, 0])
    with (
        serving(tmp_path, "run", *LOCKSTEP, "--record", "run.mcap") as address,
        connect(address, ["*"]) as robot,
    ):
        with pytest.raises(ServeConnectionError, match="a run is played back"):
            robot.set_pose(0.0, 0.0, 0.0)
        robot.step(end_s)
        messages = _received(robot)
    images = messages["/omnicam/image_raw"]
    assert [image.stamp_s for image in images] == pytest.approx(truth[:, 0])
    for number, image in enumerate(images):
        recorded, _ = read_image(tmp_path / f"run/omnicam/{number:06d}.png")
        np.testing.assert_array_equal(image.image, recorded)
    assert _positions_m(messages["/ground_truth/odom"]) == pytest.approx(truth[:, 1:3], abs=1e-6)
    assert _recorded(tmp_path / "run.mcap") == {
        topic: len(each) for topic, each in messages.items() if topic != "/clock"
    }
