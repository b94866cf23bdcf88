"""From the bytes of glTF files to triangles and poses, beside trimesh's reader of them."""

import json

import numpy as np
import pytest

from omnisim.errors import SceneError
from omnisim.resources import SCENES
from omnisim.scene import load_scene
from tests.scene.gltf_builder import GltfBuilder, png

TRIANGLE = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
SQUARE = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]


@pytest.fixture
def gltf():
    return GltfBuilder()


def _load(gltf, tmp_path):
    return load_scene(gltf.write(tmp_path / "a.gltf"), up_axis="z")


@pytest.mark.parametrize("name", ["soccer", "superscout"])
def test_same_triangles_as_trimesh(name):
    """Scenes with matrices, quaternions, nested nodes and meshes of several primitives."""
    trimesh = pytest.importorskip("trimesh")
    path = SCENES / name / f"{name}.glb"
    ours = load_scene(path, up_axis="y")
    theirs = trimesh.load_scene(path, process=False)
    ours_m = np.concatenate(
        [
            ours.meshes[i.mesh].positions[ours.meshes[i.mesh].triangles].reshape(-1, 3)
            @ i.world_from_mesh[:3, :3].T
            + i.world_from_mesh[:3, 3]
            for i in ours.instances
        ]
    )
    parts = [theirs.graph[node] for node in theirs.graph.nodes_geometry]
    theirs_m = np.concatenate(
        [
            theirs.geometry[mesh].triangles.reshape(-1, 3) @ pose[:3, :3].T + pose[:3, 3]
            for pose, mesh in parts
        ]
    )
    theirs_m = theirs_m @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]).T
    # trimesh moves poses by up to 1e-5 of a metre and metre to make them rigid; float32 is finer
    reach_m = np.abs(theirs_m).max()
    np.testing.assert_allclose(ours_m, theirs_m, rtol=0.0, atol=1e-5 * (1.0 + reach_m))


def test_pose_is_as_the_file_has_it(gltf, tmp_path):
    matrix = np.eye(4)
    matrix[:2, :2] = [[0.99863, -0.052336], [0.052336, 0.99863]]  # rounded, and so left
    gltf.node(mesh=gltf.triangle(), matrix=matrix.T.ravel().tolist())
    pose = _load(gltf, tmp_path).instances[0].world_from_mesh
    np.testing.assert_array_equal(pose[:3, :3], matrix[:3, :3])


def test_quaternion_is_normalised_and_none_turns_nothing(gltf, tmp_path):
    mesh = gltf.triangle()
    gltf.node(mesh=mesh, rotation=[0, 0, 3, 3])  # 90° about z
    gltf.node(mesh=mesh, rotation=[0, 0, 0, 0])
    none, turned = (i.world_from_mesh[:3, :3] for i in _load(gltf, tmp_path).instances)
    np.testing.assert_array_equal(none, np.eye(3))
    np.testing.assert_allclose(turned, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)


@pytest.mark.parametrize(
    ("mode", "order", "triangles"),
    [
        (4, None, [[0, 1, 2]]),
        (4, [2, 1, 0, 1, 2, 3], [[2, 1, 0], [1, 2, 3]]),
        (5, None, [[0, 1, 2], [3, 2, 1]]),
        (5, [3, 2, 1, 0], [[3, 2, 1], [0, 1, 2]]),
        (6, None, [[0, 1, 2], [0, 2, 3]]),
        (6, [1, 0, 2, 3], [[1, 0, 2], [1, 2, 3]]),
    ],
)
def test_modes_of_triangles(gltf, tmp_path, mode, order, triangles):
    mesh = gltf.triangle(positions=SQUARE[: 3 if mode == 4 and order is None else 4])
    primitive = gltf.tree["meshes"][mesh]["primitives"][0]
    primitive["mode"] = mode
    if order is not None:
        primitive["indices"] = gltf.accessor(np.array(order, "u1"), "SCALAR")
    gltf.node(mesh=mesh)
    assert _load(gltf, tmp_path).meshes[0].triangles.tolist() == triangles


def test_interleaved_attributes(gltf, tmp_path):
    vertices = np.zeros(3, [("position", "<f4", 3), ("color", "u1", 4)])
    vertices["position"], vertices["color"] = TRIANGLE, [[255, 0, 51, 255]] * 3
    mesh = gltf.triangle(positions=np.frombuffer(vertices.tobytes(), "<f4").reshape(-1, 4)[:, :3])
    position = gltf.tree["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"]
    gltf.accessor(np.frombuffer(vertices.tobytes(), "u1"), "SCALAR")  # one view for both
    view = len(gltf.tree["bufferViews"]) - 1
    gltf.tree["bufferViews"][view]["byteStride"] = vertices.itemsize
    gltf.tree["accessors"][position]["bufferView"] = view
    gltf.tree["accessors"][-1] = {
        "bufferView": view, "byteOffset": 12, "componentType": 5121, "count": 3, "type": "VEC4",
        "normalized": True,
    }  # fmt: skip
    attributes = gltf.tree["meshes"][mesh]["primitives"][0]["attributes"]
    attributes["COLOR_0"] = len(gltf.tree["accessors"]) - 1
    gltf.node(mesh=mesh)
    read = _load(gltf, tmp_path).meshes[0]
    np.testing.assert_allclose(read.positions + [0.5, 0.5, 0.0], TRIANGLE, atol=1e-7)
    np.testing.assert_allclose(read.colors, [[1.0, 0.0, 0.2, 1.0]] * 3, atol=1e-7)


def test_glb_passes_over_chunks_it_does_not_know(gltf, tmp_path):
    gltf.node(mesh=gltf.triangle())
    path = gltf.write_glb(tmp_path / "a.glb", (b"MORE", b"abcd"))
    assert load_scene(path).triangle_count == 1


def test_primitives_have_names_of_their_own_and_lines_are_left_out(gltf, tmp_path):
    mesh, other, line = gltf.triangle(), gltf.triangle(), gltf.triangle()
    primitives = gltf.tree["meshes"][mesh]["primitives"]
    primitives += [gltf.tree["meshes"][index]["primitives"][0] for index in (line, other)]
    primitives[1]["mode"] = 3
    gltf.tree["meshes"][mesh]["name"] = "wall"
    gltf.node(mesh=mesh, name="here", children=[1])
    gltf.tree["nodes"].append({"mesh": line, "children": [2]})  # draws nothing, holds something
    gltf.tree["meshes"][line]["primitives"][0]["mode"] = 2
    gltf.tree["nodes"].append({"mesh": other, "name": "there"})
    scene = _load(gltf, tmp_path)
    assert [mesh.name for mesh in scene.meshes] == ["wall", "wall_1", "mesh 1"]
    assert [instance.name for instance in scene.instances] == ["here", "here", "there"]
    assert scene.notices == ("a.gltf: points and lines are not drawn",)


def test_root_that_is_listed_twice_is_drawn_once(gltf, tmp_path):
    gltf.node(mesh=gltf.triangle())
    gltf.tree["scenes"][0]["nodes"] *= 2
    assert len(_load(gltf, tmp_path).instances) == 1


def test_webp_goes_before_the_texture_for_others(gltf, tmp_path):
    coordinates = gltf.accessor(np.zeros((3, 2), "<f4"), "VEC2")
    first, second = gltf.texture(np.full((2, 2, 3), 10)), gltf.texture(np.full((2, 2, 3), 20))
    gltf.tree["textures"][first]["extensions"] = {"EXT_texture_webp": {"source": second}}
    gltf.tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": first}}}]
    gltf.node(mesh=gltf.triangle(material=0, TEXCOORD_0=coordinates))
    assert _load(gltf, tmp_path).materials[0].texture.pixels[0, 0, 0] == 20


def test_picture_that_is_none_is_told(gltf, tmp_path):
    coordinates = gltf.accessor(np.zeros((3, 2), "<f4"), "VEC2")
    texture = gltf.texture(np.zeros((2, 2, 3)))
    gltf.tree["images"][0] = {"uri": "data:image/png;base64,AAAA"}
    gltf.tree["materials"] = [
        {"name": "oak", "pbrMetallicRoughness": {"baseColorTexture": {"index": texture}}}
    ]
    gltf.node(mesh=gltf.triangle(material=0, TEXCOORD_0=coordinates))
    assert _load(gltf, tmp_path).notices == (
        "a.gltf: texture of 'oak' cannot be decoded: its plain colour is drawn",
    )


def test_picture_that_breaks_off_is_told(gltf, tmp_path):
    gltf.node(mesh=gltf.triangle(material=0))
    (tmp_path / "cut.png").write_bytes(
        png(np.random.default_rng(1).integers(0, 255, (64, 64, 3)))[:900]
    )
    gltf.tree["images"], gltf.tree["textures"] = [{"uri": "cut.png"}], [{"source": 0}]
    gltf.tree["materials"] = [
        {"name": "oak", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    ]
    (notice,) = _load(gltf, tmp_path).notices
    assert notice.startswith("a.gltf: texture of 'oak' cannot be decoded (")


def _float_indices(gltf):
    indices = gltf.accessor(np.array([0, 1, 2], "<f4"), "SCALAR")
    gltf.tree["meshes"][0]["primitives"][0]["indices"] = indices


def _four_indices(gltf):
    indices = gltf.accessor(np.array([0, 1, 2, 0], "u1"), "SCALAR")
    gltf.tree["meshes"][0]["primitives"][0]["indices"] = indices


def _stride_of_nothing(gltf):
    gltf.tree["bufferViews"][0]["byteStride"] = 0


def _far_sparse(gltf):
    places = gltf.accessor(np.array([99], "<u2"), "SCALAR")
    values = gltf.accessor(np.zeros((1, 3), "<f4"), "VEC3")
    views = [gltf.tree["accessors"][index]["bufferView"] for index in (places, values)]
    gltf.tree["accessors"][0]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": views[0], "componentType": 5123},
        "values": {"bufferView": views[1]},
    }


@pytest.mark.parametrize(
    ("break_it", "words"),
    [
        (_float_indices, r"meshes\[0\]\.primitives\[0\]: its indices are not whole numbers"),
        (_four_indices, r"meshes\[0\]\.primitives\[0\]: 4 indices do not make triangles"),
        (_stride_of_nothing, r"bufferViews\[0\]\.byteStride = 0: want a number above 0"),
        (_far_sparse, r"its JSON does not hold together: .*99 is out of bounds"),
    ],
)
def test_faults_of_numbers_are_named(gltf, tmp_path, break_it, words):
    gltf.node(mesh=gltf.triangle())
    break_it(gltf)
    _refused(gltf.write(tmp_path / "a.gltf"), words)


@pytest.mark.parametrize(
    ("uri", "words"),
    [
        ("gone.bin", r"buffers\[0\]: gone\.bin is not there"),
        ("data:;base64,AAAAAA", r"buffers\[0\]: cannot be read: Incorrect padding"),
        ("data:;base64,AAAA", r"buffers\[0\]: cut short: has 3 bytes, where .* ends at 36"),
        (None, r"buffers\[0\]: cut short: has 0 bytes, where bufferViews\[0\] ends at 36"),
        (7, "its JSON does not hold together"),
    ],
)
def test_faults_of_buffers_are_named(gltf, tmp_path, uri, words):
    gltf.node(mesh=gltf.triangle())
    path = gltf.write(tmp_path / "a.gltf")
    gltf.tree["buffers"][0]["uri"] = uri
    path.write_text(json.dumps(gltf.tree))
    _refused(path, words)


def _refused(path, words):
    with pytest.raises(SceneError, match=words) as info:
        load_scene(path)
    assert "\n" not in str(info.value)
    assert str(info.value).startswith(f"{path}: ")


def _compressed(gltf, blob):
    mesh = gltf.triangle(positions=SQUARE)
    view = gltf.tree["accessors"][gltf.accessor(np.frombuffer(blob, "u1"), "SCALAR")]["bufferView"]
    primitive = gltf.tree["meshes"][mesh]["primitives"][0]
    del gltf.tree["accessors"][primitive["attributes"]["POSITION"]]["bufferView"]
    primitive["indices"] = gltf.accessor(np.zeros(6, "<u2"), "SCALAR")
    primitive["extensions"] = {
        "KHR_draco_mesh_compression": {"bufferView": view, "attributes": {"POSITION": 0}}
    }
    gltf.node(mesh=mesh)


def test_draco(gltf, tmp_path):
    draco = pytest.importorskip("DracoPy", reason="DracoPy is not installed")
    triangles = np.array([[0, 1, 2], [1, 3, 2]], dtype=np.uint32)
    _compressed(gltf, draco.encode(np.array(SQUARE, float), triangles, quantization_bits=14))
    scene = _load(gltf, tmp_path)
    mesh = scene.meshes[0]
    corners = (mesh.positions + [0.5, 0.5, 0.0])[mesh.triangles]
    found = sorted(sorted(map(tuple, np.rint(corner).astype(int).tolist())) for corner in corners)
    wanted = sorted(sorted(map(tuple, np.array(SQUARE)[corner].tolist())) for corner in triangles)
    assert found == wanted


def test_damaged_draco_is_one_line(gltf, tmp_path):
    pytest.importorskip("DracoPy", reason="DracoPy is not installed")
    _compressed(gltf, b"this is not Draco at all")
    _refused(gltf.write(tmp_path / "a.gltf"), r"primitives\[0\]: cannot be decoded by Draco")
