"""Meshes, materials, lights and background of worlds."""

import math

import numpy as np
import pytest
import trimesh
from PIL import Image

from omnisim.core.errors import SceneError
from omnisim.scene.model import AlphaMode, LightKind
from omnisim.scene.surface_kind import SurfaceKind, kind_of
from tests.scene.formats.sdf.worlds import BOX, load, model, sdf, visual, world
from tests.scene.world_corners import material_of

COLLISION = f'<collision name="c"><geometry>{BOX}</geometry></collision>'


def load_material(tmp_path, text, rest="", **options):
    inner = visual(BOX, rest=f"<material>{text}</material>{rest}")
    return load(tmp_path, sdf(model("m", inner)), **options)


def test_colors_are_linear_and_transparency_blends(tmp_path):
    scene = load_material(tmp_path, "<diffuse>0.1 0.2 0.3 1</diffuse>", "<transparency>0.25"
                          "</transparency>")  # fmt: skip
    material = material_of(scene, "m/link/visual")
    assert material.base_color == pytest.approx((0.1, 0.2, 0.3, 0.75))
    assert material.alpha_mode is AlphaMode.BLEND
    assert scene.notices == ()


@pytest.mark.parametrize(
    ("name", "color"), [("Gazebo/Red", (1, 0, 0, 1)), ("Gazebo/BlueTransparent", (0, 0, 1, 0.5))]
)
def test_colors_of_gazebos_script(tmp_path, name, color):
    script = f"<script><uri>file://media/materials/scripts/gazebo.material</uri><name>{name}"
    scene = load_material(tmp_path, f"{script}</name></script>")
    assert material_of(scene, "m/link/visual").base_color == color
    assert scene.notices == ()


SCRIPT = """
material Base { technique { pass { diffuse 0.2 0.4 0.6 1 } } }
// material Base { }
material Mine/Wood : Base
{
  technique
  {
    pass
    {
      ambient vertexcolor
      texture_unit { texture "wood.png" }
    }
    pass { diffuse 1 1 1 1 }
  }
}
"""


def test_a_script_beside_a_model_has_color_and_texture(tmp_path):
    scripts = tmp_path / "models" / "cup" / "materials" / "scripts"
    scripts.mkdir(parents=True)
    (scripts / "cup.material").write_text(SCRIPT)
    (scripts.parent / "textures").mkdir()
    Image.new("RGB", (2, 3), (9, 8, 7)).save(scripts.parent / "textures" / "wood.png")
    scene = load_material(
        tmp_path,
        "<script><uri>model://cup/materials/scripts</uri>"
        "<uri>model://cup/materials/textures</uri><name>Mine/Wood</name></script>",
    )
    material = material_of(scene, "m/link/visual")
    assert material.base_color == (0.2, 0.4, 0.6, 1.0)
    assert material.texture.pixels.shape == (3, 2, 4)
    assert scene.notices == ()


def gray(path, level, size=(2, 2)):
    Image.new("L", size, level).save(path)


def test_metal_and_maps_are_those_of_gltf(tmp_path):
    gray(tmp_path / "rough.png", 50)
    gray(tmp_path / "metal.png", 100, (4, 4))
    for name in ("normal", "occlusion", "glow"):
        Image.new("RGB", (2, 2), (10, 20, 30)).save(tmp_path / f"{name}.png")
    scene = load_material(
        tmp_path,
        "<pbr><metal><roughness>0.3</roughness><roughness_map>rough.png</roughness_map>"
        "<metalness_map>metal.png</metalness_map><normal_map>normal.png</normal_map>"
        "<ambient_occlusion_map>occlusion.png</ambient_occlusion_map>"
        "<emissive_map>glow.png</emissive_map></metal></pbr>",
    )
    material = material_of(scene, "m/link/visual")
    assert (material.metallic, material.roughness) == (0.5, 0.3)  # 0.5: the specification's
    assert material.metallic_roughness_map.pixels[0, 0, 1:3].tolist() == [50, 100]
    assert material.metallic_roughness_map.pixels.shape == (4, 4, 4)
    drawn = [texture for texture in material.maps if texture is not None]
    assert [texture.is_linear for texture in drawn] == [True, True, True, False]
    assert material.emissive == (1.0, 1.0, 1.0)
    assert scene.notices == ()


def test_what_is_matte_glows_or_takes_no_light(tmp_path):
    def drawn(text):
        scene = load_material(tmp_path, text, f"</visual>{COLLISION}<visual name='other'>")
        assert scene.instance_names == ("m/link/visual",)
        return material_of(scene, "m/link/visual")

    assert SurfaceKind.MATTE in kind_of(drawn("<diffuse>1 0 0</diffuse><specular>1 1 1</specular>"))
    assert drawn("").base_color == (0.7, 0.7, 0.7, 1.0)
    glow = drawn("<emissive>0 2 0 1</emissive><lighting>0</lighting>")
    assert glow.emissive == (0.0, 2.0, 0.0)
    assert glow.unlit


@pytest.mark.parametrize(
    ("text", "notice"),
    [
        ("<script><name>Gazebo/Wood</name></script>",
         "material Gazebo/Wood is drawn in a plain color (1 visual)"),
        ("<script><name>Mine</name></script>", "material Mine not found: gray is drawn (1 visual)"),
        ("<script><uri>a.material</uri><name>Mine</name></script>",
         "material Mine not found: gray is drawn (1 visual)"),
        ("<pbr><metal><albedo_map>a.png</albedo_map></metal></pbr>",
         "image a.png is missing: drawn without it (1 material)"),
    ],
)  # fmt: skip
def test_missing_scripts_and_textures_are_noted(tmp_path, text, notice):
    (tmp_path / "a.material").write_text("no words of OGRE\n")
    assert load_material(tmp_path, text).notices == (f"test.world: {notice}",)


def test_an_albedo_map_is_drawn_and_a_light_map_is_noted(tmp_path):
    (tmp_path / "materials" / "textures").mkdir(parents=True)
    Image.new("RGB", (4, 4), (200, 100, 50)).save(tmp_path / "materials" / "textures" / "a.png")
    scene = load_material(
        tmp_path,
        "<pbr><metal><albedo_map>a.png</albedo_map><light_map>b.png</light_map></metal></pbr>",
    )
    assert material_of(scene, "m/link/visual").texture.pixels[0, 0].tolist() == [200, 100, 50, 255]
    assert material_of(scene, "m/link/visual").base_color == (1.0, 1.0, 1.0, 1.0)
    assert scene.notices == ("test.world: light maps are not drawn (1 material)",)


def two_cubes(path):
    """Mesh file of two boxes, of 1 m at the origin and of 2 m at x = 10."""
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box((1, 1, 1)), node_name="small", geom_name="small")
    big = trimesh.creation.box((2, 2, 2)).apply_translation((10, 0, 0))
    scene.add_geometry(big, node_name="big", geom_name="big")
    path.write_bytes(scene.export(file_type="glb"))


def mesh(rest="", name="two.glb"):
    return f"<mesh><uri>{name}</uri>{rest}</mesh>"


def test_a_mesh_is_scaled_not_turned_and_read_once(tmp_path):
    two_cubes(tmp_path / "two.glb")
    scene = load(
        tmp_path,
        sdf(model("a", visual(mesh("<scale>1 2 3</scale>"))) + model("b", visual(mesh()))),
    )
    assert scene.bounds_m("a/link/visual") == pytest.approx(
        np.array(((-0.5, -2, -3), (11, 2, 3))), abs=1e-6
    )
    assert len(scene.meshes) == 2
    assert len(scene.instances) == 4


def test_a_submesh_is_chosen_and_centered(tmp_path):
    two_cubes(tmp_path / "two.glb")
    chosen = "<submesh><name>big</name>{}</submesh>"
    scene = load(
        tmp_path,
        sdf(
            model("a", visual(mesh(chosen.format(""))))
            + model("b", visual(mesh(chosen.format("<center>true</center>"))))
            + model("c", visual(mesh("<submesh><name>bigger</name></submesh>")))
        ),
    )
    assert scene.bounds_m("a/link/visual") == pytest.approx(np.array(((9.0, -1, -1), (11, 1, 1))))
    assert scene.bounds_m("b/link/visual") == pytest.approx(np.array(((-1.0,) * 3, (1,) * 3)))
    assert scene.notices == ("test.world: two.glb: submesh 'bigger' not found (1 visual)",)


def test_a_material_of_a_visual_replaces_those_of_its_mesh(tmp_path):
    two_cubes(tmp_path / "two.glb")
    own = visual(mesh(), rest="<material><diffuse>1 0 0 1</diffuse></material>")
    unknown = visual(mesh(), rest="<material><script><name>X</name></script></material>")
    scene = load(tmp_path, sdf(model("m", own) + model("n", unknown)))
    assert material_of(scene, "m/link/visual").base_color == (1.0, 0.0, 0.0, 1.0)
    assert material_of(scene, "n/link/visual").base_color != (1.0, 0.0, 0.0, 1.0)


def test_units_of_collada_count_and_its_up_axis_does_not(tmp_path):
    pytest.importorskip("collada")
    data = trimesh.creation.box((100, 200, 300)).export(file_type="dae").decode()
    text = '<unit name="centimeter" meter="0.01"/><up_axis>Y_UP</up_axis></asset>'
    data = data.replace("<up_axis>Y_UP</up_axis>", "").replace("</asset>", text)
    (tmp_path / "box.dae").write_text(data)
    scene = load(tmp_path, sdf(model("m", visual(mesh(name="box.dae")))))
    assert np.ptp(scene.bounds_m(), axis=0) == pytest.approx((1.0, 2.0, 3.0))


@pytest.mark.parametrize(("name", "data"), [("a.stl", b"solid"), ("a.fbx", b"x"), ("a.obj", b"")])
def test_a_mesh_that_cannot_be_read_is_noted(tmp_path, name, data):
    (tmp_path / name).write_bytes(data)
    scene = load(tmp_path, sdf(model("m", visual(mesh(name=name)) + visual(BOX, "box"))))
    assert scene.instance_names == ("m/link/box",)
    (notice,) = scene.notices
    assert notice.startswith(f"test.world: {name}: not drawn: ")
    assert notice.endswith("(1 visual)")


SUN = (
    '<light name="sun" type="directional"><pose>0 0 10 0 1.5707963267948966 0</pose>'
    "<diffuse>1 0.5 0 1</diffuse><intensity>2</intensity><direction>0 0 -1</direction></light>"
)


def test_lights_are_in_the_world(tmp_path):
    lamp = (
        '<light name="lamp" type="spot"><pose>0 0 1 0 0 0</pose><attenuation><range>8</range>'
        "<constant>0</constant><linear>0</linear><quadratic>0.5</quadratic></attenuation>"
        "<spot><inner_angle>0.2</inner_angle><outer_angle>1</outer_angle></spot></light>"
    )
    scene = load(tmp_path, world(SUN + model("m", lamp + visual(BOX), "<pose>1 2 3 0 0 0</pose>")))
    sun, spot = scene.lighting.lights
    assert sun.kind is LightKind.DIRECTIONAL
    assert sun.direction == pytest.approx((-1.0, 0.0, 0.0))  # turned with its pose
    assert (sun.color, sun.intensity) == ((1.0, 0.5, 0.0), 2.0)
    assert spot.kind is LightKind.SPOT
    assert spot.position_m == pytest.approx((1.0, 2.0, 4.0))
    assert (spot.intensity, spot.range_m) == (2.0, 8.0)
    assert spot.cone_cosines == pytest.approx((math.cos(0.1), math.cos(0.5)))
    assert scene.notices == ()


def test_lights_cast_shadows_where_the_file_says_so(tmp_path):
    stated = "<cast_shadows>1</cast_shadows>"
    for kind, text, casts in (
        ("directional", "", False),
        ("directional", stated, True),
        ("spot", stated, True),
        ("point", stated, False),  # as in Gazebo
    ):
        lamp = f'<light name="a" type="{kind}">{text}</light>'
        (light,) = load(tmp_path, world(lamp + model("m", visual(BOX)))).lighting.lights
        assert light.casts_shadow is casts


def test_visuals_cast_shadows_unless_the_file_denies_it(tmp_path):
    for text, casts in (("", True), ("<cast_shadows>0</cast_shadows>", False)):
        shown = visual(BOX).replace("</visual>", f"{text}</visual>")
        (material,) = load(tmp_path, world(model("m", shown))).materials
        assert material.casts_shadow is casts


def test_a_light_that_is_off_does_not_shine(tmp_path):
    off = SUN.replace("</light>", "<light_on>false</light_on></light>")
    lit = load(tmp_path, world(off + model("m", visual(BOX)))).lighting
    assert lit == load(tmp_path, sdf(model("m", visual(BOX)))).lighting


def test_the_background_and_what_is_left_out(tmp_path):
    scene = load(
        tmp_path,
        world(
            "<scene><background>0.1 0.2 0.3 1</background></scene><road name='r'/>"
            "<actor name='a'/><actor name='b'/>" + model("m", visual(BOX))
        ),
    )
    assert scene.background == (0.1, 0.2, 0.3)
    assert set(scene.notices) == {
        "test.world: actors are not drawn (2 actors)",
        "test.world: roads are not drawn (1 road)",
    }


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<diffuse>red</diffuse>", "material/diffuse: expected 3 or 4 numbers, got 'red'"),
        ("<diffuse>-1 0 0</diffuse>", "diffuse: expected three or four numbers ≥ 0, got '-1 0 0'"),
        ("<double_sided>maybe</double_sided>", "double_sided: expected true or false, got 'maybe'"),
    ],
)
def test_a_material_that_is_none_is_named(tmp_path, text, message):
    with pytest.raises(SceneError) as info:
        load_material(tmp_path, text)
    assert message in str(info.value)


def test_a_light_that_is_none_is_named(tmp_path):
    with pytest.raises(SceneError, match=r"light\[a\]: expected type point, directional or spot"):
        load(tmp_path, world('<light name="a" type="laser"/>'))
