"""SECURITY.md: what a scene of a stranger may name, and what becomes of it."""

import socket

import numpy as np
import pytest

from omnisim.core.files.image_files import write_image
from omnisim.scene import load_scene
from tests.scene.gltf_builder import GltfBuilder


@pytest.fixture(autouse=True)
def no_net(monkeypatch):
    """Any use of the net fails the test."""

    def refuse(*_, **__):
        raise AssertionError("the net is used")

    monkeypatch.setattr(socket, "socket", refuse)
    monkeypatch.setattr(socket, "create_connection", refuse)
    monkeypatch.setattr(socket, "getaddrinfo", refuse)


def _gltf(folder, uri):
    """Write a triangle whose texture has an address; returns the file."""
    folder.mkdir(exist_ok=True)
    gltf = GltfBuilder()
    uv = gltf.accessor(np.zeros((3, 2), "<f4"), "VEC2")
    gltf.tree |= {"images": [{"uri": uri}], "textures": [{"source": 0}]}
    values = {"metallicFactor": 0, "baseColorTexture": {"index": 0}}
    gltf.tree["materials"] = [{"pbrMetallicRoughness": values}]
    gltf.node(mesh=gltf.triangle(material=0, TEXCOORD_0=uv))
    return gltf.write(folder / "a.gltf")


def test_a_path_may_lead_out_of_the_folder(tmp_path):
    write_image(tmp_path / "a.png", np.full((4, 4, 3), 200, dtype=np.uint8))
    scene = load_scene(_gltf(tmp_path / "scene", "../a.png"))
    assert scene.materials[0].texture is not None
    assert scene.notices == ()


@pytest.mark.parametrize(
    "uri", ["http://example.org/a.png", "https://example.org/a.png", "ftp://a/b", "//host/a.png"]
)
def test_nothing_is_fetched_from_the_net(tmp_path, uri):
    scene = load_scene(_gltf(tmp_path, uri))
    assert scene.materials[0].texture is None
    assert len(scene.notices) == 1


@pytest.mark.parametrize("name", ["/etc/passwd", "../../../../../../etc/passwd"])
def test_a_file_that_is_no_image_shows_nothing_of_itself(tmp_path, name):
    scene = load_scene(_gltf(tmp_path / "scene", name))
    assert scene.materials[0].texture is None
    assert "root:" not in " ".join(scene.notices)


def test_a_material_file_may_lie_outside(tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl red\nKd 1 0 0\n")
    (tmp_path / "scene").mkdir()
    (tmp_path / "scene" / "a.obj").write_text(
        "mtllib ../a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n"
    )
    (material,) = load_scene(tmp_path / "scene" / "a.obj").materials
    assert material.base_color[0] > 0.9 > 0.1 > material.base_color[1]
