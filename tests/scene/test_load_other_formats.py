"""OBJ, PLY, STL, COLLADA, and files that are none of them."""

import os
import re

import numpy as np
import pytest
import trimesh
from PIL import Image

from omnisim.core.errors import SceneError
from omnisim.core.srgb import linear_from_srgb
from omnisim.scene import load_scene
from omnisim.scene.formats.imported_scene import PLAIN_GRAY
from omnisim.scene.model import AlphaMode

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
    # vt (0, 0) is the bottom of the image: v = 1 counted from the top
    np.testing.assert_allclose(scene.meshes[0].texture_coordinates[0], [0.0, 1.0])
    assert scene.materials[0].double_sided


def test_obj_colors_are_display_values(tmp_path):
    (material,) = load_scene(_obj(tmp_path, "newmtl m\nKd 0.8 0.4 0.2\nd 0.5\n")).materials
    expected = (*linear_from_srgb([0.8, 0.4, 0.2]), 0.5)
    np.testing.assert_allclose(material.base_color, expected, atol=0.004)  # 8 bits
    assert material.alpha_mode is AlphaMode.BLEND


def test_obj_without_materials_is_light_gray(tmp_path):
    """trimesh puts a dark gray image where there is no material; it must not be seen."""
    path, missing = tmp_path / "a.obj", ("a.obj: a.mtl is missing: drawn without it",)
    for text, notices in ((TRIANGLE_OBJ, missing), (TRIANGLE_OBJ.partition("\n")[2], ())):
        path.write_text(text)
        scene = load_scene(path)
        assert scene.notices == notices
        assert scene.materials[0].texture is None
        np.testing.assert_allclose(scene.materials[0].base_color[:3], PLAIN_GRAY, atol=1e-3)


def test_obj_texture_without_kd_is_not_darkened(tmp_path):
    Image.new("RGB", (2, 2), (250, 120, 60)).save(tmp_path / "wood.png")
    material = load_scene(_obj(tmp_path, "newmtl m\nmap_Kd wood.png\n")).materials[0]
    assert material.base_color == (1.0, 1.0, 1.0, 1.0)
    assert material.texture.pixels[0, 0].tolist() == [250, 120, 60, 255]


@pytest.mark.parametrize(
    "line",
    [
        "map_Kd -s 2 3 1 -o 0.5 0.25 my wood.png",
        'map_Kd -clamp on -s 2 3 1 -o 0.5 0.25 "my wood.png"   # a comment',
        "\tMap_KD  -o 0.5 0.25 0 -s 2 3 my wood.png",
    ],
)
def test_mtl_options_of_a_map(tmp_path, line):
    Image.new("RGB", (2, 2), (250, 120, 60)).save(tmp_path / "my wood.png")
    scene = load_scene(_obj(tmp_path, f"# made by hand\nnewmtl m\n{line}\n"))
    assert len(scene.notices) == ("-clamp" in line)
    assert scene.materials[0].texture is not None
    # vt (0, 1): u = 0 · 2 + 0.5, and v = 1 · 3 + 0.25 from the bottom
    np.testing.assert_allclose(scene.meshes[0].texture_coordinates[2], [0.5, 1.0 - 3.25])


def test_mtl_options_that_are_no_numbers_are_refused(tmp_path):
    path = _obj(tmp_path, "newmtl m\nmap_Kd-s 2 2 1 wood.png\n")
    with pytest.raises(SceneError, match=r"a\.obj: .*map_Kd -s = 2 2 1 wood\.png: expected up to"):
        load_scene(path)


def test_several_material_files_in_every_encoding(tmp_path):
    (tmp_path / "a.mtl").write_bytes("\ufeffnewmtl rot\nKd 1 0 0\n".encode())
    (tmp_path / "b c.mtl").write_bytes("newmtl grün\nKd 0 1 0\n".encode("latin-1"))
    text = (
        "# mtllib never.mtl\nmtllib a.mtl\nmtllib b c.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n"
        "usemtl rot\nf 1 2 3\nusemtl grün\nf 3 2 1\n"
    )
    (tmp_path / "a.obj").write_bytes(text.replace("\n", "\r").encode("latin-1"))
    scene = load_scene(tmp_path / "a.obj")
    assert scene.notices == ()
    colors = {material.name: material.base_color[:3] for material in scene.materials}
    assert colors == {"rot": (1.0, 0.0, 0.0), "grün": (0.0, 1.0, 0.0)}


def test_obj_negative_indices(tmp_path):
    blocks = "".join(f"v {x} 0 0\nv {x} 1 0\nv {x} 0 1\nf -3 -2 -1\n" for x in (0, 5))
    (tmp_path / "a.obj").write_text(blocks)
    scene = load_scene(tmp_path / "a.obj", up_axis="z")
    assert scene.triangle_count == 2
    low, high = scene.bounds_m()
    np.testing.assert_allclose([low, high], [[0, 0, 0], [5, 1, 1]], atol=1e-6)


def test_obj_corners_without_coordinates_do_not_cost_the_others_theirs(tmp_path):
    Image.new("RGB", (2, 2), (250, 120, 60)).save(tmp_path / "wood.png")
    path = _obj(tmp_path, "newmtl m\nmap_Kd wood.png\n")
    path.write_text(TRIANGLE_OBJ + "v 1 1 0\nf 2 4 3\n")
    scene = load_scene(path)
    assert scene.triangle_count == 2
    coordinates = scene.meshes[0].texture_coordinates
    assert coordinates is not None
    assert any(np.allclose(pair, (1.0, 1.0)) for pair in coordinates)  # vt 1 0 of the first face


def test_alpha_of_a_texture_decides_between_mask_and_blend(tmp_path):
    pixels = np.full((8, 8, 4), 200, dtype=np.uint8)
    path = _obj(tmp_path, "newmtl m\nmap_Kd leaf.png\n")
    for alpha, mode in (
        (np.where(np.arange(8) < 4, 0, 255), AlphaMode.MASK),
        (np.full(8, 100), AlphaMode.BLEND),
        (np.full(8, 255), AlphaMode.OPAQUE),
    ):
        pixels[..., 3] = alpha
        Image.fromarray(pixels).save(tmp_path / "leaf.png")
        assert load_scene(path).materials[0].alpha_mode is mode


def test_hole_map_without_a_color_map(tmp_path):
    Image.fromarray(np.array([[0, 255]], dtype=np.uint8)).save(tmp_path / "holes.png")
    material = load_scene(_obj(tmp_path, "newmtl m\nKd 1 0 0\nmap_d holes.png\n")).materials[0]
    assert material.alpha_mode is AlphaMode.MASK
    assert material.texture.pixels[0].tolist() == [[255, 255, 255, 0], [255, 255, 255, 255]]


@pytest.mark.parametrize("suffix", ["stl", "ply", "obj", "dae", "off"])
def test_every_format_gives_the_same_box_in_its_own_axes(tmp_path, suffix):
    path = tmp_path / f"box.{suffix}"
    trimesh.creation.box(extents=(1.0, 2.0, 3.0)).export(path)
    scene = load_scene(path)
    low, high = scene.bounds_m()
    y_up = suffix in ("obj", "dae")  # exported without <up_axis>, which means Y_UP in COLLADA
    np.testing.assert_allclose(high - low, (1.0, 3.0, 2.0) if y_up else (1.0, 2.0, 3.0), atol=1e-5)
    assert scene.triangle_count == 12


def test_ply_vertex_and_face_colors(tmp_path):
    """Also of a tetrahedron, which has as many triangles as vertices: one color a triangle."""
    for kind, count in (("vertex_colors", 8), ("face_colors", 12)):
        box = trimesh.creation.box()
        setattr(box.visual, kind, np.tile([[200, 100, 50, 255]], (count, 1)))
        box.export(tmp_path / "a.ply")
        mesh = load_scene(tmp_path / "a.ply").meshes[0]
        expected = [*linear_from_srgb(np.array([200, 100, 50]) / 255.0), 1.0]
        np.testing.assert_allclose(mesh.colors, [expected] * len(mesh.positions), atol=1e-6)
    corners = np.concatenate((np.zeros((1, 3)), np.eye(3)))
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    tetrahedron = trimesh.Trimesh(corners, faces, process=False)
    tetrahedron.visual.face_colors = 255 * np.column_stack((corners[[1, 2, 3, 0]], np.ones(4)))
    tetrahedron.export(tmp_path / "a.ply")
    colors = load_scene(tmp_path / "a.ply").meshes[0].colors.reshape(4, 3, 4)
    np.testing.assert_array_equal(colors[:, 0], colors[:, 2])
    assert colors[0, 0].tolist() == [1, 0, 0, 1]


COLLADA_AXES = '<up_axis>{axis}_UP</up_axis><unit name="centimeter" meter="0.01"/>'


@pytest.mark.parametrize(("axis", "size"), [("X", (2, 3, 1)), ("Y", (1, 3, 2)), ("Z", (1, 2, 3))])
def test_collada_states_its_axis_and_unit(tmp_path, axis, size):
    path = tmp_path / "box.dae"
    trimesh.creation.box(extents=(100.0, 200.0, 300.0)).export(path)
    text = path.read_text()
    assert "<up_axis>" in text or "</asset>" in text
    text = re.sub(r"<up_axis>.*?</up_axis>|<unit[^>]*/>", "", text)
    path.write_text(text.replace("</asset>", COLLADA_AXES.format(axis=axis) + "</asset>"))
    low, high = load_scene(path).bounds_m()
    np.testing.assert_allclose(high - low, size, atol=1e-6)


SPLAT = "".join(f"property float {x}\n" for x in ("f_dc_0", "f_dc_1", "f_dc_2", "opacity"))
POINTS = (
    "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
    "property float z\n{}end_header\n0 0 0{}\n"
)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.glb", b"", "is an empty file"),
        ("a.obj", b"", "is an empty file"),
        ("a.obj", b"nothing of use\n", "has no triangles|cannot be read"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n", "vertex 2: expected finite"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 3e38 0\nf 1 2 3\n", r"vertex 2: .*below 1e\+15, got"),
        ("a.stl", b"solid x\nendsolid x\n", "has no triangles|cannot be read"),
        ("a.stl", b"\0" * 300, "has no triangles|cannot be read"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 9\n", "cannot be read|no triangles"),
        ("a.dae", b"<COLLADA>", "cannot be read"),
        ("a.glb", b"glTF but not quite", "not glTF"),
        ("a.gltf", b"{}", "not glTF"),
        ("a.gltf", b"[1, 2", "not glTF"),
        ("a.gltf", b'{"asset": {"version": "2.0"}, "meshes": 3}', "meshes: expected an array"),
        ("a.jpg", b"\xff\xd8", r"unknown scene format: expected .*, got '\.jpg'"),
        ("noending", b"x", "unknown scene format"),
        ("a.zip", b"PK", r"unknown scene format: .*, got '\.zip'"),
        ("a.ply", POINTS.format("", ""), "is a point cloud without surfaces: make a mesh"),
        ("a.ply", POINTS.format(SPLAT, " 1 1 1 1"), "is a Gaussian splat, whose points have no su"),
        ("a.obj", b"v 0 0\nv 1 0\nv 1 1\nf 1 2 3\n", "expected vertices of three numbers"),
    ],
)
def test_bad_files_get_one_line(tmp_path, name, content, words):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(SceneError, match=words) as info:
        load_scene(path)
    assert str(path) in str(info.value)
    assert "\n" not in str(info.value)


@pytest.mark.parametrize("unit", ["e", "0", "-1", "1e999", "0,01"])
def test_collada_unit_that_is_none(tmp_path, unit):
    path = tmp_path / "box.dae"
    trimesh.creation.box().export(path)
    text = path.read_text().replace("</asset>", f'<unit meter="{unit}"/></asset>')
    path.write_text(text)
    with pytest.raises(
        SceneError, match=rf"box\.dae: <unit meter>: expected a number > 0, got '{unit}'"
    ):
        load_scene(path)


def test_irregular_files_and_unknown_names_are_refused(tmp_path):
    os.mkfifo(tmp_path / "a.glb")
    with pytest.raises(SceneError, match=r"a\.glb: is not a regular file"):
        load_scene(tmp_path / "a.glb")
    with pytest.raises(SceneError, match="cannot be read: File name too long"):
        load_scene("x" * 5000 + ".glb")
    with pytest.raises(SceneError, match="did you mean 'courtyard'"):
        load_scene("courtyrd")


@pytest.mark.parametrize(
    ("package", "message"),
    [
        ("charset_normalizer", "cannot be read as obj: is damaged, or not in the format"),
        ("networkx", "cannot be read as obj: it needs networkx: pip install networkx"),
    ],
)
def test_a_package_that_trimesh_lacks_is_an_error(monkeypatch, tmp_path, package, message):
    def load(*arguments, **options):
        raise ModuleNotFoundError(f"No module named {package!r}", name=package)

    monkeypatch.setattr(trimesh, "load_scene", load)
    (tmp_path / "a.obj").write_text("v 0 0 0\n")
    with pytest.raises(SceneError, match=message):
        load_scene(tmp_path / "a.obj")


def test_obj_with_texture_coordinates_of_one_number_is_in_its_plain_color(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0\nvt 1\nvt 1\nf 1/1 2/2 3/3\n"
    (tmp_path / "a.obj").write_text(text, encoding="utf-8")
    assert load_scene(tmp_path / "a.obj").meshes[0].texture_coordinates is None


TWO_TRIANGLES = (
    "v 0 0 0\nv 1 0 0\nv 0 1 0\n{first}f 1 2 3\nv 5 0 0\nv 6 0 0\nv 5 1 0\n{second}f 4 5 6\n"
)


@pytest.mark.parametrize(
    ("first", "second", "names"),
    [
        ("o chair_01\nusemtl m\n", "o table 2\nusemtl m\n", {"chair_01", "table 2"}),
        ("g legs\nusemtl m\n", "g top\n", {"legs", "top"}),
        ("o chair\ng legs\n", "g seat\n", {"chair/legs", "chair/seat"}),
        ("o chair\ng chair\n", "o table\ng default\n", {"chair", "table"}),
        ("o chair\nusemtl m\n", "usemtl n\n", {"chair"}),
        ("", "", {"a.obj"}),
    ],
)
def test_objects_and_groups_of_obj_are_instances(first, second, names, tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl m\nKd 1 0 0\nnewmtl n\nKd 0 1 0\n")
    path = tmp_path / "a.obj"
    path.write_text("mtllib a.mtl\n" + TWO_TRIANGLES.format(first=first, second=second))
    scene = load_scene(path)
    assert set(scene.instance_names) == names
    assert scene.triangle_count == 2
    if names == {"legs", "top"}:  # the material goes on through a group
        assert {scene.materials[mesh.material].name for mesh in scene.meshes} == {"m"}


@pytest.mark.parametrize(("line", "is_noted"), [("Tr 1", 1), ("d 0", 1), ("Tr 0", 0), ("d 1", 0)])
def test_invisible_materials_of_obj_are_noted(line, is_noted, tmp_path):
    scene = load_scene(_obj(tmp_path, f"newmtl m\nKd 1 0 0\n{line}\n"))
    assert scene.notices == ("a.obj: material 'm' is invisible: its opacity is 0",) * is_noted


def test_udim_tiles_are_named_and_the_first_is_drawn(tmp_path):
    Image.new("RGB", (2, 2), (250, 120, 60)).save(tmp_path / "wood.1001.png")
    scene = load_scene(_obj(tmp_path, "newmtl m\nmap_Kd wood.<UDIM>.png\n"))
    assert scene.materials[0].texture.pixels[0, 0].tolist() == [250, 120, 60, 255]
    (notice,) = scene.notices
    assert notice.endswith(
        "wood.<UDIM>.png is a set of UDIM tiles, of which the first, 1001, is drawn alone"
    )


def test_collada_without_an_up_axis_says_which_was_taken(tmp_path):
    path = tmp_path / "a.dae"
    trimesh.creation.box().export(path)
    text = re.sub(r"<up_axis>.*?</up_axis>", "", path.read_text())
    path.write_text(text)
    assert any("states no up axis: y is up" in notice for notice in load_scene(path).notices)
    assert not any("up axis" in notice for notice in load_scene(path, up_axis="z").notices)


def test_the_likely_unit_of_an_unusually_large_scene_is_said(tmp_path):
    path = tmp_path / "room.stl"
    for factor, words in (
        (1000.0, "is 5000 × 3000 × 2500 m: if those are millimeters, set meters_per_unit = 0.001"),
        (100.0, "is 500 × 300 × 250 m: if those are centimeters, set meters_per_unit = 0.01"),
    ):
        trimesh.creation.box(extents=np.array((5.0, 3.0, 2.5)) * factor).export(path)
        assert load_scene(path).notices == (f"room.stl: {words}, else 1",)
    assert load_scene(path, meters_per_unit=1.0).notices == ()  # confirmed
