"""Files beside a scene that cannot be read: noted as missing ones are, or refused."""

import base64
import json
import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from omnisim.core.errors import SceneError
from omnisim.scene import load_scene, read_scene
from tests.scene.gltf_builder import GltfBuilder, png

OBJ = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"
IMAGE = png(np.full((2, 2, 3), 9))


def _obj(folder, mtl):
    (folder / "a.mtl").write_text(mtl)
    (folder / "a.obj").write_text(OBJ)
    return folder / "a.obj"


def _obj_with_texture(folder):
    return _obj(folder, "newmtl m\nKd 0.8 0.4 0.2\nmap_Kd asset\n"), IMAGE


def _obj_with_hole_map(folder):
    return _obj(folder, "newmtl m\nKd 0.8 0.4 0.2\nmap_d asset\n"), IMAGE


def _obj_with_material_file(folder):
    path = folder / "a.obj"
    path.write_text(OBJ.replace("a.mtl", "asset"))
    return path, b"newmtl m\nKd 0.8 0.4 0.2\n"


def _collada(folder):
    """COLLADA whose effect has an image for a diffuse color; trimesh writes colors only."""
    box = trimesh.creation.box()
    material = trimesh.visual.material.SimpleMaterial(image=Image.new("RGB", (2, 2)))
    box.visual = trimesh.visual.TextureVisuals(np.zeros((len(box.vertices), 2)), material)
    text = box.export(file_type="dae").decode()
    surface = (
        '<newparam sid="s"><surface type="2D"><init_from>i</init_from></surface></newparam>'
        '<newparam sid="t"><sampler2D><source>s</source></sampler2D></newparam>'
    )
    images = '<library_images><image id="i"><init_from>asset</init_from></image></library_images>'
    color = '<diffuse><texture texture="t" texcoord="u"/></diffuse>'
    text = text.replace("<profile_COMMON>", f"<profile_COMMON>{surface}")
    text = re.sub(r"(?s)<diffuse>.*?</diffuse>", color, text)
    path = folder / "a.dae"
    path.write_text(text.replace("<library_effects>", f"{images}<library_effects>"))
    return path, IMAGE


def _gltf(folder):
    gltf = GltfBuilder()
    gltf.tree["images"] = [{"uri": "asset"}]
    gltf.tree["textures"] = [{"source": 0}]
    color = {"baseColorTexture": {"index": 0}, "metallicFactor": 0.0}
    gltf.tree["materials"] = [{"pbrMetallicRoughness": color}]
    uv = gltf.accessor(np.zeros((3, 2), "<f4"), "VEC2")
    gltf.node(mesh=gltf.triangle(material=0, TEXCOORD_0=uv))
    return gltf.write(folder / "a.gltf"), IMAGE


FORMATS = (_obj_with_texture, _obj_with_hole_map, _obj_with_material_file, _collada, _gltf)


def _missing(path, content, monkeypatch):
    return "is missing"


def _folder(path, content, monkeypatch):
    path.mkdir()
    return "is missing"


def _holding(content, reason):
    """Fault of an asset with other content."""

    def write(path, _, monkeypatch):
        path.write_bytes(content)
        return reason

    return write


def _forbidden(path, content, monkeypatch):
    """As root may read all files, a stand-in for the system's refusal."""
    path.write_bytes(content)
    read = Path.read_bytes

    def read_bytes(self):
        if self == path:
            raise PermissionError(13, "Permission denied", str(self))
        return read(self)

    monkeypatch.setattr(Path, "read_bytes", read_bytes)
    return "cannot be read: Permission denied"


_empty = _holding(b"", "is an empty file")
_damaged = _holding(
    b"\x89PNG\r\n\x1a\n not really", "is not an image that can be read|has no materials"
)
_ktx = _holding(
    b"\xabKTX 20\xbb\r\n\x1a\n" + bytes(64),
    "is a KTX 2 image, which is not supported|has no materials",
)
# an image, and all that reads it, has each fault; the others go through the same resolver
FAULTS = (_missing, _folder, _empty, _damaged, _ktx, _forbidden)
CASES = [(make, fault) for make in (_obj_with_texture, _gltf) for fault in FAULTS]
CASES += [(make, fault) for make in (_obj_with_hole_map, _obj_with_material_file, _collada)
          for fault in (_missing, _damaged)]  # fmt: skip
NAMES = ("missing", "folder", "empty", "damaged", "ktx", "forbidden")


@pytest.mark.parametrize("make", FORMATS, ids=lambda make: make.__name__)
def test_readable_assets_need_no_notice(make, tmp_path):
    path, content = make(tmp_path)
    (tmp_path / "asset").write_bytes(content)
    assert load_scene(path).notices == ()


@pytest.mark.parametrize(
    ("make", "fault"), CASES, ids=[f"{m.__name__}-{NAMES[FAULTS.index(f)]}" for m, f in CASES]
)
def test_assets_that_cannot_be_read_are_noticed(make, fault, tmp_path, monkeypatch):
    path, content = make(tmp_path)
    reason = fault(tmp_path / "asset", content, monkeypatch)
    scene = load_scene(path)
    assert scene.triangle_count > 0
    assert scene.materials[0].texture is None
    (notice,) = scene.notices
    assert re.fullmatch(rf"{path.name}: asset ({reason}): drawn without it", notice)


@pytest.mark.parametrize("fault", [_missing, _empty, _damaged])
def test_buffers_that_cannot_be_read_are_refused(fault, tmp_path, monkeypatch):
    gltf = GltfBuilder()
    gltf.node(mesh=gltf.triangle())
    path = gltf.write(tmp_path / "a.gltf")
    gltf.tree["buffers"][0]["uri"] = "asset"
    path.write_text(json.dumps(gltf.tree))
    reason = fault(tmp_path / "asset", gltf.blob, monkeypatch)
    words = rf"buffers\[0\].uri: asset {reason}$"
    if fault is _damaged:  # which shows by its length alone
        words = "expected 36 bytes in its buffer"
    with pytest.raises(SceneError, match=words):
        load_scene(path)


def test_materials_that_no_file_has_are_noticed(tmp_path):
    path = _obj(tmp_path, "newmtl m\nKd 1 0 0\n")
    assert load_scene(path).notices == ()
    path.write_text(OBJ + "usemtl None\nf 3/3 2/2 1/1\nusemtl gone\nf 3/3 2/2 1/1\n")
    assert load_scene(path).notices == ("a.obj: no material file has 'gone': drawn in plain gray",)


@pytest.mark.parametrize("make", [_obj_with_texture, _gltf], ids=lambda make: make.__name__)
def test_textures_without_coordinates_are_noticed(make, tmp_path):
    path, content = make(tmp_path)
    (tmp_path / "asset").write_bytes(content)
    text = path.read_text().replace("TEXCOORD_0", "_TEXCOORD_0")
    path.write_text(re.sub(r"(\d)/\d", r"\1", text).replace("vt ", "# vt "))
    scene = load_scene(path)
    assert scene.materials[0].texture is not None
    (notice,) = scene.notices
    assert notice.endswith("is not drawn on 1 mesh without texture coordinates")


def test_a_name_of_two_lines_is_told_in_one(tmp_path):
    path, _ = _gltf(tmp_path)
    tree = json.loads(path.read_text())
    tree["buffers"][0]["uri"] = "a\nb"
    path.write_text(json.dumps(tree))
    with pytest.raises(SceneError, match=r"buffers\[0\].uri: a\\nb is missing") as caught:
        load_scene(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("extension", [None, "KHR_texture_basisu"])
def test_ktx_2_inside_a_gltf_file_is_said_to_be_unsupported(extension, tmp_path):
    path, _ = _gltf(tmp_path)
    tree = json.loads(path.read_text())
    data = base64.b64encode(b"\xabKTX 20\xbb\r\n\x1a\n").decode()
    tree["images"] = [{"uri": f"data:image/ktx2;base64,{data}", "mimeType": "image/ktx2"}]
    if extension:
        tree["textures"] = [{"extensions": {extension: {"source": 0}}}]
    path.write_text(json.dumps(tree))
    notice = (
        "a.gltf: texture of 'material 0' is a KTX 2 image, which is not supported: "
        "its plain color is drawn"
    )
    assert read_scene(path).notices == (notice,)
