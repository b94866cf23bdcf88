"""Damaged glTF files: one line says what was expected, whatever is wrong with them."""

import json
import random
import struct

import numpy as np
import pytest

from omnisim.errors import SceneError
from omnisim.resources import SCENES
from omnisim.scene import load_scene
from tests.scene.gltf_builder import GltfBuilder

VALUES = (
    None, True, -1, 0, 3, 5121, 5126, 10**12, 2**64, 0.5, 1e14, 1e300, float("nan"), "", "VEC2",
    "MAT4", "../..", "data:;base64,AAA", "a" * 300, [], [0], [[]], [1.0] * 16, {}, {"index": 9},
)  # fmt: skip
DAMAGES_OF_EACH = 250


def _skinned_and_textured():
    """JSON and buffer of a file with most of what glTF has."""
    gltf = GltfBuilder()
    texture = gltf.texture(np.full((2, 2, 3), 9), wrapS=33648)
    gltf.tree["materials"] = [
        {"pbrMetallicRoughness": {"baseColorTexture": {"index": texture, "texCoord": 0}}}
    ]
    mesh = gltf.triangle(
        material=0,
        JOINTS_0=gltf.accessor(np.zeros((3, 4), "u1"), "VEC4"),
        WEIGHTS_0=gltf.accessor(np.ones((3, 4), "<f4"), "VEC4"),
        TEXCOORD_0=gltf.accessor(np.zeros((3, 2), "<u2"), "VEC2", normalized=True),
        COLOR_0=gltf.accessor(np.ones((3, 4), "<f4"), "VEC4"),
    )
    primitive = gltf.tree["meshes"][mesh]["primitives"][0]
    primitive["indices"] = gltf.accessor(np.arange(3, dtype="<u2"), "SCALAR")
    indices = gltf.tree["accessors"][primitive["indices"]]["bufferView"]
    position = gltf.tree["accessors"][primitive["attributes"]["POSITION"]]
    position["sparse"] = {
        "count": 1,
        "indices": {"bufferView": indices, "componentType": 5123},
        "values": {"bufferView": position["bufferView"]},
    }
    binds = gltf.accessor(np.eye(4, dtype="<f4").reshape(1, 16), "MAT4")
    gltf.tree["skins"] = [{"joints": [1], "inverseBindMatrices": binds}]
    gltf.tree["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "spot", "range": 5.0}]}}
    gltf.node(mesh=mesh, skin=0)
    gltf.node(rotation=[0.0, 0.6, 0.0, 0.8], scale=[1.0, 2.0, -1.0], translation=[1.0, 2.0, 3.0])
    gltf.node(mesh=mesh, extensions={"KHR_lights_punctual": {"light": 0}})
    gltf.tree["buffers"] = [{"byteLength": len(gltf.blob)}]
    return gltf.tree, gltf.blob


def _rings():
    data = (SCENES / "rings" / "rings.glb").read_bytes()
    end = 20 + struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20:end]), data[end + 8 :]


def _glb(tree, blob):
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    size = 28 + len(text) + len(blob)
    head = struct.pack("<5I", 0x46546C67, 2, size, len(text), 0x4E4F534A)
    return head + text + struct.pack("<2I", len(blob), 0x4E4942) + blob


def _entries(value):
    """(holder, key) of all values inside of a JSON value."""
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, inner in list(items):
        yield value, key
        if isinstance(inner, (dict, list)):
            yield from _entries(inner)


def _damage(rng, tree, blob):
    """A GLB file that is cut short, or has bytes or JSON values changed or left out."""
    kind = rng.random()
    if kind < 0.6:
        for _ in range(rng.choice((1, 1, 3))):
            holder, key = rng.choice(list(_entries(tree)))
            if rng.random() < 0.3:
                del holder[key]
            elif type(holder[key]) is int and rng.random() < 0.6:
                holder[key] += rng.choice((-1, 1, 2, 1000))
            else:
                holder[key] = json.loads(json.dumps(rng.choice(VALUES)))
    data = bytearray(_glb(tree, blob))
    if kind >= 0.7:
        for _ in range(rng.choice((1, 5, 50))):
            data[rng.randrange(len(data))] = rng.choice((0, 127, 255, rng.randrange(256)))
    return bytes(data if kind < 0.9 else data[: rng.randrange(len(data))])


@pytest.mark.parametrize("make", [_skinned_and_textured, _rings])
def test_damages_end_in_one_line_or_a_scene(make, tmp_path):
    path = tmp_path / "a.glb"
    path.write_bytes(_glb(*make()))
    assert load_scene(path).notices == ()
    rng, errors = random.Random(7), []
    for _ in range(DAMAGES_OF_EACH):
        path.write_bytes(_damage(rng, *make()))
        try:
            load_scene(path)
        except SceneError as reason:
            errors.append(str(reason))
    assert all(error.startswith(f"{path}: ") and "\n" not in error for error in errors)
    assert len(errors) > DAMAGES_OF_EACH // 4


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
