"""Identity of scenes: by the bytes of their files, keys and options, wherever they are."""

import dataclasses
import json
import shutil

import numpy as np
import pytest
import trimesh
from PIL import Image

from omnisim.core.files.sources import SourceReader, fingerprint
from omnisim.scene import read_scene
from omnisim.scene.model import Scene
from tests.scene.gltf_builder import GltfBuilder
from tests.scenes import room, scene_of

QUAD = "mtllib a.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 1 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\n"


def _image(path, level):
    path.parent.mkdir(exist_ok=True)
    Image.fromarray(np.full((4, 4, 3), level, np.uint8)).save(path)


def _obj(folder):
    (folder / "a.obj").write_text(QUAD)
    (folder / "a.mtl").write_text("newmtl a\nKd 1 1 1\nmap_Kd maps/a.png\n")
    _image(folder / "maps" / "a.png", 100)
    return folder / "a.obj"


def _gltf(folder):
    gltf = GltfBuilder()
    _image(folder / "a.png", 90)
    gltf.tree |= {"images": [{"uri": "a.png"}], "textures": [{"source": 0}]}
    gltf.tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    uv = gltf.accessor(np.zeros((3, 2), "<f4"), "VEC2")
    gltf.node(mesh=gltf.triangle(material=0, TEXCOORD_0=uv))
    gltf.tree["buffers"] = [{"byteLength": len(gltf.blob), "uri": "a.bin"}]
    (folder / "a.bin").write_bytes(gltf.blob)
    (folder / "a.gltf").write_text(json.dumps(gltf.tree))
    return folder / "a.gltf"


def _sdf(folder):
    (folder / "meshes").mkdir()
    trimesh.creation.box().export(folder / "meshes" / "box.stl")
    (folder / "a.sdf").write_text(
        '<sdf version="1.7"><model name="m"><link name="l"><visual name="v"><geometry><mesh>'
        "<uri>meshes/box.stl</uri></mesh></geometry></visual></link></model></sdf>"
    )
    return folder / "a.sdf"


def _urdf(folder):
    trimesh.creation.box().export(folder / "box.stl")
    (folder / "a.urdf").write_text(
        '<robot name="r"><link name="l"><visual><geometry><mesh filename="box.stl"/></geometry>'
        "</visual></link></robot>"
    )
    return folder / "a.urdf"


def _mjcf(folder):
    pytest.importorskip("mujoco")
    (folder / "assets").mkdir()
    trimesh.creation.box().export(folder / "assets" / "box.stl")
    (folder / "part.xml").write_text(
        '<mujoco><asset><mesh name="b" file="box.stl"/></asset></mujoco>'
    )
    (folder / "a.xml").write_text(
        '<mujoco><compiler meshdir="assets"/><include file="part.xml"/><worldbody>'
        '<geom type="mesh" mesh="b"/></worldbody></mujoco>'
    )
    return folder / "a.xml"


def _usd(folder):
    pytest.importorskip("pxr")
    (folder / "part.usda").write_text(
        '#usda 1.0\ndef Mesh "m" {\nint[] faceVertexCounts = [3]\n'
        "int[] faceVertexIndices = [0, 1, 2]\n"
        "point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n}\n"
    )
    (folder / "a.usda").write_text(
        '#usda 1.0\n( upAxis = "Z" )\ndef Xform "w" ( references = @part.usda@</m> ) {}\n'
        'def Sphere "s" {}\n'
    )
    return folder / "a.usda"


FORMATS = {"obj": _obj, "gltf": _gltf, "sdf": _sdf, "urdf": _urdf, "mjcf": _mjcf, "usd": _usd}


@pytest.mark.parametrize("make", FORMATS.values(), ids=FORMATS)
def test_every_file_of_a_scene_counts_and_its_place_does_not(make, tmp_path, monkeypatch):
    # a process of its own is slow, and not what is tested
    monkeypatch.setattr(
        "omnisim.scene.formats.usd.reader.call_isolated", lambda f, *given: f(*given)
    )
    here = tmp_path / "here"
    here.mkdir()
    path = make(here)
    reader, own = SourceReader(), SourceReader()
    given = read_scene(path, reader=reader).identity
    for file in here.rglob("*.*"):
        own.note(file)
    assert reader.digest(here) == own.digest(here)
    shutil.copytree(here, tmp_path / "there")
    assert read_scene(tmp_path / "there" / path.name).identity == given
    for file in sorted(one for one in here.rglob("*") if one.is_file()):
        before = file.read_bytes()
        if file.suffix == ".png":
            _image(file, 10)
        else:  # what readers take no notice of
            header_changed = b"other" + before[5:]
            padding = {".bin": b"\0\0\0\0"}.get(file.suffix, b"\n")
            file.write_bytes(header_changed if file.suffix == ".stl" else before + padding)
        changed = read_scene(path).identity
        assert changed.content != given.content, file.name
        assert changed.light != given.light, file.name
        file.write_bytes(before)
    assert read_scene(path).identity == given


@pytest.fixture
def toml(tmp_path):
    _obj(tmp_path)

    def write(text=""):
        path = tmp_path / "scene.toml"
        path.write_text(f'file = "a.obj"\n{text}')
        return read_scene(path)

    return write


@pytest.mark.parametrize(
    "text",
    [
        "[start]\nposition_m = [0.0, 0.0, 1.0]",
        '[[labels]]\nname = "wall"\nnodes = ["a"]',
        '[[paths]]\nname = "p"\nwaypoints_m = [[0.0, 0.0], [1.0, 0.0]]',
        "[fog]\nvisibility_m = 20.0\ncolor = [0.5, 0.5, 0.5]",
    ],
)
def test_light_is_not_of_what_does_not_shine(toml, text):
    plain, other = toml().identity, toml(text).identity
    assert other.light == plain.light
    assert other.content != plain.content


@pytest.mark.parametrize(
    "text",
    [
        '[[lamps]]\nkind = "point"\nposition_m = [0.0, 0.0, 2.0]\nintensity = 5.0',
        "[sky]",
        "[light]\nambient = [0.1, 0.1, 0.1]",
        '[light]\nshading = "matte"',
        "meters_per_unit = 2.0",
        "background = [3.0, 3.0, 3.0]",
    ],
)
def test_light_is_of_what_shines(toml, text):
    plain = toml("# a comment\n\n").identity
    assert plain == toml().identity
    assert toml(text).identity.light != plain.light


def test_edits_make_another_scene_which_follows_from_them(toml):
    scene = toml()
    name = scene.instance_names[0]
    moved = [scene.moved(name, np.eye(4)), scene.moved(name, np.eye(4))]
    assert moved[0].identity == moved[1].identity != scene.identity
    assert scene.recolored(name, (1.0, 0.0, 0.0)).identity != scene.identity
    part = Scene.from_arrays("part", [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    added = scene.added("part", part)
    assert added.identity != scene.identity
    assert added.removed("part").identity not in (added.identity, scene.identity)


def test_a_changed_copy_is_known_by_its_content_again(toml):
    scene = toml()
    copy = dataclasses.replace(scene, background=(0.3, 0.2, 0.1))
    assert copy.identity.content == fingerprint(copy) != fingerprint(scene)
    assert copy.identity.light != scene.identity.light


def test_earlier_versions_identify_a_scene_in_the_same_way(tmp_path):
    """Runs, data sets and bakes store these digests: with others they would begin anew."""
    (tmp_path / "a.obj").write_text(QUAD)
    (tmp_path / "a.mtl").write_text("newmtl a\nKd 1 1 1\n")
    (tmp_path / "scene.toml").write_text(
        'file = "a.obj"\n[start]\nposition_m = [0.0, 0.0, 1.0]\n[sky]\nturbidity = 4.0\n'
        '[[materials]]\nnames = ["a"]\nbase_color = [0.5, 0.0, 0.0]\n'
    )
    scene = read_scene(tmp_path / "scene.toml")
    assert dataclasses.astuple(scene.identity) == (
        "050c8b1f99210a7bd8360264e83ffe2cf7dffebf589bf6de977a09791cc2e861",
        "acee9e49a64da4d93ade69c1d56fb0b0f486db593e7a9b90443355c902cc640d",
    )
    assert fingerprint(scene) == "a05a08b8e39b1aa4"
    edited = scene.moved(scene.instance_names[0], np.eye(4)).at_start()
    assert fingerprint(edited) == "7a3c21ca757a4c72"


def test_arrays_are_read_for_an_identity_only_when_it_is_asked_for(monkeypatch):
    def refuse(*_):
        raise AssertionError("hashed")

    for module in ("model", "identity"):
        monkeypatch.setattr(f"omnisim.scene.{module}.fingerprint", refuse)
    scene = scene_of([room()])
    name = scene.instance_names[0]
    edited = scene.added("part", scene).moved(name, np.eye(4)).removed("part").at_start()
    with pytest.raises(AssertionError, match="hashed"):
        _ = edited.identity


@pytest.fixture
def sheet():
    return Scene.from_arrays("sheet", np.eye(3), [[0, 1, 2]], base_color=(0.5, 0.4, 0.3))


def _with_mesh(scene, **changes):
    return dataclasses.replace(scene, meshes=(dataclasses.replace(scene.meshes[0], **changes),))


def test_names_fog_and_starts_count_for_no_light(sheet):
    (instance,) = sheet.instances
    other = dataclasses.replace(
        _with_mesh(sheet, name="other", positions=sheet.meshes[0].positions.copy()),
        name="other",
        instances=(dataclasses.replace(instance, name="other"),),
        background=(0.0, 0.0, 0.0),
    )
    assert other.identity.light == sheet.identity.light
    assert len(sheet.identity.light) == 64


def _with_light(**changes):
    return lambda scene: dataclasses.replace(
        scene, lighting=dataclasses.replace(scene.lighting, **changes)
    )


@pytest.mark.parametrize(
    "change",
    [
        lambda scene: _with_mesh(scene, positions=scene.meshes[0].positions + np.float32(1e-3)),
        lambda scene: scene.moved("sheet", np.eye(4) + np.diag((0.0, 0.0, 1.0), k=1)),
        lambda scene: scene.recolored("sheet", (0.1, 0.1, 0.1)),
        _with_light(exposure=2.0),
        _with_light(ambient=(0.0, 0.0, 0.1)),
        _with_light(lights=()),
        _with_light(is_matte=True),
    ],
)
def test_what_light_depends_on_changes_it(sheet, change):
    assert change(sheet).identity.light != sheet.identity.light
