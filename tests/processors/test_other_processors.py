"""Work that one processor began resumes on another, which rounds otherwise; images are the same.

The other processor is emulated, see `tests.processors.emulation`.
"""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from omnisim.core.files.image_files import read_image
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.scene import builtin_scenes, read_scene
from tests.processors.emulation import omnisim_emulated, rounds_otherwise, run_emulated

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("needs_opengl")]
SIZE_PX = 96
RENDER = f"""
import sys
from pathlib import Path
import numpy as np
from omnisim.scene import builtin_scenes, read_scene
from omnisim.rendering import OmniCamera, open_sensor
images = {{}}
for name in builtin_scenes():
    scene = read_scene(name)
    camera = OmniCamera().resized({SIZE_PX})
    with open_sensor(scene, camera) as renderer:
        base = camera.base_pose(scene.start.position_m, yaw_deg=scene.start.yaw_deg)
        frame = renderer.render(base, also=("range", "instance"))
    images |= {{name: frame.rgb, **{{f"{{name}} {{k}}": v for k, v in frame.channels.items()}}}}
    images[f"{{name}} given"] = np.array([scene.identity.content, scene.identity.light])
np.savez(sys.argv[1], **images)
"""


def test_the_emulated_processor_rounds_otherwise():
    """Else the other tests of this module hold by themselves."""
    if not rounds_otherwise():
        pytest.skip("this processor has nothing to disable: it rounds as the emulated one")


# llvmpipe without FMA places vertices and approximates powers otherwise: a few samples of edges
# change sides, and encoded gradients round to the next level.
@pytest.mark.parametrize(
    ("driver", "share"),
    [
        pytest.param(False, 1e-3, id="cpu", marks=pytest.mark.long),
        pytest.param(True, 5e-3, id="driver"),
    ],
)
def test_built_in_scenes_look_the_same(tmp_path, driver, share):
    run_emulated(RENDER, tmp_path / "there.npz", driver=driver)
    there = np.load(tmp_path / "there.npz")
    for name in builtin_scenes():
        scene = read_scene(name)
        given = there[f"{name} given"].tolist()
        assert [scene.identity.content, scene.identity.light] == given
        camera = OmniCamera().resized(SIZE_PX)
        with open_sensor(scene, camera) as renderer:
            base = camera.base_pose(scene.start.position_m, yaw_deg=scene.start.yaw_deg)
            frame = renderer.render(base, also=("range", "instance"))
        off = np.abs(frame.rgb.astype(int) - there[name]).max(axis=-1)
        assert driver or off.max() <= 1, name
        assert np.mean(off > 1) <= 1e-3, name
        assert np.mean(off > 0) <= share, name
        assert np.mean(frame.channels["instance"] != there[f"{name} instance"]) <= 1e-3
        ranges, others = frame.channels["range"], there[f"{name} range"]
        np.testing.assert_array_equal(np.isinf(ranges), np.isinf(others))
        close = np.isclose(ranges, others, rtol=1e-5) | np.isinf(ranges)
        assert np.mean(~close) <= share


@pytest.mark.parametrize(
    "physics",
    [
        pytest.param((), id="planned", marks=pytest.mark.long),
        pytest.param(("--physics", "mujoco"), id="physics"),
    ],
)
def test_a_drive_resumes(omnisim, tmp_path, physics):
    if physics:
        pytest.importorskip("mujoco")
    options = (
        "soccer", "--robot", "p2at", "--path", "lap", "--size", "32", "--quality", "fast",
        *physics, "-o",
    )  # fmt: skip
    status, _, err = omnisim("drive", *options, "here")
    assert status == 0, err
    run = tmp_path / "here"
    shutil.copytree(run, tmp_path / "whole")
    steps = json.loads((run / "manifest.json").read_text())["steps"]
    for file in (run / "omnicam").glob("*"):  # all but the last two images stay
        if file.name[:6].isdigit() and int(file.name[:6]) >= steps - 2:
            file.unlink()
    out = omnisim_emulated("drive", *options, run)
    assert f"{steps - 2} of them" in out or "recorded before" in out, out
    for image in sorted((run / "omnicam").glob("*.png")):
        whole = tmp_path / "whole" / "omnicam" / image.name
        off = np.abs(read_image(image)[0].astype(int) - read_image(whole)[0]).max(axis=-1)
        assert np.mean(off > 1) <= 1e-2, image.name  # noise and edges at 32 px


PLAN = """
scenes = [{ file = "soccer" }]
shards = 2
images_per_shard = 2
channels = ["range"]
[[cameras]]
size_px = 24
quality = "fast"
"""


def test_shards_of_two_processors_are_one_data_set(omnisim, tmp_path):
    (tmp_path / "plan.toml").write_text(PLAN)
    out = tmp_path / "set"
    omnisim_emulated("generate", tmp_path / "plan.toml", "-o", out, "--shards", "0")
    first = sorted(out.glob("*.tar"))
    stamps = [file.stat().st_mtime_ns for file in first]
    assert len(first) == 1
    status, text, err = omnisim("generate", "plan.toml", "-o", "set")
    assert status == 0, err
    assert len(sorted(out.glob("*.tar"))) == 2
    assert [file.stat().st_mtime_ns for file in first] == stamps, text


BAKE = """
import sys
from pathlib import Path
from omnisim.rendering.baking.bake import TileFolder
from omnisim.rendering.baking.baked_files import bake_scene
from omnisim.rendering.baking.settings import BakeSettings
from omnisim.scene import read_scene
stored = []
original = TileFolder.store
def store(self, name, arrays):
    original(self, name, arrays)
    stored.append(name)
    if len(stored) == int(sys.argv[3]):
        raise SystemExit
TileFolder.store = store
settings = BakeSettings(texel_m=1.0, samples=2, bounces=1)
bake_scene(read_scene(sys.argv[1], baked="none"), Path(sys.argv[2]), settings, jobs=1)
print(len(stored))
"""


@pytest.mark.long
def test_a_bake_resumes(tmp_path):
    whole = run_emulated(BAKE, "soccer", tmp_path / "whole", -1)
    run_emulated(BAKE, "soccer", tmp_path / "crossed", 2)
    done = subprocess.run(
        [sys.executable, "-c", BAKE, "soccer", tmp_path / "crossed", "-1"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert 0 < int(done.stdout) <= int(whole) - 2
    baked = read_scene("soccer", baked=tmp_path / "crossed")
    assert baked.lighting.baked is not None


def test_golden_images_hold():
    """In a process of pytest's own, on the emulated processor with this one's driver."""
    code = "import sys, pytest; sys.exit(pytest.main(sys.argv[1:]))"
    golden = Path(__file__).parents[1] / "rendering" / "opengl" / "test_golden.py"
    output = run_emulated(code, "-q", "-p", "no:cacheprovider", golden, driver=False)
    assert " passed" in output
