"""Tables of the formats' features: whatever stands in a file changes the scene, or is noted."""

import copy
import dataclasses
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from omnisim.core.errors import SceneError
from omnisim.core.extras import is_installed
from omnisim.core.files.sources import fingerprint
from omnisim.scene import load_scene
from omnisim.scene.formats.features import ROBOT_TABLES, TABLES, Support, feature_table
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

_HEIGHTMAP = """<visual name="h"><geometry><heightmap><uri>gray.png</uri><size>1 1 1</size><texture>
<diffuse>gray.png</diffuse><normal>gray.png</normal><size>1</size></texture></heightmap></geometry>
</visual>"""
_BOX = '<visual name="i"><geometry><image><uri>gray.png</uri></image></geometry></visual>'


def _tags(names, text="1"):
    return {name: f"<{name}>{text}</{name}>" for name in names.split(", ")}


def _lines(names, text="1 0.5 0.5"):
    return {name: f"{name} {text}" for name in names.split(", ")}


# By format, slot of its file and name of a part that is left out: text that uses it.
USES = {
    "sdf": {
        "scene": {
            **_tags("sky"), "scene/ambient": "<ambient>1 1 1 1</ambient>",
            "shadows": "<shadows>false</shadows>", "fog/type": "<fog><type>linear</type></fog>",
        },
        "world": {
            "actor": "<actor name='a'/>", **_tags("road, population"),
            "experimental:params": "<include><uri>cup</uri><experimental:params/></include>",
        },
        "light": {"falloff": "<spot><falloff>2</falloff></spot>"},
        "link": {**_tags("projector, particle_emitter")},
        "metal": {**_tags("specular_map, glossiness_map, glossiness, environment_map, light_map")},
        "visual": {"texture/normal": _HEIGHTMAP, "image": _BOX},
    },
    "urdf": {
        "joint": {"mimic@offset": '<mimic joint="k" offset="0.5"/>'},
        "robot": {
            f"gazebo/{name}": f"<gazebo reference='l'><{name}/></gazebo>"
            for name in ("material", "visual", "light")
        },
    },
    "mjcf": {
        "material": {"material@specular": 'specular="0.5"', "material@shininess": 'shininess=".5"'},
        "body": {
            "light@texture": '<light type="image" texture="t"/>',
            "visible sites": '<site name="s"/>',
        },
        "top": {
            "map@haze": '<visual><map haze="0.5"/></visual>',
            "rgba@haze": '<visual><rgba haze="1 0 0 1"/></visual>',
        },
        "end": {},
    },
    "usd": {
        "lamp": {
            "inputs:specular": "float inputs:specular = 0",
            "inputs:shaping:focus": "float inputs:shaping:focus = 3",
            "inputs:shaping:ies:file": "asset inputs:shaping:ies:file = @a.ies@",
            "inputs:shadow:enable": "bool inputs:shadow:enable = 0",
            "inputs:shadow:color": "color3f inputs:shadow:color = (1, 0, 0)",
            "light:filters": "rel light:filters = </cube>",
            **{
                name: f"rel {name} = </cube>"
                for kind in ("light", "shadow")
                for way in ("includes", "excludes")
                for name in (f"collection:{kind}Link:{way}",)
            },
        },
        "stage": {
            **{
                name: f'def {name} "other" {{}}'
                for name in (
                    "GeometryLight", "PluginLight", "PortalLight", "GenerativeProcedural",
                    "Field3DAsset", "OpenVDBAsset",
                )
            },
            **{
                name: f'def Cube "other" ( prepend apiSchemas = ["{name}"] ) {{}}'
                for name in ("MeshLightAPI", "VolumeLightAPI")
            },
            "model:drawMode": 'def Xform "other" {\n uniform token model:drawMode = "cards"\n}',
        },
    },
    "obj": {"obj": {name: f"{name} 1" for one in feature_table("obj") for name in one.names}},
    "mtl": {
        "mtl": {
            **_lines("bump, map_bump, norm, disp, decal, refl, map_refl, map_ks, map_ns, map_ke, "
                     "map_pr, map_pm, map_ps, map_rma, map_orm", "a.png"),
            **_lines("ks, ke, pr, pm, ps, pc, pcr, aniso, anisor, tf"),
            **{f"map_kd{name}": f"map_Kd {name} {value} a.png" for name, value in
               {"-clamp": "on", "-mm": "0 2", "-t": "1 1 1", "-imfchan": "r"}.items()},
            **{f"map_d{name}": f"map_d {name} 2 2 a.png" for name in ("-s", "-o")},
        }
    },
    "dae": {
        "phong": {
            **_tags("emission, specular, reflective", "<color>1 0 0 1</color>"),
            "bump": "<extra><technique profile='x'><bump/></technique></extra>",
            "transparency": "<transparency><float>0.5</float></transparency>",
        },
        "mesh": {name: f'<{name} count="0"/>' for name in
                 ("tristrips", "trifans", "lines", "linestrips")},
        "geometry": {name: f'<geometry id="x"><{name}/></geometry>' for name in
                     ("spline", "convex_mesh", "brep")},
        "node": {
            "skew": "<skew>45 0 1 0 1 0 0</skew>", "lookat": "<lookat>1 0 0 0 0 0 0 0 1</lookat>",
            **{name: f'<{name} url="#x"/>' for name in
               ("instance_controller", "instance_light", "instance_camera")},
        },
        "top": {"animation": '<library_animations><animation id="a"/></library_animations>'},
    },
}  # fmt: skip
TEXTS = {"sdf": SDF, "urdf": ROBOT, "mjcf": MUJOCO, "usd": STAGE, "obj": OBJ, "mtl": MTL,
         "dae": COLLADA}  # fmt: skip
SUFFIXES = {"sdf": ".world", "urdf": ".urdf", "mjcf": ".xml", "usd": ".usda", "obj": ".obj",
            "mtl": ".obj", "dae": ".dae"}  # fmt: skip
NEEDS = {"mjcf": "mujoco", "usd": "pxr", "dae": "collada"}
CASES = [
    pytest.param(
        table,
        name,
        marks=pytest.mark.skipif(
            table in NEEDS and not is_installed(NEEDS[table]), reason="needs an extra"
        ),
    )
    for table in TEXTS
    for name in [one.name for one in feature_table(table) if one.support is Support.LEFT_OUT]
]


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


@pytest.mark.parametrize(("table", "names"), CASES)
def test_parts_that_are_left_out_are_noted(table, names, tmp_path):
    (feature,) = [one for one in feature_table(table) if one.name == names]
    for name in names.split(", ")[:: 1 if table in ("sdf", "urdf", "obj", "mtl") else 3]:
        if name == "visible tendons":  # as sites; its model is long
            continue
        ((slot, text),) = [(slot, uses[name]) for slot, uses in USES[table].items() if name in uses]
        try:
            notices = _load(tmp_path, table, **{slot: text}).notices
        except SceneError as reason:  # a reader that then has nothing left says why
            notices = (str(reason),)
        assert any(feature.effect in notice for notice in notices), (name, notices)


@pytest.mark.parametrize("table", [table for table in TEXTS if table not in NEEDS])
def test_files_without_such_parts_are_quiet(table, tmp_path):
    assert _load(tmp_path, table).notices == ()


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
    assert any("not read: halo, Halo" in one for one in _load(tmp_path, "usd", stage=stage).notices)


def _ply(folder, vertex="", face="", more="", v="", f="", m=""):
    path = folder / "a.ply"
    text = PLY.format(vertex=vertex, face=face, more=more, v=v, f=f, m=m).replace("\n\n", "\n")
    path.write_text(text)
    return load_scene(path).notices


def test_parts_of_ply(tmp_path):
    assert _ply(tmp_path) == ()
    notices = _ply(tmp_path, vertex="property float halo\nproperty uchar diffuse_red\n", v=" 1 2")
    assert [one[7:] for one in notices] == [
        "colors under other names than red, green and blue are not drawn (1 property)",
        "not read: vertex.halo",
    ]
    notices = _ply(tmp_path, face="property int texnumber\n", f=" 1")
    assert [one[7:] for one in notices] == ["textures beyond the first are not drawn (1 property)"]


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


@pytest.mark.parametrize(
    "table", [*TABLES[1:], *ROBOT_TABLES]
)  # in glTF's, values have commas, too
def test_names_of_a_table_are_distinct(table):
    names = [name for one in feature_table(table) for name in one.names]
    assert len(names) == len(set(names))


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
        ("sdf", "cup/cup.sdf"),
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
