"""Copies of a mesh by EXT_mesh_gpu_instancing."""

import numpy as np
import pytest

from omnisim.core.errors import SceneError
from omnisim.scene import load_scene
from omnisim.scene.formats.gltf import nodes
from tests.scene.gltf_builder import GltfBuilder

PLACES = np.array([[0, 0, 0], [2, 0, 0], [0, 3, 0]], "<f4")
TURNS = np.array([[0, 0, 0, 1], [0, 0, 1, 0], [0, 0, 0.5**0.5, 0.5**0.5]], "<f4")
SCALES = np.array([[1, 1, 1], [2, 2, 2], [1, 1, -1]], "<f4")


def _copies(folder, **attributes):
    gltf = GltfBuilder()
    entries = {
        name: gltf.accessor(values, f"VEC{values.shape[1]}") for name, values in attributes.items()
    }
    extension = {"EXT_mesh_gpu_instancing": {"attributes": entries}}
    gltf.tree["extensionsRequired"] = list(extension)
    node = {"name": "tree", "translation": [10, 0, 0], "extensions": extension}
    gltf.node(mesh=gltf.triangle(), **node)
    return load_scene(gltf.write(folder / "a.glb"), up_axis="z")


def _corners(scene):
    return [
        scene.meshes[one.mesh].positions @ one.world_from_mesh[:3, :3].T
        + one.world_from_mesh[:3, 3]
        for one in scene.instances
    ]


def test_copies_are_instances_at_their_places(tmp_path):
    scene = _copies(tmp_path, TRANSLATION=PLACES, ROTATION=TURNS, SCALE=SCALES)
    assert [one.name for one in scene.instances] == ["tree_0", "tree_1", "tree_2"]
    assert len(scene.meshes) == 1
    expected = [
        [[10, 0, 0], [11, 0, 0], [10, 1, 0]],
        [[12, 0, 0], [10, 0, 0], [12, -2, 0]],
        [[10, 3, 0], [10, 4, 0], [9, 3, 0]],
    ]
    np.testing.assert_allclose(_corners(scene), expected, atol=1e-6)
    assert scene.notices == ()


def test_places_may_be_left_out(tmp_path):
    scene = _copies(tmp_path, SCALE=SCALES[1:2])
    np.testing.assert_allclose(_corners(scene), [[[10, 0, 0], [12, 0, 0], [10, 2, 0]]])


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ({"TRANSLATION": PLACES, "SCALE": SCALES[:2]}, "SCALE: expected an accessor of 3 finite"),
        ({"TRANSLATION": TURNS}, "TRANSLATION: expected an accessor of 3 finite VEC3"),
        (
            {"TRANSLATION": np.full((3, 3), np.inf, "<f4")},
            "TRANSLATION: expected an accessor of 3",
        ),
    ],
)
def test_damaged_copies_are_one_line(attributes, message, tmp_path):
    with pytest.raises(SceneError, match=message):
        _copies(tmp_path, **attributes)


def test_more_copies_than_are_drawn_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(nodes, "MAX_COPIES", 2)
    with pytest.raises(SceneError, match="TRANSLATION: expected an accessor of at most 2 copies"):
        _copies(tmp_path, TRANSLATION=PLACES)
