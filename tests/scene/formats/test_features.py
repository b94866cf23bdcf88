"""Tables of the formats' features: whatever stands in a file changes the scene, or is noted."""

import copy
import dataclasses
import itertools
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from omnisim.core.errors import SceneError
from omnisim.core.extras import is_installed
from omnisim.core.files.sources import fingerprint
from omnisim.scene import load_scene
from omnisim.scene.formats.features import (
    ROBOT_TABLES,
    TABLES,
    Support,
    feature_table,
    part_notices,
)
from tests.fuzz.readers import READERS

SDF = """<sdf version="1.9"><world name="w"><scene>{scene}</scene>{world}
<light name="sun" type="spot"><attenuation><constant>0</constant><linear>0</linear><quadratic>1
</quadratic></attenuation>{light}</light><model name="m"><link name="l">{link}
<visual name="v"><geometry><box><size>1 2 3</size></box></geometry><material>
<diffuse>1 0 0</diffuse><pbr><metal>{metal}</metal></pbr></material></visual>{visual}</link></model>
</world></sdf>"""
ROBOT = """<robot name="r"><link name="l"><visual><geometry><box size="1 2 3"/></geometry>
</visual></link><link name="c"/><joint name="j" type="fixed"><parent link="l"/><child link="c"/>
{joint}</joint>{robot}</robot>"""
MUJOCO = """<mujoco>{top}<asset><texture name="t" type="cube" builtin="flat" width="1" height="6"
rgb1="1 0 0"/><material name="m" {material}/></asset><worldbody>
<geom type="box" size="1 1 1" material="m"/>{body}</worldbody>{end}</mujoco>"""
STAGE = """#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
)
def Cube "cube" {{
    double size = 2
}}
def SphereLight "lamp" {{
    {lamp}
}}
{stage}
"""
OBJ = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n{obj}\n"
MTL = "newmtl m\nKd 0.5 0.2 0.1\n{mtl}\n"
PLY = """ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n
property float z\n{vertex}element face 1\nproperty list uchar int vertex_indices\n{face}{more}
end_header\n0 0 0{v}\n1 0 0{v}\n0 1 0{v}\n3 0 1 2{f}\n{m}"""
COLLADA = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="1"/><up_axis>Z_UP</up_axis></asset>{top}<library_effects><effect id="e">
<profile_COMMON><technique sid="t"><phong><diffuse><color>1 0 0 1</color></diffuse>{phong}</phong>
</technique></profile_COMMON></effect></library_effects><library_materials><material id="m">
<instance_effect url="#e"/></material></library_materials><library_geometries><geometry id="g">
<mesh><source id="p"><float_array id="pa" count="9">0 0 0 1 0 0 0 0 2</float_array>
<technique_common><accessor source="#pa" count="3" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v">
<input semantic="POSITION" source="#p"/></vertices><triangles count="1"><input semantic="VERTEX"
source="#v" offset="0"/><p>0 1 2</p></triangles>{mesh}</mesh></geometry>{geometry}
</library_geometries><library_visual_scenes><visual_scene id="s"><node id="n">
<instance_geometry url="#g"/>{node}</node></visual_scene></library_visual_scenes><scene>
<instance_visual_scene url="#s"/></scene></COLLADA>"""

_BOX = '<visual name="i"><geometry><image><uri>gray.png</uri></image></geometry></visual>'
# By format and slot of its file: texts that use a part that is left out, with the part's name.
USES = {
    "sdf": {
        "scene": {"sky": "<sky/>", "shadows": "<shadows>false</shadows>"},
        "world": {"actor": "<actor name='a'/>"},
        "light": {"falloff": "<spot><falloff>2</falloff></spot>"},
        "link": {"projector": "<projector/>"}, "metal": {"light_map": "<light_map>1</light_map>"},
        "visual": {"image": _BOX},
    },
    "urdf": {
        "joint": {"mimic@offset": '<mimic joint="k" offset="0.5"/>'},
        "robot": {"gazebo/material, gazebo/visual, gazebo/light":
                  "<gazebo reference='l'><light/></gazebo>"},
    },
    "mjcf": {
        "material": {"material@specular, material@shininess": 'specular="0.5"'},
        "body": {"light@texture": '<light type="image" texture="t"/>', "visible sites": '<site/>'},
        "top": {"map@haze, rgba@haze": '<visual><map haze="0.5"/></visual>'}, "end": {},
    },
    "usd": {
        "lamp": {
            "inputs:shaping:focus": "float inputs:shaping:focus = 3",
            "inputs:shadow:enable": "bool inputs:shadow:enable = 0",
        },
        "stage": {
            "GenerativeProcedural, Field3DAsset, OpenVDBAsset": 'def OpenVDBAsset "other" {}',
            "GeometryLight, PluginLight, PortalLight, MeshLightAPI, VolumeLightAPI":
                'def Cube "other" ( prepend apiSchemas = ["MeshLightAPI"] ) {}',
            "model:drawMode": 'def Xform "other" {\n uniform token model:drawMode = "cards"\n}',
        },
    },
    "obj": {"obj": {"s": "s 1", "p, l": "l 1 2"}},
    "mtl": {
        "mtl": {
            "bump, map_bump, norm": "map_bump a.png", "tf": "Tf 1 0.5 0.5",
            "map_kd-clamp, map_kd-mm, map_kd-t, map_kd-imfchan, map_d-s, map_d-o":
                "map_Kd -clamp on a.png",
        }
    },
    "dae": {
        "phong": {"emission": "<emission><color>1 0 0 1</color></emission>"},
        "mesh": {"lines, linestrips, spline": '<lines count="0"/>'},
        "geometry": {"convex_mesh, brep": '<geometry id="x"><brep/></geometry>'},
        "node": {"skew, lookat": "<skew>45 0 1 0 1 0 0</skew>"},
        "top": {"animation": '<library_animations><animation id="a"/></library_animations>'},
    },
}  # fmt: skip
TEXTS = {"sdf": SDF, "urdf": ROBOT, "mjcf": MUJOCO, "usd": STAGE, "obj": OBJ, "mtl": MTL,
         "dae": COLLADA}  # fmt: skip
SUFFIXES = {"sdf": ".world", "urdf": ".urdf", "mjcf": ".xml", "usd": ".usda", "obj": ".obj",
            "mtl": ".obj", "dae": ".dae"}  # fmt: skip
NEEDS = {"mjcf": "mujoco", "usd": "pxr", "dae": "collada"}


@pytest.fixture(autouse=True)
def _stages_are_read_here(monkeypatch):
    from omnisim.scene.formats.usd import reader

    monkeypatch.setattr(reader, "call_isolated", lambda read, *arguments: read(*arguments))


def _load(folder, table, **parts):
    """Scene of a format's file with a text in each slot."""
    Image.new("L", (4, 4), 90).save(folder / "gray.png")
    slots = dict.fromkeys(USES[table], "")
    text = TEXTS[table].format(**{**slots, **parts})
    if table == "mtl":
        (folder / "a.mtl").write_text(text)
        text = OBJ.format(obj="")
    elif table == "obj":
        (folder / "a.mtl").write_text(MTL.format(mtl=""))
    path = folder / f"a{SUFFIXES[table]}"
    path.write_text(text)
    return load_scene(path)


def test_parts_that_are_left_out_are_noted_unless_they_change_nothing():
    values = ("1", "0", "0.5", "0 0 0 1", "false", "", "L8", "R8G8B8")
    for table in (*TABLES[1:], *ROBOT_TABLES):  # in glTF's, values have commas, too
        features = feature_table(table)
        names = [name for feature in features for name in feature.names]
        assert len(names) == len(set(names))
        for feature in (one for one in features if one.support is Support.LEFT_OUT):
            for value, name in itertools.product(values, feature.names):
                notices = part_notices(table, [(name, value), (name, value)])
                assert len(notices) == feature.is_used(value)
                assert all(notice.startswith(f"{feature.effect} (2 ") for notice in notices)


@pytest.mark.parametrize(
    ("table", "name", "unused"),
    [
        ("sdf", "road", ()),
        ("sdf", "light_map", ("0", "none")),
        (
            "sdf",
            "shadows",
            ("1", "0 1 0", "(0.0, 0)", "0 0 0 1", "a.png", "1.0 1", "L8", "RGB_INT8"),
        ),
        ("mtl", "ks", ("0", "(0.0, 0)")),
        ("dae", "transparency", ("1", "1.0 1")),
        ("dae", "emission", ("0", "(0.0, 0)", "0 0 0 1")),
        ("camera", "format", ("RGB_INT8",)),
    ],
)
def test_values_that_change_nothing(table, name, unused):
    (feature,) = [one for one in feature_table(table) if name in one.names]
    values = ("0", "1", "none", "0 1 0", "(0.0, 0)", "0 0 0 1", "a.png", "1.0 1", "L8", "RGB_INT8")
    assert tuple(value for value in values if not feature.is_used(value)) == unused


@pytest.mark.parametrize("table", TEXTS)
def test_parts_of_files_that_are_left_out_are_noted(table, tmp_path):
    if table in NEEDS and not is_installed(NEEDS[table]):
        pytest.skip("needs an extra")
    effects = {one.name: one.effect for one in feature_table(table)}
    if table not in NEEDS:
        assert _load(tmp_path, table).notices == ()
    for slot, uses in USES[table].items():
        for name, text in uses.items():
            try:
                notices = _load(tmp_path, table, **{slot: text}).notices
            except SceneError as reason:  # a reader that then has nothing left says why
                notices = (str(reason),)
            assert any(effects[name] in notice for notice in notices), (name, notices)


@pytest.mark.parametrize(
    ("table", "slot", "text", "name"),
    [
        ("sdf", "visual", "<halo>1</halo>", "halo"),
        ("sdf", "metal", "<sheen>1</sheen>", "sheen"),
        ("urdf", "robot", "<halo/>", "halo"),
        ("obj", "obj", "halo 3", "halo"),
        ("mtl", "mtl", "halo 3", "halo"),
    ],
)
def test_unknown_parts_are_named(table, slot, text, name, tmp_path):
    (notice,) = _load(tmp_path, table, **{slot: text}).notices
    assert notice.endswith(f": not read: {name}")


@pytest.mark.skipif(not is_installed("pxr"), reason="usd-core is not installed")
def test_unknown_types_and_properties_of_a_stage_are_named(tmp_path):
    stage = 'def Mesh "m" {\n float halo = 1\n}\ndef Halo "h" {}'
    assert any(
        "not read: halo, Halo" in notice for notice in _load(tmp_path, "usd", stage=stage).notices
    )


def _ply(folder, vertex="", face="", more="", v="", f="", m=""):
    path = folder / "a.ply"
    text = PLY.format(vertex=vertex, face=face, more=more, v=v, f=f, m=m).replace("\n\n", "\n")
    path.write_text(text)
    return load_scene(path).notices


def test_parts_of_ply(tmp_path):
    assert _ply(tmp_path) == ()
    notices = _ply(tmp_path, vertex="property float halo\nproperty uchar diffuse_red\n", v=" 1 2")
    assert [notice[7:] for notice in notices] == [
        "colors named other than red, green and blue are not drawn (1 property)",
        "not read: vertex.halo",
    ]
    notices = _ply(tmp_path, face="property int texnumber\n", f=" 1")
    assert [notice[7:] for notice in notices] == [
        "textures beyond the first are not drawn (1 property)"
    ]


def test_colors_of_stl_and_off(tmp_path):
    path = tmp_path / "a.stl"
    triangle = np.zeros(1, [("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    triangle["v"][0] = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    for attribute, count in ((0, 0), (0x7C00, 1)):
        triangle["a"] = attribute
        path.write_bytes(bytes(80) + np.uint32(1).tobytes() + triangle.tobytes())
        assert len(load_scene(path).notices) == count
    path = tmp_path / "a.off"
    for head, rest, count in (("OFF", "", 0), ("COFF", "", 1), ("OFF", " 255 0 0", 1)):
        path.write_text(f"{head}\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2{rest}\n")
        assert len(load_scene(path).notices) == count


@pytest.mark.skipif(not is_installed("mujoco"), reason="MuJoCo is not installed")
def test_every_element_of_mujocos_schema_is_in_its_table():
    import mujoco

    known = {name: one.support for one in feature_table("mjcf") for name in one.names}
    outer, unknown = {}, set()  # names by indentation
    for line in mujoco.mj_printSchema(False, False).split("\n"):
        name, _, rest = line.strip().partition(" ")
        depth = len(line) - len(line.lstrip())
        if not rest.strip().startswith("("):
            continue
        outer = {key: value for key, value in outer.items() if key < depth} | {depth: name}
        is_inside = any(known.get(one) is Support.IGNORED for one in [*outer.values()][:-1])
        if not is_inside and name not in known:
            unknown.add(name)
    assert unknown == {"mujoco", "(world)body"}


@pytest.mark.skipif(not is_installed("pxr"), reason="usd-core is not installed")
def test_every_type_of_usds_schemas_is_in_its_table():
    from pxr import Tf, Usd

    registry, known = Usd.SchemaRegistry(), {n for one in feature_table("usd") for n in one.names}
    kinds = Tf.Type.Find(Usd.Typed).GetAllDerivedTypes()
    types = {registry.GetConcreteSchemaTypeName(one) for one in kinds} - {""}
    assert {one for one in types if not one.startswith("Preliminary")} <= known
    for kind in ("Mesh", "Camera", "SphereLight", "DomeLight", "RectLight"):
        names = registry.FindConcretePrimDefinition(kind).GetPropertyNames()
        assert {name for name in names if ":" not in name} <= known | {"treatAsPoint"}


def _without_each(root):
    """Copies of a tree, each without one of its elements or attributes, with what is missing."""
    for number, element in enumerate(root.iter()):
        for name in element.attrib:
            other = copy.deepcopy(root)
            del list(other.iter())[number].attrib[name]
            yield f"{element.tag}@{name}", other
        for index, child in enumerate(element):
            other = copy.deepcopy(root)
            parent = list(other.iter())[number]
            parent.remove(parent[index])
            yield f"{element.tag}/{child.tag}", other


def _outcome(path):
    """Contents and notices of a scene, or the error."""
    try:
        scene = load_scene(path)
    except SceneError as reason:
        return str(reason)
    return fingerprint(dataclasses.replace(scene, notices=())), scene.notices


# Parts of the samples that state what is so without them, or what others state again: a length of
# 1 m, poses below a state, the center of a centered mesh, names of which nothing is called.
SAME = {
    "a.world": """capsule/length cone/length cylinder/length light/pose light@name link@name
    model/pose pose@relative_to sdf@version state/light state@world_name world@name""",
    "cup/cup.sdf": """frame/pose joint/child light@name mesh/submesh model/joint model@name
    sdf@version submesh/center submesh/name""",
    "a.urdf": "joint@name robot@name",
    "a.dae": "",
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("reader", "name"),
    [
        pytest.param("sdf", "a.world", marks=pytest.mark.long),
        pytest.param("sdf", "cup/cup.sdf", marks=pytest.mark.long),
        ("urdf", "a.urdf"),
        ("dae", "a.dae"),
    ],
)
def test_each_part_of_a_sample_changes_the_scene_or_is_noted(reader, name, tmp_path):
    READERS[reader].build(tmp_path)
    path = tmp_path / name
    scene_path = tmp_path / ("a.world" if reader == "sdf" else name)
    root, whole = ElementTree.fromstring(path.read_bytes()), _outcome(scene_path)
    without_effect = set()
    for part, other in _without_each(root):
        path.write_bytes(ElementTree.tostring(other))
        if _outcome(scene_path) == whole:
            without_effect.add(part)
    assert without_effect == set(SAME[name].split())
