"""MuJoCo models as scenes: their geoms, names, materials and lights; ranges are MuJoCo's own."""

import dataclasses

import numpy as np
import pytest

from omnisim import OmniCamera, load_scene, open_sensor
from omnisim.cameras import EquirectangularCamera
from omnisim.cameras.camera import pixel_grid
from omnisim.core.errors import SceneError
from omnisim.core.srgb import linear_from_srgb
from omnisim.scene.labels import find_labels
from omnisim.scene.light.lighting import DEFAULT_LIGHTING
from omnisim.scene.model import AlphaMode, LightKind
from omnisim.scene.surface_kind import SurfaceKind, kind_of
from omnisim.scene.surface_reflectance import dielectric_f0
from tests.scene.formats.mjcf.models import SHAPES
from tests.scene.gltf_builder import png
from tests.scene.world_corners import material_of, points_of

mujoco = pytest.importorskip("mujoco")
EYE_M = (0.0, 0.0, 0.8)


@pytest.fixture(scope="module")
def shapes(tmp_path_factory):
    path = tmp_path_factory.mktemp("mjcf") / "shapes.xml"
    path.write_text(SHAPES)
    return path


def _written(folder, body):
    path = folder / "model.xml"
    path.write_text(f"<mujoco>{body}</mujoco>")
    return path


def test_geoms_are_instances_named_by_their_bodies(shapes):
    scene = load_scene(shapes)
    assert scene.instance_names == (
        "floor", "ball/sphere", "can/side", "pill/capsule", "egg/ellipsoid", "crate/box",
        "crate/box_2", "ground/hfield", "tet/tetra",
    )  # fmt: skip
    classes = {kind.name for kind in find_labels(scene).classes}
    assert {"floor", "ball", "crate", "ground"} < classes


def test_what_is_not_drawn_is_said(shapes):
    assert load_scene(shapes).notices == tuple(
        f"shapes.xml: {notice}"
        for notice in (
            "not drawn, as in MuJoCo: 1 geom of group 3",
            "the headlight is drawn as ambient light",
            "attenuation of lamps is drawn as 1/distance², matched at the points they aim at",
            "the sky box is drawn in its mean color",
            "sites are not drawn (1 site)",
        )
    )


def test_planes_mirror_the_scene_and_other_geoms_do_not(tmp_path):
    body = """<asset><material name="glaze" rgba=".5 .5 .5 1" reflectance="{share}"/></asset>
      <worldbody>
        <geom name="floor" type="plane" size="4 4 1" material="glaze"/>
        <geom name="crate" type="box" size="1 1 1" pos="0 0 2" material="glaze"/>
      </worldbody>"""
    scene = load_scene(_written(tmp_path, body.format(share=0.3)))
    floor, crate = material_of(scene, "floor"), material_of(scene, "crate")
    # reflected at all angles, with the rest for the body
    assert dielectric_f0(floor.ior, floor.specular, (1.0, 1.0, 1.0))[0] == pytest.approx(0.3, 1e-4)
    assert (floor.specular, floor.roughness, floor.metallic) == (pytest.approx(0.3), 0.0, 0.0)
    assert SurfaceKind.MATTE in kind_of(crate)
    assert any("mirror images in 1 material" in notice for notice in scene.notices)
    clear = load_scene(_written(tmp_path, body.format(share=0.0)))
    assert SurfaceKind.MATTE in kind_of(material_of(clear, "floor"))
    assert not any("mirror" in notice for notice in clear.notices)


def test_colors_are_display_values_of_geom_material_and_texture(shapes):
    scene = load_scene(shapes)
    egg = material_of(scene, "egg/ellipsoid")
    assert egg.base_color[:3] == pytest.approx(linear_from_srgb([0.2, 0.8, 0.3]), rel=1e-6)
    can = material_of(scene, "can/side")  # a cube of one color needs no texture
    assert can.texture is None
    expected = linear_from_srgb([1.0, 0.5, 0.0]) * linear_from_srgb([0.5, 1.0, 1.0])
    assert can.base_color[:3] == pytest.approx(expected, rel=0.01)  # a step of 255
    assert material_of(scene, "crate/box_2").alpha_mode is AlphaMode.BLEND
    assert material_of(scene, "floor").texture is not None
    assert scene.background == pytest.approx(linear_from_srgb([0.3, 0.5, 0.7]), rel=0.02)


def test_one_square_image_is_on_all_faces_of_a_cube(tmp_path):
    (tmp_path / "wood.png").write_bytes(png(np.arange(12).reshape(2, 2, 3) * 20))
    path = _written(
        tmp_path,
        "<asset><texture name='w' type='cube' file='wood.png'/><material name='w' texture='w'/>"
        "</asset><worldbody><geom type='box' size='1 1 1' material='w'/></worldbody>",
    )
    scene = load_scene(path)
    textures = {id(scene.materials[scene.meshes[instance.mesh].material].texture): instance.mesh
                for instance in scene.instances}  # fmt: skip
    assert len(scene.instances) == 6
    assert len(textures) == 1
    texture = scene.materials[0].texture
    assert texture.pixels[..., :3].tolist() == (np.arange(12).reshape(2, 2, 3) * 20).tolist()


def test_lights_are_as_bright_as_stated_where_they_point_to(shapes):
    (light,) = load_scene(shapes).lighting.lights
    assert light.kind is LightKind.SPOT
    assert light.position_m.tolist() == [0.0, 0.0, 4.0]  # straight down to the floor
    assert light.intensity / 4.0**2 == pytest.approx(0.7, rel=1e-6)
    inner, outer = light.cone_cosines
    for angle_deg in (0.0, 15.0, 25.0, 35.0):  # MuJoCo's defaults: 45°, exponent 10
        cosine = np.cos(np.radians(angle_deg))
        share = np.clip((cosine - outer) / (inner - outer), 0.0, 1.0) ** 2
        assert share == pytest.approx(cosine**10, abs=0.1)


def test_a_model_without_lights_is_in_daylight(tmp_path):
    path = _written(tmp_path, "<worldbody><geom size='1'/></worldbody>")
    assert load_scene(path).lighting is DEFAULT_LIGHTING


def test_directional_lights_and_keyframes_count(tmp_path):
    path = _written(
        tmp_path,
        "<worldbody><light type='directional' dir='0 1 -1' diffuse='.5 .25 0' castshadow='false'/>"
        "<body name='b'><joint type='slide' axis='1 0 0'/><geom size='.1'/></body></worldbody>"
        "<keyframe><key qpos='3'/></keyframe>",
    )
    scene = load_scene(path)
    (light,) = scene.lighting.lights
    assert light.kind is LightKind.DIRECTIONAL
    assert light.intensity == 0.5
    assert not light.casts_shadow
    assert light.color == pytest.approx((1.0, 0.5, 0.0))
    assert light.direction == pytest.approx(np.array([0.0, 1.0, -1.0]) / np.sqrt(2.0))
    assert scene.pose_of("b/sphere")[:3, 3] == pytest.approx((3.0, 0.0, 0.0))


def test_other_axes_turn_the_lights_too(shapes):
    plain, turned = load_scene(shapes), load_scene(shapes, up_axis="y", meters_per_unit=0.5)
    (before,), (after,) = plain.lighting.lights, turned.lighting.lights
    x, y, z = before.position_m
    assert after.position_m == pytest.approx((0.5 * x, -0.5 * z, 0.5 * y))
    assert after.direction == pytest.approx((0.0, 1.0, 0.0))
    assert after.intensity == pytest.approx(before.intensity / 4.0)


def test_images_start_at_a_camera_of_the_world_or_in_front_of_the_middle(shapes, tmp_path):
    start = load_scene(shapes).start  # its camera looks straight down, y is up in its image
    assert start.position_m == pytest.approx((0.0, 0.0, 5.0))
    assert start.yaw_deg == pytest.approx(90.0)
    path = _written(
        tmp_path,
        "<statistic center='1 2 3' extent='2'/><worldbody><body><geom size='1'/>"
        "<camera pos='0 0 0'/></body></worldbody>",
    )
    start = load_scene(path).start
    assert start.position_m == pytest.approx((2.2, 2.0, 3.6))
    assert abs(start.yaw_deg) == pytest.approx(180.0)


def test_warnings_of_mujoco_are_notices(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    path = _written(tmp_path, "<!-- NaN --><worldbody><geom size='1' user='NaN'/></worldbody>")
    assert "model.xml: MuJoCo: XML contains a 'NaN'. Please check it carefully." in (
        load_scene(path).notices
    )
    assert capfd.readouterr() == ("", "")
    assert [one.name for one in tmp_path.iterdir()] == ["model.xml"]  # no log


SKIN = """
<worldbody>
  <body name="a"><geom size=".1" group="3"/>
    <body name="b" pos="1 0 0"><joint axis="0 0 1"/><geom size=".1" group="3"/></body></body>
</worldbody>
<deformable><skin name="hide" vertex="0 0 0  1 0 0  2 0 0  0 1 0" face="0 1 3  1 2 3">
  <bone body="a" bindpos="0 0 0" bindquat="1 0 0 0" vertid="0 3" vertweight="1 1"/>
  <bone body="b" bindpos="1 0 0" bindquat="1 0 0 0" vertid="1 2" vertweight="1 1"/>
</skin></deformable>
<keyframe><key qpos="1.5707963267948966"/></keyframe>
"""


def test_skins_are_bent_by_their_bones(tmp_path):
    scene = load_scene(_written(tmp_path, SKIN))
    (instance,) = scene.instances
    assert instance.name == "hide"
    assert points_of(scene)[:3] == pytest.approx(
        np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0)]), abs=1e-6
    )


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("<worldbody><geom size='x'/></worldbody>", "geom"),
        ("<worldbody><geom type='mesh' mesh='none'/></worldbody>", "none"),
        ("<worldbody", "XML"),
        ("<worldbody/>", "has no triangles to draw"),
        ("<worldbody><geom size='inf'/></worldbody>", "geom 0: size: expected finite numbers"),
        ("<asset><mesh file='gone.stl'/></asset>", "gone.stl"),
    ],
)
def test_faults_are_one_line_with_the_file(tmp_path, body, message):
    path = _written(tmp_path, body)
    with pytest.raises(SceneError) as error:
        load_scene(path)
    assert str(error.value).startswith(f"{path}: ")
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_names_that_are_no_text_are_an_error(tmp_path):
    path = tmp_path / "a.xml"
    path.write_bytes(b"<mujoco><worldbody><geom name='\xff' size='1'/></worldbody></mujoco>")
    with pytest.raises(SceneError, match="expected names in UTF-8, got b'\\\\xff'"):
        load_scene(path)


def _mujoco_ranges_m(model, data, eye_m, rays):
    ranges = np.empty(len(rays))
    geoms = np.empty(len(rays), np.int32)
    groups = np.array([1, 1, 1, 0, 0, 0], np.uint8)
    mujoco.mj_multiRay(
        model, data, np.array(eye_m), rays.ravel(), groups, True, -1, geoms, ranges, None,
        len(rays), 1e9,
    )  # fmt: skip
    return np.where(ranges < 0.0, np.inf, ranges), geoms


def test_ranges_and_geoms_are_those_of_mujoco(shapes):
    pytest.importorskip("embreex")
    width_px = 140
    model = mujoco.MjModel.from_xml_path(str(shapes))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = OmniCamera(EquirectangularCamera(width_px=width_px, height_px=width_px // 2))
    scene = load_scene(shapes)
    # what is half transparent is hit where it hides half
    solid = tuple(
        dataclasses.replace(material, alpha_mode=AlphaMode.OPAQUE) for material in scene.materials
    )
    scene = dataclasses.replace(scene, materials=solid)
    with open_sensor(scene, camera, backend="rays") as renderer:
        frame = renderer.render(camera.base_pose(EYE_M), also=("range", "instance"))
    rotation = np.array(frame.metadata["world_from_optical"])[:3, :3]
    rays = camera.model.ray_from_pixel(pixel_grid(width_px, width_px // 2)).directions
    rays = np.ascontiguousarray(rays.reshape(-1, 3) @ rotation.T)
    expected_m, geoms = _mujoco_ranges_m(model, data, EYE_M, rays)
    ours_m = frame.channels["range"].ravel()
    is_far = expected_m > 100.0  # where the floor ends
    both_miss = np.isinf(ours_m) & np.isinf(expected_m)
    with np.errstate(invalid="ignore"):
        errors_m = np.abs(ours_m - expected_m)
    is_right = both_miss | (errors_m <= np.maximum(1e-3, 1e-3 * expected_m))
    assert is_right[~is_far].mean() >= 0.999
    # geoms by name, in the model's order but for the one that is not drawn
    instance_of_geom = np.array([1, 0, *range(2, model.ngeom)])
    hit = np.isfinite(ours_m) & is_right
    assert (frame.channels["instance"].ravel()[hit] == instance_of_geom[geoms[hit]]).mean() > 0.9999
