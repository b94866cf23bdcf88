"""Submeshes of COLLADA files go by the names of nodes, as in Gazebo."""

import numpy as np
import pytest

from tests.scene.formats.sdf.worlds import load, model, sdf, visual

HEAD = """<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema"
 version="1.4.1"><asset><unit meter="1"/><up_axis>Z_UP</up_axis></asset>"""
# A triangle of 1 m, and another one higher up.
GEOMETRY = """<geometry id="{id}"><mesh><source id="{id}-p"><float_array id="{id}-a" count="18">
0 0 0 1 0 0 0 1 0 0 0 2 1 0 2 0 1 2</float_array><technique_common><accessor count="6"
 source="#{id}-a" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source><vertices id="{id}-v">
<input semantic="POSITION" source="#{id}-p"/></vertices>
<triangles count="1"><input offset="0" semantic="VERTEX" source="#{id}-v"/><p>0 1 2</p></triangles>
<polylist count="1"><input offset="0" semantic="VERTEX" source="#{id}-v"/><vcount>3</vcount>
<p>3 4 5</p></polylist></mesh></geometry>"""


def instance(geometry, x):
    return f'<translate>{x} 0 0</translate><instance_geometry url="#{geometry}"/>'


def submesh_of(tmp_path, name, center=False):
    """World of a submesh of a file whose geometries' names are those of other files' nodes."""
    nodes = (
        f'<node id="a" name="body">{instance("wheel_1", 10)}<node id="b">{instance("plain", 1)}'
        f'</node></node><node id="c" name="left">{instance("wheel_1", 20)}</node>'
        f'<node id="d" name="right">{instance("wheel_1", 30)}</node>'
        f'<node id="e"><node id="f">{instance("plain", 40)}</node></node>'
        '<node id="g" name="copy"><instance_node url="#h"/></node>'
    )
    library = f'<node id="h" name="target">{instance("plain", 50)}</node>'
    (tmp_path / "robot.dae").write_text(
        f"{HEAD}<library_geometries>{GEOMETRY.format(id='wheel_1')}{GEOMETRY.format(id='plain')}"
        f"</library_geometries><library_nodes>{library}</library_nodes><library_visual_scenes>"
        f'<visual_scene id="s">{nodes}</visual_scene></library_visual_scenes>'
        '<scene><instance_visual_scene url="#s"/></scene></COLLADA>'
    )
    rest = f"<submesh><name>{name}</name><center>{center}</center></submesh>".lower()
    inner = f"<mesh><uri>robot.dae</uri>{rest}</mesh>"
    return load(tmp_path, sdf(model("m", visual(inner))))


@pytest.mark.parametrize(
    ("name", "low_x", "high_x"),
    [
        ("left", 20, 21),
        ("right", 30, 31),
        ("body", 10, 12),  # with a child that has no name
        ("unnamed_submesh_0", 40, 41),
        ("target", 50, 51),  # of an instance of a node
        ("wheel_1", 10, 31),  # a geometry, where no node has the name
    ],
)
def test_a_submesh_is_a_node(tmp_path, name, low_x, high_x):
    scene = submesh_of(tmp_path, name)
    assert scene.notices == ()
    np.testing.assert_allclose(scene.bounds_m(), ((low_x, 0, 0), (high_x, 1, 2)))


def test_parts_of_a_submesh_are_centered(tmp_path):
    bounds = submesh_of(tmp_path, "right", center=True).bounds_m()
    np.testing.assert_allclose(bounds, ((-0.5, -0.5, 0), (0.5, 0.5, 0)))
