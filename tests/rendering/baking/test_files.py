"""Folders of bakes: what is in them, how light is stored, and bakes that are stopped."""

import json
import shutil
import zlib
from types import SimpleNamespace

import numpy as np
import pytest

from omnisim.core.errors import OmnisimError
from omnisim.core.files.image_files import read_radiance
from omnisim.rendering.baking.bake import TileFolder
from omnisim.rendering.baking.baked_files import bake_scene, lightmap, rounded_halves
from omnisim.rendering.baking.settings import BakeSettings
from omnisim.scene.light.baked import with_baked_light
from omnisim.scene.model import Light, Lighting, LightKind
from tests.rendering.baking.bakes import box, lit_by

pytest.importorskip("embreex")
pytest.importorskip("xatlas")

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


def test_tiles_of_other_settings_are_not_taken_and_damaged_ones_are_named(tmp_path, monkeypatch):
    unfinished = tmp_path / ".x.unfinished"
    unfinished.mkdir()
    (unfinished / "plan.json").write_text("{}\n")
    (unfinished / "bounces-00000.npz").write_bytes(b"of something else")
    TileFolder(tmp_path / "x", {"seed": 1})
    assert [path.name for path in unfinished.iterdir()] == ["plan.json"]
    monkeypatch.setattr("omnisim.rendering.baking.bake.TileFolder.remove", lambda self: None)
    shutil.rmtree(unfinished)
    bake_scene(room(), tmp_path / "x", SETTINGS)
    (tmp_path / ".x.unfinished" / "bounces-00000.npz").write_bytes(b"damaged")
    (tmp_path / "x").rename(tmp_path / "y")
    with pytest.raises(OmnisimError, match=r"bounces-00000\.npz: is not a tile of a bake"):
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
    with pytest.raises(OmnisimError, match="is a bake with other settings: pass --force"):
        bake_scene(scene, out, BakeSettings(texel_m=0.2, samples=9, bounces=3))
    changed = scene.added("other", box("other", (0.5, 0.5, 0.5), (0.0, 0.6, -0.75)))
    with pytest.raises(OmnisimError, match="or of this scene before it changed: pass --force"):
        bake_scene(changed, out, SETTINGS)
    assert contents(out) == before
    assert bake_scene(changed, out, SETTINGS, force=True) is not None
    assert contents(out)["baked.json"] != before["baked.json"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x"]


CHARTS = np.array([[0, 0, 0, 1, 1], [0, 0, 0, 1, 1], [-1, -1, 2, 2, 2]], dtype=np.int32)


def _patches_at(places):
    places = np.array(places)
    return SimpleNamespace(size_px=(5, 3), places=places, atlas_places=places, charts=CHARTS)


def test_light_spreads_to_the_ends_of_its_chart():
    light = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]], np.float32)
    found = lightmap(_patches_at([0, 9]), light, np.array([True, True]))
    for chart, color in ((0, (1, 0, 0)), (1, (0, 2, 0)), (2, (0, 0, 0)), (-1, (0, 0, 0))):
        assert np.unique(found[chart == CHARTS], axis=0).tolist() == [list(color)]


def test_pixels_are_the_means_of_their_patches_and_neighbors():
    light = np.array([[1.0] * 3, [3.0] * 3, [7.0] * 3], np.float32)
    found = lightmap(_patches_at([0, 0, 2]), light, np.array([True, True, False]))
    assert (found[CHARTS == 0] == 2.0).all()  # nothing is known at the third
    found = lightmap(_patches_at([0, 0, 2]), light, np.array([True, True, True]))
    assert found[0].tolist()[:3] == [[2.0] * 3, [4.5] * 3, [7.0] * 3]


def test_error_is_at_most_a_256th_of_the_brightest_channel():
    random = np.random.default_rng(3)
    light = 10.0 ** random.uniform(-2.5, 3.0, (4000, 1)) * random.random((4000, 3))
    off = np.abs(rounded_halves(light, -1).astype(np.float64) - light)
    assert (off.max(axis=1) <= light.max(axis=1) / 256.0).all()


def test_signs_zeros_and_the_largest_half_stay():
    light = np.array([[-3.0, 0.0, 1.5], [0.0, 0.0, 0.0], [1e6, 65504.0, 0.0]])
    found = rounded_halves(light, -1)
    assert found.tolist() == [[-3.0, 0.0, 1.5], [0.0, 0.0, 0.0], [65504.0, 65504.0, 0.0]]


def test_smooth_light_is_stored_in_fewer_bytes():
    light = np.linspace(0.5, 1.5, 60_000).reshape(-1, 3)
    rounded, plain = rounded_halves(light, -1), light.astype(np.float16)
    assert len(zlib.compress(rounded.tobytes())) < 0.7 * len(zlib.compress(plain.tobytes()))
