"""Robots of URDF: visuals, materials, meshes of packages, and poses of joints at rest."""

import shutil
import sys

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from omnisim import load_scene
from omnisim.core.errors import SceneError
from omnisim.core.srgb import linear_from_srgb
from omnisim.scene.labels import find_labels
from omnisim.scene.model import AlphaMode
from tests.scene.gltf_builder import png
from tests.scene.world_corners import material_of

ROBOT = """
<robot name="arm">
  <material name="orange"><color rgba="1 0.5 0 1"/></material>
  <link name="base">
    <visual><geometry><box size="1 2 3"/></geometry><material name="orange"/></visual>
    <visual name="glass"><geometry><sphere radius="0.5"/></geometry>
      <material name=""><color rgba="0 0 1 0.5"/></material></visual>
    <collision><geometry><box size="9 9 9"/></geometry></collision>
  </link>
  <link name="upper">
    <visual><origin xyz="0 0 1" rpy="0.1 0.2 0.3"/>
      <geometry><cylinder radius="0.2" length="2"/></geometry></visual>
    <visual><geometry><cylinder radius="0.3" length="1"/></geometry></visual>
  </link>
  <link name="hand"><visual><geometry>
    <mesh filename="package://arm_description/meshes/hand.stl" scale="0.001 0.001 0.001"/>
  </geometry><material name="orange"/></visual></link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/>
    <origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/>
    <axis xyz="0 1 0"/><limit lower="0.2" upper="0.6"/>
  </joint>
  <joint name="wrist" type="fixed">
    <parent link="upper"/><child link="hand"/><origin xyz="0 0 2"/>
  </joint>
</robot>
"""


@pytest.fixture
def robot(tmp_path):
    meshes = tmp_path / "share" / "arm_description" / "meshes"
    meshes.mkdir(parents=True)
    trimesh.creation.box(extents=(100.0, 200.0, 300.0)).export(meshes / "hand.stl")
    (tmp_path / "robots").mkdir()
    path = tmp_path / "robots" / "arm.urdf"
    path.write_text(ROBOT)
    return path


def test_visuals_are_instances_named_by_their_links(robot):
    scene = load_scene(robot, resources=[robot.parents[1] / "share"])
    assert scene.instance_names == (
        "base/box", "base/glass", "upper/cylinder", "upper/cylinder_2", "hand/hand",
    )  # fmt: skip
    assert scene.notices == ()
    assert {"base", "upper", "hand"} < {kind.name for kind in find_labels(scene).classes}


def test_joints_rest_at_zero_or_in_the_middle_of_their_limits(robot):
    scene = load_scene(robot, resources=[robot.parents[1] / "share"])
    upper, visual = np.eye(4), np.eye(4)
    turned = Rotation.from_euler("z", 0.5 * np.pi) * Rotation.from_euler("y", 0.4)
    upper[:3, :3], upper[:3, 3] = turned.as_matrix(), (1.0, 0.0, 0.0)
    visual[:3, :3] = Rotation.from_euler("xyz", (0.1, 0.2, 0.3)).as_matrix()
    visual[:3, 3] = (0.0, 0.0, 1.0)
    assert scene.pose_of("upper/cylinder") == pytest.approx(upper @ visual)
    hand = upper.copy()
    hand[:3, 3] += upper[:3, 2] * 2.0
    assert scene.pose_of("hand/hand") == pytest.approx(hand)
    assert np.ptp(scene.bounds_m("hand/hand"), axis=0).max() < 0.5  # millimeters became meters


def test_colors_are_display_values_and_replace_those_of_meshes(robot):
    scene = load_scene(robot, resources=[robot.parents[1] / "share"])
    orange = (*linear_from_srgb([1.0, 0.5, 0.0]), 1.0)
    assert material_of(scene, "base/box").base_color == pytest.approx(orange)
    assert material_of(scene, "hand/hand").base_color == pytest.approx(orange)
    assert material_of(scene, "base/glass").alpha_mode is AlphaMode.BLEND


@pytest.mark.parametrize(
    ("variable", "folder"),
    [("ROS_PACKAGE_PATH", "elsewhere"), ("AMENT_PREFIX_PATH", "elsewhere/share")],
)
def test_packages_are_found_by_the_environment(robot, monkeypatch, variable, folder):
    top = robot.parents[1]
    for name in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(name, raising=False)
    shutil.copytree(top / "share", top / folder)
    shutil.rmtree(top / "share")
    monkeypatch.setenv(variable, str(top / "elsewhere"))
    assert "hand/hand" in load_scene(robot).instance_names


def test_missing_meshes_are_said(robot):
    (robot.parents[1] / "share").rename(robot.parents[2] / "away")
    scene = load_scene(robot)
    assert scene.notices == (
        "arm.urdf: 1 file not found, and not drawn: package://arm_description/meshes/hand.stl: "
        "pass the folder of the packages as --resources",
    )


def test_a_robot_may_be_named_like_a_mujoco_model_and_needs_no_extra(robot, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    xml = robot.with_suffix(".xml")
    robot.rename(xml)
    assert "base/box" in load_scene(xml).instance_names


def test_textures_are_those_of_thematerial_of(tmp_path):
    (tmp_path / "wood.png").write_bytes(png(np.full((2, 2, 3), 200)))
    path = tmp_path / "a.urdf"
    path.write_text(
        "<robot name='a'><link name='l'><visual><geometry><box size='1 1 1'/></geometry>"
        "<material name='wood'><texture filename='wood.png'/></material></visual></link></robot>"
    )
    scene = load_scene(path)
    assert material_of(scene, "l/box").texture is not None


def test_a_robot_without_any_mesh_that_is_found_is_an_error(tmp_path):
    path = tmp_path / "a.urdf"
    mesh = "<mesh filename='package://p/a.stl'/>"
    path.write_text(f"<robot name='a'>{LINK.format(mesh)}</robot>")
    with pytest.raises(SceneError) as error:
        load_scene(path)
    assert str(error.value) == (
        f"{path}: has nothing to draw: 1 file not found: package://p/a.stl: pass the folder of the "
        "packages as --resources"
    )


LINK = "<link name='a'><visual><geometry>{}</geometry></visual></link>"
JOINT = "<joint name='j' type='fixed'><parent link='{}'/><child link='{}'/></joint>"


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (LINK.format("<box size='1 1'/>"), "geometry/box: size: expected 3 numbers, got '1 1'"),
        (LINK.format("<sphere radius='-1'/>"), "sphere: radius: expected a number > 0, got '-1'"),
        (LINK.format("<sphere/>"), "sphere: radius: expected a number, got ''"),
        ("", "robot: expected a <link>, got none"),
        ("<link name='a'/>", "has no triangles to draw"),
        ("<link name='a'/><link name='a'/>", "link[a]: name: expected each link once, got 'a'"),
        ("<link name='a'/>" + JOINT.format("a", "b"), "link: expected the name of a <link>"),
        (
            "<link name='a'/><link name='b'/>" + JOINT.format("a", "b") + JOINT.format("b", "a"),
            "expected a tree of links, got a cycle",
        ),
        (
            "<link name='a'/><link name='b'/>" + 2 * JOINT.format("a", "b"),
            "expected a link without another parent, got 'b'",
        ),
        ("<link", "not XML"),
    ],
)
def test_faults_are_one_line_with_the_place(tmp_path, body, message):
    path = tmp_path / "a.urdf"
    path.write_text(f"<robot name='r'>{body}</robot>")
    with pytest.raises(SceneError) as error:
        load_scene(path)
    assert str(error.value).startswith(f"{path}: ")
    assert message in str(error.value)
    assert "\n" not in str(error.value)


TRIANGLE_OBJ = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n{}f 1 2 3\n"
VISUAL = '<visual name="{0}"><geometry><mesh filename="{0}.obj"/></geometry>{1}</visual>'


def _robot_of_meshes(folder, names, use, mtl, material=""):
    """Robot of triangles by their names, with a material file."""
    (folder / "a.mtl").write_text(mtl)
    for name in names:
        (folder / f"{name}.obj").write_text(TRIANGLE_OBJ.format(use.get(name, "")))
    visuals = "".join(VISUAL.format(name, material) for name in names)
    path = folder / "a.urdf"
    path.write_text(f'<robot name="r"><link name="l">{visuals}</link></robot>')
    return path


@pytest.mark.parametrize(
    ("key", "own", "notices"),
    [("", "red", 1), ('urdf_materials = "robot"', "red", 0), ('urdf_materials = "mesh"', "own", 0)],
)
def test_a_material_of_the_robot_on_a_mesh_with_its_own_is_noted(key, own, notices, tmp_path):
    red = '<material name="red"><color rgba="1 0 0 1"/></material>'
    use, mtl = {"own": "usemtl own\n"}, "newmtl own\nKd 0 0 1\n"
    path = _robot_of_meshes(tmp_path, ("own", "plain"), use, mtl, red)
    toml = tmp_path / "scene.toml"
    toml.write_text(f'file = "{path.name}"\n{key}\n')
    scene = load_scene(toml)
    assert (material_of(scene, "l/own").name, material_of(scene, "l/plain").name) == (own, "red")
    assert len(scene.notices) == notices
    if notices:
        assert "replace those of the meshes (1 visual)" in scene.notices[0]


def test_a_package_in_a_clone_of_another_name_is_found_by_package_xml(tmp_path):
    clone = tmp_path / "a-clone"
    for name in ("meshes", "urdf"):
        (clone / name).mkdir(parents=True)
    (clone / "package.xml").write_text("<package><name> arm_description </name></package>")
    trimesh.creation.box().export(clone / "meshes" / "hand.stl")
    path = clone / "urdf" / "arm.urdf"
    path.write_text(ROBOT)
    assert "hand/hand" in load_scene(path).instance_names
    elsewhere = tmp_path / "robot" / "arm.urdf"
    elsewhere.parent.mkdir()
    elsewhere.write_text(ROBOT)
    for folder in (clone, tmp_path):  # the package itself, or the folder of the clones
        assert "hand/hand" in load_scene(elsewhere, resources=[folder]).instance_names


def test_equal_notices_of_several_mesh_files_are_one(tmp_path):
    use = dict.fromkeys("abc", "usemtl m\n")
    path = _robot_of_meshes(tmp_path, "abc", use, "newmtl m\nKd 1 0 0\nKs 1 1 1\n")
    assert load_scene(path).notices == (
        "a.urdf: a.obj and 2 more files: highlights are not drawn: surfaces are matte",
    )
