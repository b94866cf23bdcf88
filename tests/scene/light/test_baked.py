"""Folders of baked light: their reading, what is refused, and scenes that name one."""

import dataclasses
import json
import re
import shutil

import numpy as np
import pytest

from omnisim.core.errors import SceneError
from omnisim.core.files.image_files import write_image
from omnisim.scene import load_scene
from omnisim.scene.light.baked import with_baked_light
from omnisim.scene.light.baked_light import Probes
from tests.baked import write_baked
from tests.scenes import room_color, scene_of
from tests.vehicles import box, surroundings


@pytest.fixture
def folder(tmp_path):
    return write_baked(tmp_path / "test.baked", surroundings(), room_color)


def test_triangles_keep_their_order_and_corners(folder):
    scene = surroundings()
    baked = with_baked_light(scene, folder)
    assert len(baked.meshes) == len(scene.meshes)
    for new, old in zip(baked.meshes, scene.meshes, strict=True):
        assert new.triangles.shape == old.triangles.shape
        assert new.material == old.material
        for name in ("positions", "normals", "colors", "texture_coordinates"):
            before, after = getattr(old, name), getattr(new, name)
            assert (before is None) == (after is None)
            if before is not None:
                np.testing.assert_array_equal(after[new.triangles], before[old.triangles])
    assert baked.lighting.baked.irradiance.dtype == np.float16
    assert "px" in repr(baked.lighting.baked)


def _contents(**values):
    """Damage of baked.json."""

    def change(folder):
        path = folder / "baked.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | values))

    return change


def _arrays(name, **values):
    """Damage of an archive: other arrays, or none."""

    def change(folder):
        with np.load(folder / name) as stored:
            arrays = dict(stored) | values
        np.savez(
            folder / name, **{key: array for key, array in arrays.items() if array is not None}
        )

    return change


def _counts(*meshes):
    """Vertices and triangles of boxes, each triangle of which is a chart."""
    return np.array([(number, 36, 12) for number in meshes])


GRID = {"origin_m": [0, 0, 0], "spacing_m": [1, 1, 1], "shape": [1000, 1000, 1000]}
UNWRAPPING, PROBES = "unwrapping.npz", "probes.npz"
# Change of the folder, and the message about it.
DAMAGES = [
    (lambda f: (f / "baked.json").write_text("{"), "baked.json: is damaged: not JSON"),
    (lambda f: (f / "baked.json").write_text("[]"), "baked.json: is damaged: expected"),
    (lambda f: (f / "baked.json").unlink(), "baked.json: cannot be read: No such file"),
    (_contents(version=2), "baked.json: version: expected 1, got 2"),
    (_contents(fingerprint="0"), "the bake does not match test: "),
    (_contents(rects={"9": [0, 0, 1, 1]}), "expected numbers of instances, up to 2, got '9'"),
    (_contents(rects={"0": [0.5, 0, 0.6, 1]}),
     "rects.0 = [0.5, 0.0, 0.6, 1.0]: expected it within 0 to 1"),
    (_contents(back_rects={"1": [0, 0.5, 1, 0.6]}),
     "back_rects.1 = [0.0, 0.5, 1.0, 0.6]: expected it within 0 to 1"),
    (_contents(probes=GRID),
     "probes.shape = [1000, 1000, 1000]: expected at most 1000000 probes"),
    (lambda f: (f / "irradiance.exr").unlink(), "irradiance.exr"),
    (lambda f: write_image(f / "irradiance.exr", np.full((2, 2, 3), -1.0, np.float32)),
     "irradiance.exr: expected light from 0 to 65504"),
    (lambda f: (f / PROBES).write_text("no"), "probes.npz: is not an archive"),
    (_arrays(PROBES, sh=None), "probes.npz: sh: missing"),
    (_arrays(PROBES, sh=np.full((13, 9, 7, 9, 3), np.inf, "f4")),
     "probes.npz: sh: expected finite numbers up to 65504"),
    (_arrays(PROBES, valid=np.ones((2, 2, 2), dtype=bool)),
     "probes.npz: valid: expected 13 × 9 × 7 flags, got bool of shape (2, 2, 2)"),
    (_arrays(UNWRAPPING, meshes=_counts(0, 2, 3)), "vertex_of of mesh 1: missing"),
    (_arrays(UNWRAPPING, triangles=np.full((36, 3), 99)),
     "unwrapping.npz: triangles of mesh 0: expected vertices from 0 to 35"),
    (_arrays(UNWRAPPING, vertex_of=np.zeros(108, dtype=int)),
     "unwrapping.npz: vertex_of of mesh 0: expected the scene's triangles, got others"),
    (_arrays(UNWRAPPING, uv=np.full((108, 2), np.nan)), "uv of mesh 0: expected coordinates from"),
    (_arrays(UNWRAPPING, uv=np.full((108, 2), 1.1)), "uv of mesh 0: expected coordinates from 0"),
    (_arrays(UNWRAPPING, meshes=_counts(0, 1, 2) * [1, 1, -1]), "meshes: expected numbers of 108"),
    (_arrays(UNWRAPPING, meshes=_counts(0, 1, 2) - [0, 1, 0]), "meshes: expected numbers of 108"),
    (_arrays(UNWRAPPING, meshes=np.empty((0, 3), int)), "meshes: expected numbers of 108 in all"),
    (_arrays(UNWRAPPING, meshes=np.zeros(3, int)), "meshes: expected n × 3 whole numbers"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "message"), DAMAGES, ids=[one for _, one in DAMAGES])
def test_damage_is_one_line(folder, change, message):
    change(folder)
    with pytest.raises(SceneError, match=re.escape(message)) as error:
        with_baked_light(surroundings(), folder)
    assert "\n" not in str(error.value)


def test_a_changed_scene_is_refused(folder):
    """The message says what to run."""
    scene = surroundings()
    brighter = dataclasses.replace(scene, lighting=dataclasses.replace(scene.lighting, exposure=2))
    for changed in (brighter, scene.removed("object 1"), scene.recolored("object 1", (1, 0, 0))):
        with pytest.raises(SceneError, match=r"run `omnisim bake test -o .*test\.baked --force`$"):
            with_baked_light(changed, folder)


def test_light_between_probes_is_that_of_the_valid_ones():
    rng = np.random.default_rng(1)
    factors = np.zeros((2, 2, 3, 9, 3), dtype=np.float32)
    factors[..., 0, :] = rng.uniform(0.2, 1.0, (2, 2, 3, 3))
    valid = np.ones((2, 2, 3), dtype=np.bool_)
    valid[1, :, :2] = False
    probes = Probes(np.array([1.0, 2.0, 3.0]), np.array([1.0, 0.5, 0.25]), factors, valid)
    up = np.array([[0.0, 0.0, 1.0]])
    # next to walls what is valid counts, by its weight
    light = probes.light(np.array([[1.5, 2.0, 3.0]]), up)
    np.testing.assert_allclose(light[0], factors[0, 0, 0, 0], rtol=0.02)
    # at a probe its own, and beyond the grid that of its edge
    for point in ([2.0, 2.5, 3.5], [9.0, 9.0, 9.0]):
        light = probes.light(np.array([point]), up)
        np.testing.assert_allclose(light[0], factors[1, 1, 2, 0], rtol=1e-3)
    # within a wall that of the nearest
    inside = probes.light(np.array([[2.0, 2.0, 3.25]]), up)[0]
    assert (inside >= factors[..., 0, :][valid].min(axis=0) - 1e-3).all()
    none = dataclasses.replace(probes, valid=np.zeros_like(valid))
    assert np.isfinite(none.light(np.array([[1.5, 2.2, 3.3]]), up)).all()


def _box_file(folder):
    (folder / "box.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 0 1\nv 0 1 0\nf 1 2 3\nf 1 3 4\nf 2 1 4\nf 2 4 3\n"
    )


def _bake(toml, folder):
    return write_baked(folder, load_scene(toml, baked="none"), lambda p: 0.3 + 0.1 * abs(p))


def test_a_toml_names_its_light(tmp_path):
    _box_file(tmp_path)
    toml = tmp_path / "scene.toml"
    toml.write_text('file = "box.obj"\n[light]\nbaked = "own.baked"\n')
    with pytest.raises(SceneError, match=r"own.baked: no such folder: run `omnisim bake .*`"):
        load_scene(toml)
    assert load_scene(toml, baked="none").lighting.baked is None
    _bake(toml, tmp_path / "own.baked")
    assert load_scene(toml).lighting.baked is not None
    shutil.move(tmp_path / "own.baked", tmp_path / "other.baked")
    assert load_scene(toml, baked=tmp_path / "other.baked").lighting.baked is not None


def test_a_scene_that_extends_another_has_its_light_unless_it_has_its_own(tmp_path):
    _box_file(tmp_path)
    base, toml = tmp_path / "base.toml", tmp_path / "more.toml"
    base.write_text('file = "box.obj"\n[light]\nbaked = "base.baked"\n')
    _bake(base, tmp_path / "base.baked")
    toml.write_text('extends = "base.toml"\n[fog]\ncolor = [0.5, 0.5, 0.5]\nvisibility_m = 9\n')
    assert load_scene(toml).lighting.baked is not None
    toml.write_text('extends = "base.toml"\n[light]\nambient = [0.5, 0.5, 0.5]\n')
    assert load_scene(toml).lighting.baked is None
    toml.write_text('extends = "base.toml"\n[light]\nexposure = 2\nbaked = "more.baked"\n')
    _bake(toml, tmp_path / "more.baked")
    assert load_scene(toml).lighting.baked is not None


def test_edits_take_the_light_of_what_moves(folder):
    scene = with_baked_light(surroundings(), folder)
    moved = scene.moved("object 1", np.eye(4))
    assert [instance.light_rectangle is None for instance in moved.instances] == [
        False,
        True,
        False,
    ]
    added = scene.added("crate", scene_of([box("crate", 0)]))
    assert added.instances[-1].light_rectangle is None
    assert added.lighting.baked is scene.lighting.baked
