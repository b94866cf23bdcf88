"""The MCAP file of a bag, read by Foxglove's JavaScript packages, where they are installed.

`npm install @mcap/core @foxglove/rosmsg @foxglove/rosmsg2-serialization` in any folder, whose
node_modules NODE_PATH names.
"""

import json
import shutil
import subprocess

import pytest

from omnisim.datasets.export.export import export_run
from omnisim.datasets.export.export_format import ExportSettings
from omnisim.datasets.export.recording import Recording

pytestmark = pytest.mark.usefixtures("needs_opengl")
PACKAGES = ("@mcap/core", "@foxglove/rosmsg", "@foxglove/rosmsg2-serialization")
READER = """
const fs = require("fs");
const { McapIndexedReader } = require("@mcap/core");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");
async function main(path) {
  const content = fs.readFileSync(path);
  const readable = {
    size: async () => BigInt(content.length),
    read: async (offset, size) =>
      new Uint8Array(content.buffer, content.byteOffset + Number(offset), Number(size)),
  };
  const reader = await McapIndexedReader.Initialize({ readable });
  const readers = new Map(), topics = {};
  for await (const message of reader.readMessages()) {
    const channel = reader.channelsById.get(message.channelId);
    const schema = reader.schemasById.get(channel.schemaId);
    if (!readers.has(schema.id)) {
      const text = new TextDecoder().decode(schema.data);
      readers.set(schema.id, new MessageReader(parse(text, { ros2: true })));
    }
    const found = readers.get(schema.id).readMessage(message.data);
    const topic = (topics[channel.topic] ??= { type: schema.name, count: 0 });
    topic.count += 1;
    topic.first ??= JSON.parse(JSON.stringify(found, (key, value) =>
      ArrayBuffer.isView(value) ? Array.from(value).slice(0, 20000) : value));
  }
  console.log(JSON.stringify(topics));
}
main(process.argv[1]);
"""


def _node(*arguments):
    return subprocess.run(
        [shutil.which("node") or "node", "-e", *arguments],
        capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.fixture(scope="module")
def topics(run, tmp_path_factory):
    pytest.importorskip("rosbags")
    if shutil.which("node") is None:
        pytest.skip("Node.js is not installed")
    needed = "; ".join(f"require('{package}')" for package in PACKAGES)
    if _node(needed).returncode:
        pytest.skip(f"{', '.join(PACKAGES)} are not installed where NODE_PATH points")
    folder = tmp_path_factory.mktemp("foxglove") / "cart"
    list(export_run(run, "ros2-mcap", folder, ExportSettings(with_points=True)))
    done = _node(READER, str(folder / "cart.mcap"))
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_all_topics_are_read_with_their_messages(topics):
    assert topics["/front/image_raw"]["type"] == "sensor_msgs/msg/Image"
    assert topics["/imu/data_raw"]["count"] == 31
    assert {name: one["count"] for name, one in topics.items() if one["count"] == 1} == {
        "/tf_static": 1,
        "/labels": 1,
        "/front/calibration": 1,
        "/fisheye/calibration": 1,
        "/mirror/calibration": 1,
    }
    others = [one["count"] for name, one in topics.items() if name != "/imu/data_raw"]
    assert set(others) == {1, 4}


def test_pixels_are_the_runs_own(topics, run):
    image = topics["/front/image_raw"]["first"]
    rgb = Recording.read(run, "front").cameras[0].rgb(0)
    assert (image["width"], image["height"], image["encoding"]) == (64, 48, "rgb8")
    assert image["data"] == rgb.reshape(-1).tolist()
