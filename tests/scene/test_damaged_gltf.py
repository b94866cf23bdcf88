"""Damaged glTF files that chance does not find; the others are tests/fuzz's."""

import pytest

from omnisim.core.errors import SceneError
from omnisim.scene import load_scene
from tests.scene.gltf_builder import GltfBuilder


def test_a_chain_of_many_nodes(tmp_path):
    gltf = GltfBuilder()
    gltf.node(mesh=gltf.triangle(), children=[1])
    gltf.tree["nodes"] += [{"translation": [1, 0, 0], "children": [i + 2]} for i in range(5000)]
    gltf.tree["nodes"] += [{"mesh": 0}]
    scene = load_scene(gltf.write(tmp_path / "a.gltf"))
    assert scene.instances[1].world_from_mesh[0, 3] == pytest.approx(5000.5)


def test_an_accessor_without_a_buffer_cannot_ask_for_all_memory(tmp_path):
    gltf = GltfBuilder()
    gltf.node(mesh=gltf.triangle())
    (position,) = gltf.tree["accessors"]
    del position["bufferView"]
    position["count"] = 3 * 10**9
    with pytest.raises(SceneError, match=r"accessors\[0\].bufferView: expected one for 3000000000"):
        load_scene(gltf.write(tmp_path / "a.gltf"))
