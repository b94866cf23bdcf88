"""OBJ, PLY, STL, COLLADA, and files that are none of them."""

import numpy as np
import pytest
import trimesh
from PIL import Image

from omnisim.errors import SceneError
from omnisim.scene import load_scene
from omnisim.scene.model import AlphaMode
from omnisim.srgb import linear_from_srgb

TRIANGLE_OBJ = (
    "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"
)


def _obj(folder, mtl):
    (folder / "a.mtl").write_text(mtl)
    path = folder / "a.obj"
    path.write_text(TRIANGLE_OBJ)
    return path


def test_obj_with_material_and_texture(tmp_path):
    pixels = np.zeros((2, 2, 3), dtype=np.uint8)
    pixels[0] = (255, 0, 0)  # the top row
    Image.fromarray(pixels).save(tmp_path / "wood.png")
    scene = load_scene(_obj(tmp_path, "newmtl m\nKd 1 1 1\nmap_Kd .\\Wood.PNG\n"))
    assert scene.notices == ()
    assert scene.materials[0].texture.pixels[0, 0].tolist() == [255, 0, 0, 255]
    # vt (0, 0) is the bottom of the picture: v = 1 counted from the top
    np.testing.assert_allclose(scene.meshes[0].texture_coordinates[0], [0.0, 1.0])
    assert scene.materials[0].double_sided


def test_obj_colours_are_display_values(tmp_path):
    scene = load_scene(_obj(tmp_path, "newmtl m\nKd 0.8 0.4 0.2\nd 0.5\n"))
    material = scene.materials[0]
    expected = linear_from_srgb([0.8, 0.4, 0.2])
    np.testing.assert_allclose(material.base_color[:3], expected, atol=0.004)  # 8 bits
    assert material.base_color[3] == pytest.approx(0.5)
    assert material.alpha_mode is AlphaMode.BLEND


def test_obj_with_missing_texture_says_so(tmp_path):
    scene = load_scene(_obj(tmp_path, "newmtl m\nKd 0.8 0.4 0.2\nmap_Kd gone.png\n"))
    assert scene.materials[0].texture is None
    assert scene.notices == ("a.obj: gone.png is not there: drawn without it",)


def test_obj_with_missing_material_file_says_so(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text(TRIANGLE_OBJ)
    assert load_scene(path).notices == ("a.obj: a.mtl is not there: drawn without it",)


def test_damaged_texture_says_so(tmp_path):
    (tmp_path / "bad.png").write_bytes(b"\x89PNG\r\n\x1a\n not really")
    scene = load_scene(_obj(tmp_path, "newmtl m\nKd 0.8 0.4 0.2\nmap_Kd bad.png\n"))
    assert scene.triangle_count == 1
    assert scene.materials[0].texture is None


@pytest.mark.parametrize("suffix", ["stl", "ply", "obj", "dae", "off"])
def test_every_format_gives_the_same_box_in_its_own_axes(tmp_path, suffix):
    path = tmp_path / f"box.{suffix}"
    trimesh.creation.box(extents=(1.0, 2.0, 3.0)).export(path)
    scene = load_scene(path)
    low, high = scene.bounds_m()
    y_up = suffix in ("obj", "dae")  # exported without <up_axis>, which means Y_UP in COLLADA
    np.testing.assert_allclose(high - low, (1.0, 3.0, 2.0) if y_up else (1.0, 2.0, 3.0), atol=1e-5)
    assert scene.triangle_count == 12


def test_ply_vertex_and_face_colours(tmp_path):
    for kind in ("vertex_colors", "face_colors"):
        box = trimesh.creation.box()
        setattr(
            box.visual, kind, np.tile([[200, 100, 50, 255]], (len(getattr(box.visual, kind)), 1))
        )
        box.export(tmp_path / "a.ply")
        mesh = load_scene(tmp_path / "a.ply").meshes[0]
        expected = [*linear_from_srgb(np.array([200, 100, 50]) / 255.0), 1.0]
        np.testing.assert_allclose(mesh.colors, [expected] * len(mesh.positions), atol=1e-6)


COLLADA_AXES = '<up_axis>{axis}_UP</up_axis><unit name="centimeter" meter="0.01"/>'


@pytest.mark.parametrize(("axis", "size"), [("X", (3, 2, 1)), ("Y", (1, 3, 2)), ("Z", (1, 2, 3))])
def test_collada_says_its_axis_and_unit(tmp_path, axis, size):
    path = tmp_path / "box.dae"
    trimesh.creation.box(extents=(100.0, 200.0, 300.0)).export(path)
    text = path.read_text()
    assert "<up_axis>" in text or "</asset>" in text
    import re

    text = re.sub(r"<up_axis>.*?</up_axis>|<unit[^>]*/>", "", text)
    path.write_text(text.replace("</asset>", COLLADA_AXES.format(axis=axis) + "</asset>"))
    low, high = load_scene(path).bounds_m()
    np.testing.assert_allclose(high - low, size, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.glb", b"", "is an empty file"),
        ("a.obj", b"", "is an empty file"),
        ("a.obj", b"nothing of use\n", "has no triangles|cannot be read"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n", "vertex 2 is"),
        ("a.stl", b"solid x\nendsolid x\n", "has no triangles|cannot be read"),
        ("a.stl", b"\0" * 300, "has no triangles|cannot be read"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 9\n", "cannot be read|no triangles"),
        ("a.dae", b"<COLLADA>", "cannot be read"),
        ("a.glb", b"glTF but not quite", "not glTF"),
        ("a.gltf", b"{}", "not glTF"),
        ("a.gltf", b"[1, 2", "not glTF"),
        ("a.gltf", b'{"asset": {"version": "2.0"}, "meshes": 3}', "cannot be read|hold together"),
        ("a.jpg", b"\xff\xd8", "unknown scene format '.jpg'"),
        ("noending", b"x", "unknown scene format"),
    ],
)
def test_bad_files_get_one_line(tmp_path, name, content, words):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(SceneError, match=words) as info:
        load_scene(path)
    assert str(path) in str(info.value)
    assert "\n" not in str(info.value)


def test_point_cloud_has_nothing_to_draw(tmp_path):
    path = tmp_path / "points.ply"
    trimesh.PointCloud(np.random.default_rng(0).normal(size=(10, 3))).export(path)
    with pytest.raises(SceneError, match="has no triangles"):
        load_scene(path)


def test_unknown_name_suggests_the_nearest():
    with pytest.raises(SceneError, match="did you mean 'courtyard'"):
        load_scene("courtyrd")
