"""Folders of bakes: what is in them, and bakes that are stopped."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

pytest.importorskip("embreex")
pytest.importorskip("xatlas")

from omnisim.core.errors import OmnisimError
from omnisim.core.files.image_files import read_radiance
from omnisim.rendering.baking.baked_files import bake_scene
from omnisim.rendering.baking.settings import BakeSettings
from omnisim.scene.light.baked import with_baked_light
from omnisim.scene.model import Light, Lighting, LightKind
from tests.rendering.baking.rooms import box, lit_by

LAMP = Light(LightKind.POINT, (1.0, 0.9, 0.8), 2.0, position_m=np.array([0.3, 0.2, 0.8]))
SETTINGS = BakeSettings(texel_m=0.2, samples=8, bounces=3)


def room():
    walls = lit_by(box("room", (3.0, 3.0, 2.0), inwards=True), Lighting((0.0, 0.0, 0.0), (LAMP,)))
    return walls.added("crate", box("crate", (0.5, 0.5, 0.5), (0.0, 0.0, -0.75)))


def contents(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_files(tmp_path):
    scene = room()
    bake_scene(scene, tmp_path / "room.baked", SETTINGS)
    assert [path.name for path in tmp_path.iterdir()] == ["room.baked"]
    files = contents(tmp_path / "room.baked")
    assert set(files) == {"baked.json", "irradiance.exr", "probes.npz", "unwrapping.npz"}
    document = json.loads(files["baked.json"])
    assert document["fingerprint"] == scene.identity.light
    assert document["texel_m"] == 0.2
    assert set(document["rects"]) == {"0", "1"}
    pixels = read_radiance(tmp_path / "room.baked" / "irradiance.exr")
    assert list(pixels.shape[1::-1]) == document["atlas_px"]
    with np.load(tmp_path / "room.baked" / "probes.npz") as probes:
        assert probes["sh"].shape == (*document["probes"]["shape"], 9, 3)
        assert probes["sh"].dtype == np.float16
        assert probes["valid"].any()
    lit = with_baked_light(scene, tmp_path / "room.baked")
    assert lit.lighting.baked is not None


def test_bytes_depend_on_the_seed_and_not_on_the_threads(tmp_path):
    scene = room()
    bake_scene(scene, tmp_path / "one", SETTINGS, jobs=1)
    bake_scene(scene, tmp_path / "four", SETTINGS, jobs=4)
    other = BakeSettings(texel_m=0.2, samples=8, bounces=3, seed=1)
    bake_scene(scene, tmp_path / "other", other)
    one, four, seeded = (contents(tmp_path / name) for name in ("one", "four", "other"))
    assert one == four
    assert one["irradiance.exr"] != seeded["irradiance.exr"]
    assert one["unwrapping.npz"] == seeded["unwrapping.npz"]


def test_bake_goes_on_where_it_was(tmp_path, monkeypatch):
    """A bake that breaks off keeps its tiles, and does not count them again."""
    monkeypatch.setattr("omnisim.rendering.baking.bake.TILE", 256)
    bake_scene(room(), tmp_path / "whole", SETTINGS)

    def break_off(description, total):
        def steps(numbers):
            for number in numbers:
                if description == "bounces" and number == 2:
                    raise KeyboardInterrupt
                yield number

        return steps

    with pytest.raises(KeyboardInterrupt):
        bake_scene(room(), tmp_path / "again", SETTINGS, 1, break_off)
    unfinished = tmp_path / ".again.unfinished"
    assert not (tmp_path / "again").exists()
    kept = sorted(path.name for path in unfinished.iterdir())
    assert "bounces-00001.npz" in kept
    monkeypatch.setattr("omnisim.rendering.baking.bake.Bake._direct", None)  # all of it is kept
    bake_scene(room(), tmp_path / "again", SETTINGS, 1)
    assert contents(tmp_path / "again") == contents(tmp_path / "whole")
    assert not unfinished.exists()


def test_tiles_of_other_settings_are_not_taken(tmp_path):
    unfinished = tmp_path / ".x.unfinished"
    unfinished.mkdir()
    (unfinished / "plan.json").write_text("{}\n")
    (unfinished / "bounces-00000.npz").write_bytes(b"of something else")
    bake_scene(room(), tmp_path / "x", SETTINGS)
    assert (tmp_path / "x" / "baked.json").is_file()


def test_damaged_tile_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("omnisim.rendering.baking.bake.TileFolder.remove", lambda self: None)
    bake_scene(room(), tmp_path / "x", SETTINGS)
    (tmp_path / ".x.unfinished" / "bounces-00000.npz").write_bytes(b"damaged")
    (tmp_path / "x").rename(tmp_path / "y")
    with pytest.raises(OmnisimError, match=r"bounces-00000\.npz: is no tile of a bake"):
        bake_scene(room(), tmp_path / "x", SETTINGS)


def test_output_that_is_there_stays(tmp_path):
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "mine").touch()
    for force in (False, True):
        with pytest.raises(OmnisimError, match="is not a bake: expected a new or empty folder"):
            bake_scene(room(), tmp_path / "x", SETTINGS, force=force)
    assert (tmp_path / "x" / "mine").is_file()


def test_a_bake_is_finished_or_replaced(tmp_path):
    out, scene = tmp_path / "x", room()
    out.mkdir()
    assert bake_scene(scene, out, SETTINGS) is not None  # into an empty folder
    before = contents(out)
    assert bake_scene(scene, out, SETTINGS) is None
    with pytest.raises(OmnisimError, match="is a bake with other settings: expected --force"):
        bake_scene(scene, out, BakeSettings(texel_m=0.2, samples=9, bounces=3))
    changed = scene.added("other", box("other", (0.5, 0.5, 0.5), (0.0, 0.6, -0.75)))
    with pytest.raises(OmnisimError, match="or of this one before it changed: expected --force"):
        bake_scene(changed, out, SETTINGS)
    assert contents(out) == before
    assert bake_scene(changed, out, SETTINGS, force=True) is not None
    assert contents(out)["baked.json"] != before["baked.json"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x"]


@pytest.mark.slow
@pytest.mark.long
def test_killed_bake_goes_on_with_the_same_bytes(tmp_path):
    command = [sys.executable, "-m", "omnisim", "bake", "rings", "--texel-m", "0.1",
               "--samples", "64", "--bounces", "2"]  # fmt: skip
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    subprocess.run([*command, "-o", tmp_path / "whole"], check=True, env=environment)
    unfinished = tmp_path / ".killed.unfinished"
    process = subprocess.Popen([*command, "-o", tmp_path / "killed"], env=environment)
    while process.poll() is None and not list(unfinished.glob("bounces-*")):
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert list(unfinished.glob("bounces-*.npz"))
    assert not (tmp_path / "killed").exists()
    subprocess.run([*command, "-o", tmp_path / "killed"], check=True, env=environment)
    assert contents(tmp_path / "killed") == contents(tmp_path / "whole")
    assert not unfinished.exists()
