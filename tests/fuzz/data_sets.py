"""Plans and data sets for the fuzzer."""

import json
import tempfile
from pathlib import Path

import numpy as np

from omnisim.core.files.image_files import write_image
from omnisim.datasets.converted_datasets import write_recordings
from omnisim.datasets.generate.distributions import ConstantShares
from omnisim.datasets.generate.prepared_plan import PreparedPlan
from omnisim.datasets.generate.samples import MANIFEST, SampleManifest, Shards
from omnisim.datasets.generate.shard import ShardSummary, Statistics, shard_stem, write_tar
from omnisim.rendering.camera.omnicamera import OmniCamera

PLAN = """channels = ["range", "semantic"]
images_per_shard = 10
shards = 2
seed = 7
[[scenes]]
file = "soccer"
weight = 2.0
[[cameras]]
name = "mirror"
size_px = 64
parameters = { focal_length_px = { normal = [0.0, 2.0] } }
degradation = { noise = { read_noise_e = [1.0, 4.0] } }
mount_turn_deg = { choice = [0.0, 1.0] }
[viewpoints]
where = "free"
height_m = { log_uniform = [0.3, 1.2] }
[vary]
exposure_ev = [-1.0, 1.0]
[vary.sky]
hour = [9.0, 15.0]
[vary.light]
lamp_temperature_k = [2500.0, 6500.0]
[[vary.recolor]]
nodes = ["goal_*"]
[[objects]]
file = "ball.obj"
count = [0, 2]
[reject]
min_hit_share = 0.2
"""


def read_plan(path: Path) -> None:
    """Read a plan, and make its cameras."""
    prepared = PreparedPlan.read(path)
    for share in (0.1, 0.5, 0.9):
        for file in prepared.rig_files:
            file.rig(ConstantShares(share))


def write_data_set(folder: Path) -> None:
    """Write a data set of one sample, without rendering it."""
    camera = OmniCamera().resized(24)
    image = {
        "scene": "soccer",
        "camera": camera.model.parameters(),
        "polygons": "exact",
        "world_from_base": np.eye(4).tolist(),
        "world_from_optical": camera.base_from_optical.tolist(),
    }
    content = {"number": 0, "scene": "soccer", "camera": "paper", "images": {"camera": image}}
    with tempfile.TemporaryDirectory() as name:
        write_image(Path(name) / "000000000.png", np.zeros((24, 24, 3), dtype=np.uint8), image)
        (Path(name) / "000000000.json").write_text(json.dumps(content))
        digest, size = write_tar(folder / f"{shard_stem(0)}.tar", Path(name))
    shard = ShardSummary(0, "plan", digest, size, Statistics(samples=1))
    (folder / f"{shard_stem(0)}.json").write_text(json.dumps(shard.to_json()))
    manifest = SampleManifest("rooms", None, "plan", (), (shard,))
    (folder / MANIFEST).write_text(json.dumps(manifest.to_json()))


def read_data_set(folder: Path) -> None:
    """Read a data set's sample, and convert it."""
    shards = Shards(folder)
    if not len(shards):
        return
    shards[0]
    with tempfile.TemporaryDirectory() as parent:
        list(write_recordings(shards, "kitti360", Path(parent) / "out"))
