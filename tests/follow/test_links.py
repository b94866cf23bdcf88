"""Links of files, which a simulator moves: their poses at rest, and what is fixed to what."""

import numpy as np
import pytest

from omnisim.follow import BodyStage
from omnisim.follow.body_stage import split_links
from omnisim.scene.files.load import load_scene

BOX = "<visual name='v'><geometry><box><size>1 1 1</size></box></geometry></visual>"
WORLD = f"""
<sdf version='1.9'><world name='w'>
  <model name='hall'><static>true</static><link name='floor'>{BOX}</link></model>
  <model name='cart'><pose>1 2 3 0 0 0</pose>
    <link name='chassis'>{BOX}</link>
    <link name='wheel'><pose>0 1 0 0 0 1.5</pose>{BOX}</link>
    <link name='lid'><pose>0 0 2 0 0 0</pose>{BOX}</link>
    <link name='post'>{BOX}</link>
    <joint name='a' type='fixed'><parent>chassis</parent><child>lid</child></joint>
    <joint name='b' type='fixed'><parent>world</parent><child>post</child></joint>
  </model>
</world></sdf>
"""
STAGE = """#usda 1.0
(
    defaultPrim = "World"
    upAxis = "Y"
    metersPerUnit = 0.01
)
def Xform "World"
{
    def Cube "floor" {}
    def Xform "robot" ( kind = "component" )
    {
        def Xform "base" ( prepend apiSchemas = ["PhysicsRigidBodyAPI"] )
        {
            double3 xformOp:translate = (0, 100, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
            def Cube "shell" {}
        }
        def Cube "arm" ( prepend apiSchemas = ["PhysicsRigidBodyAPI"] ) {}
        def Cube "tool" ( prepend apiSchemas = ["PhysicsRigidBodyAPI"] ) {}
        def PhysicsFixedJoint "joint"
        {
            rel physics:body0 = </World/robot/arm>
            rel physics:body1 = </World/robot/tool>
        }
    }
}
"""


def links_of(path):
    scene = load_scene(path)
    return scene, {link.name: link for link in scene.links}


def test_links_of_a_world_stand_still_or_move(tmp_path):
    path = tmp_path / "w.sdf"
    path.write_text(WORLD)
    scene, links = links_of(path)
    assert {name: link.fixed_to for name, link in links.items()} == {
        "hall/floor": "", "cart/chassis": "cart/chassis", "cart/wheel": "cart/wheel",
        "cart/lid": "cart/chassis", "cart/post": "",
    }  # fmt: skip
    np.testing.assert_allclose(links["cart/wheel"].world_from_link[:3, 3], (1.0, 3.0, 3.0))
    still, shapes, lost = split_links(
        scene, "", {"cart/chassis": "base", "cart/wheel": "wheel"}, {}
    )
    assert still.instance_names == ("hall/floor/v", "cart/post/v")
    assert shapes["base"].instance_names == ("cart/chassis/v", "cart/lid/v")
    np.testing.assert_allclose(shapes["wheel"].bounds_m(), ([-0.5] * 3, [0.5] * 3), atol=1e-6)
    np.testing.assert_allclose(shapes["base"].bounds_m()[1], (0.5, 0.5, 2.5), atol=1e-6)
    assert not lost


def test_what_is_fixed_follows_the_first_link_that_is_a_body(tmp_path):
    path = tmp_path / "w.sdf"
    path.write_text(WORLD)
    _, shapes, lost = split_links(load_scene(path), "", {"cart/lid": "lid"}, {})
    np.testing.assert_allclose(shapes["lid"].bounds_m()[0], (-0.5, -0.5, -2.5), atol=1e-6)
    assert lost == ["cart/wheel"]


def test_links_that_are_fixed_to_each_other_or_to_none_move(tmp_path):
    path = tmp_path / "w.sdf"
    path.write_text(
        WORLD.replace(
            "<joint name='b' type='fixed'><parent>world</parent><child>post</child></joint>",
            "<joint name='b' type='fixed'><parent>lid</parent><child>chassis</child></joint>"
            "<joint name='c' type='fixed'><parent>nothing</parent><child>post</child></joint>",
        )
    )
    _, shapes, lost = split_links(load_scene(path), "", {"cart/post": "post"}, {})
    assert list(shapes) == ["post"]
    assert "cart/wheel" in lost


def test_rigid_bodies_of_a_stage_are_links_and_instances(tmp_path):
    pytest.importorskip("pxr", reason="usd-core, which reads stages, is missing")
    path = tmp_path / "w.usda"
    path.write_text(STAGE)
    scene, links = links_of(path)
    assert {name: link.fixed_to for name, link in links.items()} == {
        "robot/base": "robot/base", "robot/arm": "robot/arm", "robot/tool": "robot/arm",
    }  # fmt: skip
    np.testing.assert_allclose(links["robot/base"].world_from_link[:3, 3], (0.0, 0.0, 1.0))
    names = ["World/robot/base", "World/robot/arm"]
    with BodyStage(scene, names=names, up_axis="y", meters_per_unit=0.01) as stage:
        assert sorted(stage.objects) == sorted(names)
        assert stage.scene.instance_names == ("floor",)
        assert stage.notices == ()
