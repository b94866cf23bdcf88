"""Notes on what may be wrong or is assumed: one line each, and none where a key confirms it."""

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
import trimesh

from tests.apps.cli.image_files import write_images
from tests.scene.formats.test_features import COLLADA

IMAGE = "--size 16 --quality fast"
# A command, words of its note, and what is added to confirm what the note names.
PAIRS = {
    "a scene in millimeters": (
        f"render large.obj -o o.png {IMAGE}", "if those are millimeters, set meters_per_unit",
        "--meters-per-unit 1",
    ),
    "axes of COLLADA": (f"render a.dae -o o.png {IMAGE}", "up_axis", "--up y"),
    "the lens of a file's camera": (
        f"render camera.gltf --at-camera eye -o o.png {IMAGE}", "--sensor selects another",
        "--sensor good.toml",
    ),
    "the frame of poses": (
        f"record rings --trajectory timed.tum -o run {IMAGE}", "--trajectory-frame sets another",
        "--trajectory-frame camera",
    ),
    "the rate of poses": (
        f"record rings --trajectory poses.kitti -o run {IMAGE} --trajectory-frame camera",
        "--rate sets another", "--rate 2",
    ),
    "axes of poses": (
        "drive rings --robot superscout --path poses.kitti --rate 1 --ignore-limits -o run",
        "--axes world reads them", "--axes kitti",
    ),
    "the height of a floor": (
        "drive step.obj --robot blind.toml --path way.csv -o run",
        "--ground M drives at one height", "--ground 0.5",
    ),
    "the start of time": (
        "export recorded --to tum -o out", "--start-time sets another date", "--start-time 5",
    ),
    "the height of a robot's origin": (
        "robot import robot.ini -o r.toml", "--origin-height sets its height", "--origin-height 0",
    ),
}  # fmt: skip


@pytest.fixture
def inputs(omnisim, tmp_path):
    write_images(tmp_path)
    room = trimesh.creation.box(extents=(5000.0, 4000.0, 2600.0))
    room.invert()
    room.export(tmp_path / "large.obj")
    floor = trimesh.creation.box(extents=(8.0, 8.0, 1.0))
    floor.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0)))
    floor.export(tmp_path / "step.obj")
    text = COLLADA.replace("<up_axis>Z_UP</up_axis>", "")
    (tmp_path / "a.dae").write_text(text.format(**dict.fromkeys(
        ("top", "phong", "mesh", "geometry", "node"), ""
    )))  # fmt: skip
    (tmp_path / "good.toml").write_text("[mirror]\nk = 5.0\n")
    (tmp_path / "timed.tum").write_text("0 0 0 1 0 0 0 1\n1 0.1 0 1 0 0 0 1\n")
    poses = "".join(f"1 0 0 {0.1 * n} 0 1 0 -1 0 0 1 0\n" for n in range(2))
    (tmp_path / "poses.kitti").write_text(poses)
    (tmp_path / "way.csv").write_text("x_m,y_m\n0,0\n1,0\n")
    (tmp_path / "blind.toml").write_text(BLIND)
    sample = Path(__file__).parents[2] / "robots" / "importers" / "usarsim" / "sample.ini"
    (tmp_path / "robot.ini").write_text(sample.read_text().split("[USARBot.P2DX]")[0])
    trimesh.Scene(trimesh.creation.box(extents=(4.0, 4.0, 4.0))).export(tmp_path / "camera.gltf")
    tree = json.loads((tmp_path / "camera.gltf").read_text())
    perspective = {"yfov": 1.0, "znear": 0.1, "aspectRatio": 1.5}
    tree["cameras"] = [{"type": "perspective", "perspective": perspective}]
    tree["nodes"].append({"name": "eye", "camera": 0})
    tree["scenes"][0]["nodes"].append(len(tree["nodes"]) - 1)
    (tmp_path / "camera.gltf").write_text(json.dumps(tree))


BLIND = """name = "blind"
[[sensors]]
name = "imu"
type = "imu"
position_m = [0.0, 0.0, 0.1]
[kinematics]
type = "differential"
max_speed_mps = 1.0
max_turn_rate_degps = 90.0
max_acceleration_mps2 = 0.5
max_turn_acceleration_degps2 = 90.0
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", PAIRS)
def test_a_note_is_one_line_and_quiet_where_a_key_confirms(omnisim, inputs, needs_opengl, name):
    command, words, key = PAIRS[name]
    if "recorded" in command:
        omnisim(*shlex.split(f"record rings --trajectory timed.tum -o recorded {IMAGE}"))
    status, _, notes = omnisim(*shlex.split(command))
    assert status == 0, notes
    found = [line for line in notes.splitlines() if words in line]
    assert len(found) == 1, notes
    assert re.fullmatch(r"note: .*[^.]", found[0])
    assert all(line.startswith("note: ") for line in notes.splitlines())
    again = ["--force"] if "-o run" in command else []
    command = command.replace("-o out", "-o other")
    status, _, notes = omnisim(*shlex.split(command), *shlex.split(key), *again)
    assert status == 0, notes
    assert not any(words in line for line in notes.splitlines()), notes
