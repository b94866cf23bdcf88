"""`omnisim scene convert`: GLB files of any scene, read by ourselves and by trimesh."""

import json
import struct

import numpy as np
import pytest
import trimesh

from omnisim import OmniCamera, Scene, load_scene, open_sensor
from omnisim.scene.formats.gltf.writer import write_glb
from omnisim.scene.model import LightKind, Material, Texture
from tests.scene.gltf_builder import glb, skinned_and_textured
from tests.scenes import scene_of, square

OBJECTS = """
extends = "box.glb"
[[objects]]
name = "box"
file = "box.glb"
shuttle = { from_m = [40.0, 0.0, 0.0], to_m = [50.0, 0.0, 0.0], period_s = 4.0 }
"""


def _json(path):
    data = path.read_bytes()
    magic, version, length, text_length, kind = struct.unpack_from("<4s3I4s", data)
    assert (magic, version, length, kind) == (b"glTF", 2, len(data), b"JSON")
    return json.loads(data[20 : 20 + text_length])


def _box(path, **options):
    scene = trimesh.Scene(trimesh.creation.box(extents=(2.0, 3.0, 4.0)))
    path.write_bytes(scene.export(file_type="glb", **options))


@pytest.mark.parametrize("name", ["soccer", "compass"])
def test_a_converted_scene_is_the_same_scene(ran, tmp_path, name):
    target = tmp_path / "a.glb"
    out, error = ran("scene", "convert", name, "-o", target)
    if name == "soccer":
        left_out = "starts (7), paths (2), labels (29), landmarks (6): not in the GLB file"
        assert left_out in error
        assert "baked light: not in the GLB file; `omnisim bake` computes it again" in error
    assert out.startswith(f"{target}: ")
    before, after = load_scene(name), load_scene(target)
    assert after.instance_names == before.instance_names
    assert after.triangle_count == before.triangle_count
    assert len(after.meshes) <= len(before.meshes)
    assert after.lighting.exposure == before.lighting.exposure
    np.testing.assert_allclose(after.bounds_m(), before.bounds_m(), atol=1e-6)
    for node in before.instance_names:
        np.testing.assert_allclose(after.pose_of(node), before.pose_of(node), atol=1e-9)
    loaded = trimesh.load_scene(target)
    assert sum(len(part.faces) for part in loaded.dump()) == before.triangle_count
    corners = []
    for instance in before.instances:
        points, matrix = before.meshes[instance.mesh].positions, instance.world_from_mesh
        corners.append(points @ matrix[:3, :3].T + matrix[:3, 3])
    x, y, z = np.concatenate(corners).T
    y_up = np.stack((x, z, -y), axis=1)
    np.testing.assert_allclose(loaded.bounds, (y_up.min(axis=0), y_up.max(axis=0)), atol=1e-6)


@pytest.mark.usefixtures("needs_opengl")
def test_its_image_is_that_of_the_original(tmp_path):
    """A pixel in a thousand may be off by one level: vertices are rounded about another origin."""
    scene = load_scene("soccer", baked="none")  # which no glTF holds
    write_glb(scene, tmp_path / "a.glb")
    camera = OmniCamera().resized(80)
    frames = []
    for one in (scene, load_scene(tmp_path / "a.glb")):
        with open_sensor(one, camera) as renderer:
            frames.append(renderer.render(camera.base_pose(scene.start.position_m)).rgb.astype(int))
    difference = np.abs(frames[0] - frames[1])
    assert difference.max() <= 1
    assert (difference.max(axis=2) > 0).mean() <= 1e-3


def test_materials_and_textures_come_back(tmp_path):
    (tmp_path / "a.glb").write_bytes(glb(*skinned_and_textured()))
    before = load_scene(tmp_path / "a.glb", animation="none")
    write_glb(before, tmp_path / "b.glb")
    after = load_scene(tmp_path / "b.glb")
    for first, second in zip(before.instances, after.instances, strict=True):
        materials = [
            scene.materials[scene.meshes[one.mesh].material]
            for scene, one in ((before, first), (after, second))
        ]
        for key in materials[0].__dataclass_fields__:
            values = [getattr(material, key) for material in materials]
            if hasattr(values[0], "pixels"):
                np.testing.assert_array_equal(values[0].pixels, values[1].pixels)
                assert (values[0].wrap_u, values[0].wrap_v) == (values[1].wrap_u, values[1].wrap_v)
            else:
                assert values[0] == values[1], key
        meshes = [scene.meshes[one.mesh] for scene, one in ((before, first), (after, second))]
        for key in ("triangles", "normals", "texture_coordinates", "colors"):
            np.testing.assert_array_equal(*(getattr(mesh, key) for mesh in meshes))


def test_maps_of_gloss_and_clear_coats_come_back(tmp_path):
    random = np.random.default_rng(1)
    gloss, coat, bumps = (
        Texture(random.integers(0, 256, (4, 4, 4)).astype(np.uint8), is_linear=is_linear)
        for is_linear in (False, True, True)
    )
    material = Material(
        "a", metallic=0.5, roughness=0.25, specular=0.75, specular_color=(1.0, 0.5, 0.25),
        clearcoat=0.5, clearcoat_roughness=0.25, clearcoat_normal_scale=0.5,
        specular_map=gloss, clearcoat_map=coat, clearcoat_normal_map=bumps,
    )  # fmt: skip
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], "f4")
    write_glb(scene_of([square(texture_coordinates=uv)], [material]), tmp_path / "a.glb")
    (after, *_) = load_scene(tmp_path / "a.glb").materials
    assert (after.specular, after.specular_color) == (0.75, (1.0, 0.5, 0.25))
    assert (after.clearcoat, after.clearcoat_roughness) == (0.5, 0.25)
    assert after.clearcoat_normal_scale == 0.5
    for before, found in zip(material.maps, after.maps, strict=True):
        assert (before is None) == (found is None)
        if before is not None:
            np.testing.assert_array_equal(before.pixels, found.pixels)
            assert before.is_linear == found.is_linear


def test_lights_come_back(tmp_path):
    lights = [
        {"type": "directional", "color": [1.0, 0.5, 0.25], "intensity": 3.0},
        {"type": "point", "intensity": 40.0, "range": 12.0},
        {"type": "spot", "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.4}},
    ]
    tree = trimesh.Scene(trimesh.creation.box()).export(file_type="gltf")
    root = json.loads(tree["model.gltf"])
    root["extensionsUsed"] = ["KHR_lights_punctual"]
    root["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    for index in range(3):
        rotation = np.array([0.1, 0.2 * index, 0.3, 0.9])
        rotation = (rotation / np.linalg.norm(rotation)).tolist()
        node = {"translation": [1.0, 5.0, float(index)], "rotation": rotation}
        root["nodes"].append({**node, "extensions": {"KHR_lights_punctual": {"light": index}}})
        root["scenes"][0]["nodes"].append(len(root["nodes"]) - 1)
    for name, data in tree.items():
        (tmp_path / name).write_bytes(json.dumps(root).encode() if "model" in name else data)
    before = load_scene(tmp_path / "model.gltf")
    write_glb(before, tmp_path / "b.glb")
    after = load_scene(tmp_path / "b.glb")
    assert [light.kind for light in after.lighting.lights] == list(LightKind)
    for first, second in zip(before.lighting.lights, after.lighting.lights, strict=True):
        assert (first.color, first.intensity) == (second.color, second.intensity)
        assert first.range_m == second.range_m
        np.testing.assert_allclose(first.cone_cosines, second.cone_cosines, atol=1e-12)
        if first.kind is not LightKind.DIRECTIONAL:
            np.testing.assert_allclose(first.position_m, second.position_m)
        if first.kind is not LightKind.POINT:
            np.testing.assert_allclose(first.direction, second.direction, atol=1e-12)


def test_geometry_is_written_once(ran, tmp_path):
    box = trimesh.creation.box()
    scene = trimesh.Scene()
    scene.add_geometry(box, node_name="box_0", geom_name="box")
    for number in range(1, 20):
        pose = trimesh.transformations.translation_matrix((2.0 * number, 0.0, 0.0))
        scene.graph.update(f"box_{number}", matrix=pose, geometry="box")
    (tmp_path / "a.glb").write_bytes(scene.export(file_type="glb"))
    ran("scene", "convert", tmp_path / "a.glb", "-o", tmp_path / "b.glb")
    root = _json(tmp_path / "b.glb")
    assert len(root["meshes"]) == 1
    assert [node["name"] for node in root["nodes"]] == list(
        load_scene(tmp_path / "a.glb").instance_names
    )


def test_meshes_far_from_their_frames_stay_exact(tmp_path):
    """In map coordinates float32 is coarse: nodes then have the meshes' own frames."""
    corners = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]) + (4e6, 5e5, 30.0)
    scene = Scene.from_arrays("far", corners, [(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)])
    write_glb(scene, tmp_path / "a.glb")
    np.testing.assert_allclose(
        load_scene(tmp_path / "a.glb").bounds_m(), scene.bounds_m(), atol=1e-6
    )


def test_moving_objects_are_where_they_begin(quiet, tmp_path):
    _box(tmp_path / "box.glb")
    (tmp_path / "a.toml").write_text(OBJECTS)
    quiet("scene", "convert", tmp_path / "a.toml", "-o", tmp_path / "b.glb")
    middle = load_scene(tmp_path / "b.glb").bounds_m("box").mean(axis=0)
    np.testing.assert_allclose(middle, (40.0, 0.0, 0.0), atol=1e-6)


def test_the_scenes_own_file_is_not_overwritten(refused, tmp_path):
    _box(tmp_path / "box.glb")
    before = (tmp_path / "box.glb").read_bytes()
    (tmp_path / "box.toml").write_text('file = "box.glb"')
    line = refused("scene", "convert", "box.toml", "-o", "box.glb")
    assert "is the scene's mesh file: expected another name for the GLB file" in line
    assert (tmp_path / "box.glb").read_bytes() == before
