"""Recordings of served robots, read by the package mcap: whole, cut short, and on a full disk."""

import os
import resource
import signal
import subprocess
import sys
import time
from contextlib import suppress

import numpy as np
import pytest

pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
pytest.importorskip("mcap", reason="mcap is not installed")
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader

from omnisim.core.errors import NoticeWarning, OutputError
from omnisim.datasets.export.ros2 import ros_messages
from omnisim.serve.protocols import mcap_recorder
from omnisim.serve.protocols.mcap_recorder import McapRecorder
from tests.serve import fake_robot
from tests.serve.foxglove_client import decoder


def opened(path):
    recorder = McapRecorder(path)
    recorder.open(fake_robot.topics(), fake_robot.FakeControls())
    return recorder


def record(recorder, *stamps_ns):
    for stamp_ns in stamps_ns:
        recorder.publish("/clock", stamp_ns, None)
        for topic, message in fake_robot.messages(stamp_ns).items():
            assert recorder.wants(topic)
            recorder.publish(topic, stamp_ns, message)


def read(path):
    """Topic, log time and decoded message of all messages."""
    found = []
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            about = {
                "encoding": channel.message_encoding, "schemaEncoding": schema.encoding,
                "schemaName": schema.name,
                "schema": schema.data if schema.encoding == "protobuf" else schema.data.decode(),
            }  # fmt: skip
            found.append((channel.topic, message.log_time, decoder(about)(message.data)))
    return found


def test_all_messages_are_recorded_with_their_stamps(tmp_path):
    path = tmp_path / "new" / "drive.mcap"
    recorder = opened(path)
    record(recorder, 1_000_000_000, 1_100_000_000)
    assert not path.exists()
    recorder.close()
    recorder.close()
    assert os.listdir(path.parent) == ["drive.mcap"]
    found = read(path)
    expected = [
        (topic, t) for t in (1_000_000_000, 1_100_000_000) for topic in fake_robot.messages()
    ]
    assert sorted(one[:2] for one in found) == sorted(expected)
    by_topic = {topic: message for topic, _, message in found}
    sent = fake_robot.messages()
    assert by_topic["/front/image_raw"].data == sent["/front/image_raw"].data.tobytes()
    assert by_topic["/front/camera_info"].distortion_model == "kannala_brandt"
    assert by_topic["/imu/data_raw"].linear_acceleration.z == 9.81
    assert not recorder.wants("/odom")


def test_a_reset_begins_another_file_with_the_latched_messages(tmp_path):
    recorder = opened(tmp_path / "drive.mcap")
    record(recorder, 5_000_000_000)
    recorder.publish("/clock", 0, None)
    recorder.publish("/odom", 0, fake_robot.messages(0)["/odom"])
    recorder.close()
    assert len(read(tmp_path / "drive.mcap")) == len(fake_robot.messages())
    found = [(topic, time_ns) for topic, time_ns, _ in read(tmp_path / "drive-2.mcap")]
    assert sorted(found) == sorted((topic, 0) for topic in (*fake_robot.LATCHED, "/odom"))
    assert len(os.listdir(tmp_path)) == 2


@pytest.mark.parametrize("name", ["drive.mcap", "drive.partial.mcap"])
def test_nothing_is_overwritten(tmp_path, name):
    (tmp_path / name).write_text("kept")
    with pytest.raises(OutputError, match=rf"{name}: already exists; choose a new name"):
        opened(tmp_path / "drive.mcap")
    assert (tmp_path / name).read_text() == "kept"


def test_wrong_names_are_one_line(tmp_path):
    with pytest.raises(OutputError, match=r"expected a name that ends in \.mcap"):
        opened(tmp_path / "drive.bag")
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot be"):
        opened(tmp_path / "file" / "drive.mcap")


KILLED = """
import sys, time
from pathlib import Path
from omnisim.serve.protocols import mcap_recorder
from tests.serve.test_mcap_recorder import opened, record
mcap_recorder.FLUSH_S = 0.05
recorder = opened(Path(sys.argv[1]))
for number in range(1_000_000):
    record(recorder, number * 100_000_000)
    print(number, flush=True)
    time.sleep(0.02)
"""


@pytest.mark.slow
def test_what_a_killed_process_leaves_can_be_recovered(tmp_path):
    """`mcap recover` reads the chunks from the beginning, as is done here."""
    command = [sys.executable, "-c", KILLED, str(tmp_path / "drive.mcap")]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        for line in process.stdout:
            if int(line) == 20:
                process.send_signal(signal.SIGKILL)
    assert os.listdir(tmp_path) == ["drive.partial.mcap"]
    times_ns = []
    with (tmp_path / "drive.partial.mcap").open("rb") as file:
        records = StreamReader(file, validate_crcs=True).records
        with suppress(McapError):  # where it was cut
            times_ns.extend(found.log_time for found in records if isinstance(found, Message))
    assert max(times_ns) >= 1_500_000_000  # 16 of 21


def test_a_full_disk_ends_the_recording_alone(tmp_path, monkeypatch):
    """A file beyond the limit of the process stands for a full disk."""
    monkeypatch.setattr(mcap_recorder, "FLUSH_S", 0.0)
    recorder = opened(tmp_path / "drive.mcap")
    noise = np.random.default_rng(1).integers(0, 256, (48, 64, 3), np.uint8)
    image = ros_messages.image(0, "camera", noise)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, before[1]))
    text = r"drive\.partial\.mcap: the recording ends here: .*[Ff]ile too large|.*MCAP"

    def publish():
        for number in range(30):  # 9 kB each
            recorder.publish("/front/image_raw", number, image)

    try:
        with pytest.warns(NoticeWarning, match=text) as warned:
            publish()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert len(warned) == 1
    assert not recorder.wants("/odom")
    recorder.close()
    assert os.listdir(tmp_path) == ["drive.partial.mcap"]


def test_a_server_and_a_recording_share_nothing(tmp_path):
    """Topics that only the recording wants reach no client, and vice versa."""
    from omnisim.serve.protocols.foxglove_publisher import FoxglovePublisher

    server, recorder = FoxglovePublisher(port=0), opened(tmp_path / "drive.mcap")
    server.open(fake_robot.topics(), fake_robot.FakeControls())
    assert recorder.wants("/odom")
    assert not server.wants("/odom")
    began_s = time.monotonic()
    server.close()
    recorder.close()
    assert time.monotonic() - began_s < 5.0
