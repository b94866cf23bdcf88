"""glTF as files have it: exact factors, transforms, instances, textures, lights."""

import base64
import json
import math
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from omnisim.core.errors import SceneError
from omnisim.core.package_files import SCENES
from omnisim.scene import load_scene
from omnisim.scene.formats.gltf import nodes
from omnisim.scene.model import AlphaMode, LightKind, Wrap
from tests.scene.compressed_gltf import DRACO_COLORS, draco_triangle
from tests.scene.gltf_builder import GltfBuilder, png
from tests.scene.world_corners import points_of

SOCCER = SCENES / "soccer" / "soccer.glb"


@pytest.fixture
def gltf():
    return GltfBuilder()


def test_y_up_becomes_z_up(gltf, tmp_path):
    gltf.node(mesh=gltf.triangle(positions=[[1, 2, 3], [4, 5, 6], [7, 8, 10]]), name="thing")
    scene = load_scene(gltf.write(tmp_path / "a.gltf"))
    np.testing.assert_allclose(points_of(scene), [[1, -3, 2], [4, -6, 5], [7, -10, 8]], atol=1e-6)
    assert scene.instances[0].name == "thing"
    assert scene.triangle_count == 1
    scene = load_scene(tmp_path / "a.gltf", up_axis="z")
    np.testing.assert_allclose(points_of(scene), [[1, 2, 3], [4, 5, 6], [7, 8, 10]], atol=1e-6)


def test_instances_share_a_mesh_and_nodes_multiply(gltf, tmp_path):
    mesh = gltf.triangle()
    gltf.node(mesh=mesh, translation=[10, 0, 0])
    gltf.node(translation=[0, 5, 0], scale=[2, 2, 2], children=[2])
    gltf.tree["nodes"].append({"mesh": mesh, "translation": [1, 0, 0], "name": "child"})
    scene = load_scene(gltf.write(tmp_path / "a.gltf"))
    assert len(scene.meshes) == 1
    by_x = sorted(points_of(scene, i).min(axis=0).tolist() for i in range(2))
    np.testing.assert_allclose(by_x, [[2, 0, 5], [10, 0, 0]], atol=1e-6)


def test_children_of_a_camera_are_not_lost(gltf, tmp_path):
    gltf.tree["cameras"] = [
        {"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1, "aspectRatio": 1.0}}
    ]
    gltf.node(camera=0, translation=[0, 0, 7], children=[1])
    gltf.tree["nodes"].append({"mesh": gltf.triangle()})
    scene = load_scene(gltf.write(tmp_path / "a.gltf"))
    np.testing.assert_allclose(points_of(scene)[0], [0, -7, 0], atol=1e-6)


def test_large_coordinates_keep_their_shape(gltf, tmp_path):
    """A town in map coordinates: float32 has half a meter there, the mesh keeps micrometers."""
    corner = np.array([2.6e6, 1.2e6, 400.0])
    path = tmp_path / "town.obj"
    points = corner + [[0, 0, 0], [0.001, 0, 0], [0, 0.001, 0]]
    path.write_text("".join("v {:.6f} {:.6f} {:.6f}\n".format(*p) for p in points) + "f 1 2 3\n")
    scene = load_scene(path, up_axis="z")
    mesh = scene.meshes[0].positions
    assert np.ptp(mesh, axis=0) == pytest.approx([0.001, 0.001, 0.0], abs=1e-7)
    np.testing.assert_allclose(points_of(scene)[0], corner, atol=1e-6)


def test_factors_are_exact_and_linear(gltf, tmp_path):
    factor = [0.0123456, 0.5, 1.0, 0.75]
    gltf.tree["materials"] = [
        {"name": "glass", "pbrMetallicRoughness": {"baseColorFactor": factor}, "doubleSided": True,
         "alphaMode": "BLEND", "extensions": {"KHR_materials_unlit": {}}}
    ]  # fmt: skip
    gltf.node(mesh=gltf.triangle(material=0))
    material = load_scene(gltf.write(tmp_path / "a.gltf")).materials[0]
    assert (material.name, material.base_color) == ("glass", tuple(factor))
    assert material.alpha_mode is AlphaMode.BLEND
    assert material.double_sided
    assert material.unlit


@pytest.mark.parametrize(
    ("values", "normalized"),
    [
        (np.array([[0.25, 0.5, 1.0]] * 3, "<f4"), False),
        (np.array([[64, 128, 255, 255]] * 3, "u1"), True),
        (np.array([[16384, 32768, 65535, 65535]] * 3, "<u2"), True),
    ],
)
def test_vertex_colors_in_every_type(gltf, tmp_path, values, normalized):
    color = gltf.accessor(values, f"VEC{values.shape[1]}", normalized)
    gltf.node(mesh=gltf.triangle(COLOR_0=color))
    mesh = load_scene(gltf.write(tmp_path / "a.gltf")).meshes[0]
    np.testing.assert_allclose(mesh.colors, [[0.25, 0.5, 1.0, 1.0]] * 3, atol=2e-3)


def test_texture_coordinates_normalized_second_set_and_transformed(gltf, tmp_path):
    first = gltf.accessor(np.zeros((3, 2), "<f4"), "VEC2")
    corners = np.array([[0, 0], [65535, 0], [0, 65535]], "<u2")
    second = gltf.accessor(corners, "VEC2", normalized=True)
    texture = gltf.texture(np.full((4, 4, 3), 200))
    transform = {"offset": [0.1, 0.2], "rotation": math.pi / 2, "scale": [2.0, 3.0]}
    info = {"index": texture, "texCoord": 1, "extensions": {"KHR_texture_transform": transform}}
    gltf.tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": info}}]
    gltf.node(mesh=gltf.triangle(material=0, TEXCOORD_0=first, TEXCOORD_1=second))
    mesh = load_scene(gltf.write(tmp_path / "a.gltf")).meshes[0]
    # u' = s_u u cos + s_v v sin + o_u, v' = −s_u u sin + s_v v cos + o_v
    expected = [[0.1, 0.2], [0.1, 0.2 - 2.0], [0.1 + 3.0, 0.2]]
    np.testing.assert_allclose(mesh.texture_coordinates, expected, atol=1e-6)


def test_samplers_and_mirrored_repeat(gltf, tmp_path):
    coordinates = gltf.accessor(np.array([[0, 0], [1, 0], [0, 1]], "<f4"), "VEC2")
    pixels = np.zeros((2, 2, 3))
    pixels[0, 0] = 255
    texture = gltf.texture(pixels, wrapS=33648, wrapT=33071)
    gltf.tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": texture}}}]
    gltf.node(mesh=gltf.triangle(material=0, TEXCOORD_0=coordinates))
    scene = load_scene(gltf.write(tmp_path / "a.gltf"))
    stored = scene.materials[0].texture
    assert (stored.wrap_u, stored.wrap_v) == (Wrap.REPEAT, Wrap.CLAMP_TO_EDGE)
    assert stored.pixels[0, :, 0].tolist() == [255, 0, 0, 255]  # its mirror image beside it
    np.testing.assert_allclose(scene.meshes[0].texture_coordinates[1], [0.5, 0.0])


def test_punctual_lights(gltf, tmp_path):
    gltf.tree["extensionsUsed"] = ["KHR_lights_punctual"]
    gltf.tree["extensions"] = {
        "KHR_lights_punctual": {
            "lights": [
                {"type": "directional", "color": [1, 0.5, 0.25], "intensity": 3.0},
                {"type": "spot", "intensity": 40.0, "range": 9.0, "spot": {"outerConeAngle": 0.5}},
            ]
        }
    }
    quarter = math.sqrt(0.5)
    gltf.node(mesh=gltf.triangle())
    gltf.node(extensions={"KHR_lights_punctual": {"light": 0}}, rotation=[-quarter, 0, 0, quarter])
    gltf.node(extensions={"KHR_lights_punctual": {"light": 1}}, translation=[1, 2, 3])
    lighting = load_scene(gltf.write(tmp_path / "a.gltf")).lighting
    sun, spot = sorted(lighting.lights, key=lambda light: light.kind.value)
    assert sun.kind is LightKind.DIRECTIONAL
    # −z of the node, turned by −90° about x, is −y of the file: straight down
    np.testing.assert_allclose(sun.direction, [0, 0, -1], atol=1e-6)
    assert sun.color == (1.0, 0.5, 0.25)
    assert spot.kind is LightKind.SPOT
    np.testing.assert_allclose(spot.position_m, [1, -3, 2], atol=1e-6)
    assert spot.range_m == 9.0
    assert spot.cone_cosines[1] == pytest.approx(math.cos(0.5))
    assert lighting.exposure > 0.0


def test_light_on_a_node_with_several_primitives_shines_once(gltf, tmp_path):
    gltf.tree["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}
    mesh, other = gltf.triangle(), gltf.triangle()
    gltf.tree["meshes"][mesh]["primitives"] += gltf.tree["meshes"][other]["primitives"]
    gltf.node(mesh=mesh, name="bulb", extensions={"KHR_lights_punctual": {"light": 0}})
    scene = load_scene(gltf.write(tmp_path / "a.gltf"))
    assert len(scene.lighting.lights) == 1
    assert [instance.name for instance in scene.instances] == ["bulb", "bulb"]


def test_only_the_strongest_lights_shine(gltf, tmp_path):
    lights = [{"type": "point", "intensity": 1.0 + i} for i in range(40)]
    gltf.tree["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    gltf.node(mesh=gltf.triangle())
    for i in range(40):
        gltf.node(extensions={"KHR_lights_punctual": {"light": i}}, translation=[0, 0, 2])
    scene = load_scene(gltf.write(tmp_path / "a.gltf"))
    assert sorted(light.intensity for light in scene.lighting.lights) == [
        9.0 + i for i in range(32)
    ]
    assert scene.notices == ("a.gltf: has 40 lights: only the 32 strongest are used",)


def test_sparse_positions_and_triangle_fan(gltf, tmp_path):
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    mesh = gltf.triangle(positions=square)
    primitive = gltf.tree["meshes"][mesh]["primitives"][0]
    primitive["mode"] = 6
    places, moved = gltf.accessor(np.array([2], "<u2"), "SCALAR"), [[5, 5, 0]]
    values = gltf.accessor(np.array(moved, "<f4"), "VEC3")
    views = [gltf.tree["accessors"][index]["bufferView"] for index in (places, values)]
    gltf.tree["accessors"][primitive["attributes"]["POSITION"]]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": views[0], "componentType": 5123},
        "values": {"bufferView": views[1]},
    }
    gltf.node(mesh=mesh)
    scene = load_scene(gltf.write(tmp_path / "a.gltf"), up_axis="z")
    assert scene.meshes[0].triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    np.testing.assert_allclose(points_of(scene), [[0, 0, 0], [1, 0, 0], [5, 5, 0], [0, 1, 0]])


def test_specular_glossiness_keeps_its_texture(gltf, tmp_path):
    coordinates = gltf.accessor(np.zeros((3, 2), "<f4"), "VEC2")
    texture = gltf.texture(np.full((2, 2, 3), 77))
    glossy = {"diffuseFactor": [0.5, 0.6, 0.7, 1.0], "diffuseTexture": {"index": texture}}
    gltf.tree["materials"] = [{"extensions": {"KHR_materials_pbrSpecularGlossiness": glossy}}]
    gltf.node(mesh=gltf.triangle(material=0, TEXCOORD_0=coordinates))
    material = load_scene(gltf.write(tmp_path / "a.gltf")).materials[0]
    assert material.base_color == (0.5, 0.6, 0.7, 1.0)
    assert material.texture.pixels[0, 0].tolist() == [77, 77, 77, 255]


def test_skin_is_drawn_where_its_joints_are(gltf, tmp_path):
    """The usual export: the mesh in centimeters, the armature scaled by 0.01, a joint moved."""
    joints = gltf.accessor(np.zeros((3, 4), "u1"), "VEC4")
    weights = gltf.accessor(np.array([[1, 0, 0, 0]] * 3, "<f4"), "VEC4")
    bind = np.eye(4, dtype="<f4")
    bind[0, 3] = -100.0
    binds = gltf.accessor(bind.T.reshape(1, 16).copy(), "MAT4")
    mesh = gltf.triangle(positions=np.eye(3) * 100.0, JOINTS_0=joints, WEIGHTS_0=weights)
    gltf.tree["skins"] = [{"joints": [2], "inverseBindMatrices": binds}]
    gltf.node(scale=[0.01, 0.01, 0.01], children=[1, 2])
    gltf.tree["nodes"].append({"mesh": mesh, "skin": 0, "name": "body", "translation": [9, 9, 9]})
    gltf.tree["nodes"].append({"name": "joint", "translation": [300, 0, 0]})
    scene = load_scene(gltf.write(tmp_path / "a.gltf"), up_axis="z")
    # (p − 100 x + 300 x) · 0.01; the translation of the mesh's own node does not count
    np.testing.assert_allclose(points_of(scene), [[3, 0, 0], [2, 1, 0], [2, 0, 1]], atol=1e-5)
    assert scene.instances[0].name == "body"


def test_skin_of_normalized_integers(gltf, tmp_path):
    joints = gltf.accessor(np.zeros((3, 4), "u1"), "VEC4")
    weights = gltf.accessor(np.array([[255, 0, 0, 0]] * 3, "u1"), "VEC4", normalized=True)
    mesh = gltf.triangle(JOINTS_0=joints, WEIGHTS_0=weights)
    corners = np.array([[0, 0, 0], [32767, 0, 0], [0, 32767, 0]], "<i2")
    quantized = gltf.accessor(corners, "VEC3", normalized=True)
    gltf.tree["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"] = quantized
    gltf.tree["skins"] = [{"joints": [1]}]
    gltf.node(mesh=mesh, skin=0)
    gltf.node(scale=[2, 2, 2])
    scene = load_scene(gltf.write(tmp_path / "a.gltf"), up_axis="z")
    np.testing.assert_allclose(points_of(scene), [[0, 0, 0], [2, 0, 0], [0, 2, 0]], atol=1e-5)


def test_file_without_scenes_shows_its_roots(gltf, tmp_path):
    gltf.node(mesh=gltf.triangle(), translation=[1, 0, 0])
    del gltf.tree["scenes"], gltf.tree["scene"]
    assert load_scene(gltf.write(tmp_path / "a.gltf")).triangle_count == 1


NAN, INFINITY = float("nan"), float("inf")
POSITION = ("meshes", 0, "primitives", 0, "attributes", "POSITION")


@pytest.mark.parametrize(
    ("place", "value", "words"),
    [
        (("asset", "version"), "1.0", r"not glTF 2.0: asset.version: .*, got '1.0'"),
        (("nodes", 0, "mesh"), 5, r"nodes\[0\].mesh: expected an index below 1, got 5"),
        (("nodes", 0, "mesh"), -1, r"nodes\[0\].mesh: expected an index below 1, got -1"),
        (("nodes", 0, "children"), [0], r"nodes\[0\]: expected one parent, got .* itself"),
        (("nodes", 0, "scale"), [1, INFINITY, 1],
         r"nodes\[0\].scale\[1\]: expected a finite number, got inf"),
        (("nodes", 0, "scale"), "big", r"nodes\[0\].scale: expected an array, got 'big'"),
        (("accessors", 0, "count"), 10**12,
         r"accessors\[0\]: expected 12000000000000 bytes in a view of 36"),
        (("accessors", 0, "type"), "VEC2", r"POSITION: expected an accessor of VEC3, got 0"),
        (("bufferViews", 0, "byteLength"), 10**6,
         r"bufferViews\[0\]: expected 1000000 bytes in its buffer, got 84"),
        (POSITION[:-1], {}, r"attributes.POSITION: expected an accessor of VEC3, got nothing"),
        (POSITION, 1, r"mesh 'mesh 0': vertex 1: expected finite .*, got \[1.0, nan, 0.0\]"),
        ((*POSITION[:4], "indices"), 2, r"mesh 'mesh 0': expected vertices below 3, got 7"),
        ((*POSITION[:4], "material"), 3,
         r"primitives\[0\].material: expected an index below 0, got 3"),
        (("nodes", 0), {}, "has no triangles"),
        (("extensionsUsed",), 7, "extensionsUsed: expected an array"),
        (("materials",), [{"alphaCutoff": NAN}],
         r"materials\[0\].alphaCutoff: expected a finite number"),
    ],
)  # fmt: skip
def test_json_faults_are_named(gltf, tmp_path, place, value, words):
    gltf.node(mesh=gltf.triangle())
    gltf.accessor(np.array([[0, 0, 0], [1, NAN, 0], [0, 1, 0]], "<f4"), "VEC3")
    gltf.accessor(np.array([0, 1, 7], "<u4"), "SCALAR")
    path = gltf.write(tmp_path / "a.gltf")
    holder = gltf.tree
    for key in place[:-1]:
        holder = holder[key]
    holder[place[-1]] = value
    path.write_text(json.dumps(gltf.tree))
    with pytest.raises(SceneError, match=words) as info:
        load_scene(path)
    assert "\n" not in str(info.value)
    assert str(info.value).startswith(f"{path}: ")


def test_missing_texture_is_noticed_and_the_factor_drawn(gltf, tmp_path):
    gltf.tree["images"] = [{"uri": "not%20there.png"}]
    gltf.tree["textures"] = [{"source": 0}]
    values = {"baseColorTexture": {"index": 0}, "baseColorFactor": [0.2, 0.3, 0.4, 1.0]}
    gltf.tree["materials"] = [{"name": "brick", "pbrMetallicRoughness": values}]
    gltf.node(mesh=gltf.triangle(material=0))
    scene = load_scene(gltf.write(tmp_path / "a.gltf"))
    assert scene.materials[0].texture is None
    assert scene.materials[0].base_color[:3] == (0.2, 0.3, 0.4)
    assert any("not%20there.png is missing" in line for line in scene.notices)


def test_texture_file_is_found_by_its_decoded_name(gltf, tmp_path):
    (tmp_path / "Red Brick.PNG").write_bytes(png(np.full((2, 2, 3), 9)))
    coordinates = gltf.accessor(np.zeros((3, 2), "<f4"), "VEC2")
    gltf.tree["images"] = [{"uri": "red%20brick.png"}]
    gltf.tree["textures"] = [{"source": 0}]
    values = {"baseColorTexture": {"index": 0}, "metallicFactor": 0.0}
    gltf.tree["materials"] = [{"pbrMetallicRoughness": values}]
    gltf.node(mesh=gltf.triangle(material=0, TEXCOORD_0=coordinates))
    scene = load_scene(gltf.write(tmp_path / "a.gltf"))
    assert scene.materials[0].texture.pixels[0, 0].tolist() == [9, 9, 9, 255]
    assert scene.notices == ()


@pytest.mark.parametrize("cut", [0.001, 0.3, 0.95])
def test_truncated_glb(tmp_path, cut):
    data = SOCCER.read_bytes()
    path = tmp_path / "cut.glb"
    path.write_bytes(data[: int(cut * len(data))])
    with pytest.raises(SceneError, match=r"cut\.glb") as info:
        load_scene(path)
    assert "\n" not in str(info.value)


def test_nodes_below_a_mesh_of_lines_are_drawn(gltf, tmp_path):
    lines = gltf.triangle()
    gltf.tree["meshes"][lines]["primitives"][0]["mode"] = 3
    gltf.node(mesh=lines, translation=[1, 0, 0], children=[1])
    gltf.tree["nodes"].append({"mesh": gltf.triangle()})
    scene = load_scene(gltf.write(tmp_path / "a.gltf"), up_axis="z")
    np.testing.assert_allclose(points_of(scene), [[1, 0, 0], [2, 0, 0], [1, 1, 0]])
    assert scene.notices == ("a.gltf: points and lines are not drawn (1 primitive)",)


def test_glb_data_in_a_gltf_file(tmp_path):
    (tmp_path / "a.gltf").write_bytes(SOCCER.read_bytes())
    assert load_scene(tmp_path / "a.gltf").triangle_count == load_scene(SOCCER).triangle_count


def test_draco(gltf, tmp_path, monkeypatch):
    """A stand-in for DracoPy: ids of its own choice, faces beside the attributes."""
    corners = np.array([[0, 0, 0], [0, 0, 2], [0, 3, 0]], "<f4")

    def decode(data):
        assert data == b"compressed"
        attributes = [{"unique_id": 7, "data": corners}, {"unique_id": 8, "data": corners}]
        return SimpleNamespace(attributes=attributes, faces=np.array([[2, 1, 0]]))

    gltf.triangle()
    draco_triangle(gltf, b"compressed", POSITION=7)
    path = gltf.write(tmp_path / "a.gltf")
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    with pytest.raises(SceneError, match=r"compressed with Draco, which needs pip .*\[draco\]"):
        load_scene(path)
    monkeypatch.setitem(sys.modules, "DracoPy", SimpleNamespace(decode=decode))
    scene = load_scene(path, up_axis="z")
    np.testing.assert_allclose(points_of(scene), corners)
    assert scene.meshes[0].triangles.tolist() == [[2, 1, 0]]


@pytest.mark.parametrize("decoder", ["DracoPy", "a stand-in"])
def test_draco_with_vertex_colors(gltf, tmp_path, monkeypatch, decoder):
    """Colors of 16 bits were divided by the 32 bits in which they are decoded: black."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
    colors = np.array([[65535, 32768, 0, 65535]] * 3, "<u2")
    if decoder == "DracoPy":
        pytest.importorskip("DracoPy", reason="DracoPy is not installed")
    else:
        ids = {1: colors.astype("<u4"), 2: corners}
        attributes = [{"unique_id": i, "data": data} for i, data in ids.items()]
        found = SimpleNamespace(attributes=attributes, faces=np.array([[0, 1, 2]]))
        monkeypatch.setitem(sys.modules, "DracoPy", SimpleNamespace(decode=lambda data: found))
    gltf.triangle(COLOR_0=gltf.accessor(colors, "VEC4", normalized=True))
    draco_triangle(gltf, base64.b64decode(DRACO_COLORS), COLOR_0=1, POSITION=2)
    mesh = load_scene(gltf.write(tmp_path / "a.gltf"), up_axis="z").meshes[0]
    np.testing.assert_allclose(mesh.colors, [[1.0, 0.5, 0.0, 1.0]] * 3, atol=1e-4)
    assert sorted(map(tuple, mesh.positions)) == sorted(map(tuple, corners - [0.5, 0.5, 0.0]))


def test_vertex_data_of_another_count_than_vertices_is_noted(gltf, tmp_path):
    colors = gltf.accessor(np.array([[1, 0, 0], [0, 1, 0]], "<f4"), "VEC3")
    gltf.node(mesh=gltf.triangle(COLOR_0=colors))
    scene = load_scene(gltf.write(tmp_path / "a.glb"))
    assert scene.meshes[0].colors is None
    assert scene.notices == (
        "a.glb: vertex colors not drawn: not finite, or not one for each vertex (1 mesh)",
    )


def test_black_vertex_colors_on_a_texture_are_noted(gltf, tmp_path):
    texture = gltf.texture([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [9, 9, 9]]])
    pbr = {"baseColorTexture": {"index": texture}}
    gltf.tree["materials"] = [{"pbrMetallicRoughness": pbr}]
    black = gltf.accessor(np.zeros((3, 3), "<f4"), "VEC3")
    uv = gltf.accessor(np.zeros((3, 2), "<f4"), "VEC2")
    gltf.node(mesh=gltf.triangle(material=0, COLOR_0=black, TEXCOORD_0=uv))
    scene = load_scene(gltf.write(tmp_path / "a.glb"))
    assert scene.notices == ("a.glb: vertex colors make textures black (1 mesh)",)


def test_a_chain_of_many_nodes(gltf, tmp_path):
    gltf.node(mesh=gltf.triangle(), children=[1])
    gltf.tree["nodes"] += [{"translation": [1, 0, 0], "children": [i + 2]} for i in range(2000)]
    gltf.tree["nodes"] += [{"mesh": 0}]
    scene = load_scene(gltf.write(tmp_path / "a.gltf"))
    assert scene.instances[1].world_from_mesh[0, 3] == pytest.approx(2000.5)


def test_an_accessor_without_a_buffer_cannot_ask_for_all_memory(gltf, tmp_path):
    gltf.node(mesh=gltf.triangle())
    (position,) = gltf.tree["accessors"]
    del position["bufferView"]
    position["count"] = 3 * 10**9
    with pytest.raises(SceneError, match=r"accessors\[0\].bufferView: expected one for 3000000000"):
        load_scene(gltf.write(tmp_path / "a.gltf"))


PLACES = np.array([[0, 0, 0], [2, 0, 0], [0, 3, 0]], "<f4")
TURNS = np.array([[0, 0, 0, 1], [0, 0, 1, 0], [0, 0, 0.5**0.5, 0.5**0.5]], "<f4")
SCALES = np.array([[1, 1, 1], [2, 2, 2], [1, 1, -1]], "<f4")


@pytest.fixture
def copies(gltf, tmp_path):
    """Load copies of a triangle by EXT_mesh_gpu_instancing."""

    def load(**attributes):
        entries = {
            name: gltf.accessor(attribute, f"VEC{attribute.shape[1]}")
            for name, attribute in attributes.items()
        }
        extensions = {"EXT_mesh_gpu_instancing": {"attributes": entries}}
        gltf.tree["extensionsRequired"] = list(extensions)
        gltf.node(mesh=gltf.triangle(), name="tree", translation=[10, 0, 0], extensions=extensions)
        return load_scene(gltf.write(tmp_path / "a.glb"), up_axis="z")

    return load


def test_copies_are_instances_at_their_places(copies):
    scene = copies(TRANSLATION=PLACES, ROTATION=TURNS, SCALE=SCALES)
    assert [instance.name for instance in scene.instances] == ["tree_0", "tree_1", "tree_2"]
    assert len(scene.meshes) == 1
    expected = [
        [[10, 0, 0], [11, 0, 0], [10, 1, 0]],
        [[12, 0, 0], [10, 0, 0], [12, -2, 0]],
        [[10, 3, 0], [10, 4, 0], [9, 3, 0]],
    ]
    np.testing.assert_allclose([points_of(scene, k) for k in range(3)], expected, atol=1e-6)
    assert scene.notices == ()


def test_places_of_copies_may_be_left_out(copies):
    scene = copies(SCALE=SCALES[1:2])
    np.testing.assert_allclose(points_of(scene), [[10, 0, 0], [12, 0, 0], [10, 2, 0]])


@pytest.mark.parametrize(
    ("attributes", "most", "message"),
    [
        (
            {"TRANSLATION": PLACES, "SCALE": SCALES[:2]},
            9,
            "SCALE: expected an accessor of 3 finite",
        ),
        ({"TRANSLATION": TURNS}, 9, "TRANSLATION: expected an accessor of 3 finite VEC3"),
        ({"TRANSLATION": np.full((3, 3), np.inf, "<f4")}, 9, "TRANSLATION: .* of 3 finite VEC3"),
        ({"TRANSLATION": PLACES}, 2, "TRANSLATION: expected an accessor of at most 2 copies"),
    ],
)
def test_damaged_copies_are_one_line(attributes, most, message, copies, monkeypatch):
    monkeypatch.setattr(nodes, "MAX_COPIES", most)
    with pytest.raises(SceneError, match=message):
        copies(**attributes)
