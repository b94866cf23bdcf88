"""Buffer views that are compressed with meshopt, by the decoder of another and a stand-in."""

import numpy as np
import pytest

from omnisim.core.errors import SceneError
from omnisim.scene import load_scene
from omnisim.scene.formats.gltf import document
from tests.scene.compressed_gltf import CORNERS, compress, compressed_tetrahedron


def _write(gltf, path):
    gltf.write(path)
    text = path.read_text()
    extra = ', {"byteLength": 999, "extensions": {"EXT_meshopt_compression": {"fallback": true}}}]'
    start = text.index('"buffers": [')
    end = text.index("]", start)
    path.write_text(text[:end] + extra + text[end + 1 :])
    return path


def _load(folder, gltf):
    return load_scene(_write(gltf, folder / "a.gltf"), up_axis="z")


@pytest.mark.parametrize("mode", ["TRIANGLES", "INDICES"])
def test_meshopt_s_own_decoder(mode, tmp_path):
    pytest.importorskip("meshoptimizer")
    (mesh,) = _load(tmp_path, compressed_tetrahedron(plain=False, faces=mode)).meshes
    np.testing.assert_allclose(mesh.positions, CORNERS - 0.5)
    # a triangle may begin at another of its corners
    faces = [tuple(np.roll(face, -np.argmin(face))) for face in mesh.triangles.tolist()]
    assert sorted(faces) == [(0, 1, 2), (0, 2, 3)]


def test_filtered_normals(tmp_path):
    meshoptimizer = pytest.importorskip("meshoptimizer", reason="it is not installed")
    gltf = compressed_tetrahedron()
    # octahedral coordinates of 8 bits: z, x, −z, and x again
    stored = np.array([[0, 0, 127, 0], [127, 0, 127, 0], [127, 127, 127, 0], [127, 0, 127, 0]])
    data = meshoptimizer.encode_vertex_buffer(stored.astype("i1").view("<u4"))
    plain = gltf.accessor(np.zeros((4, 4), "u1"), "VEC3", normalized=True)
    gltf.tree["accessors"][plain]["componentType"] = 5120
    gltf.tree["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = plain
    view = compress(gltf, plain, "ATTRIBUTES", data, filter="OCTAHEDRAL")
    view["byteStride"] = 4
    (mesh,) = _load(tmp_path, gltf).meshes
    expected = [[0, 0, 1], [1, 0, 0], [0, 0, -1], [1, 0, 0]]
    np.testing.assert_allclose(mesh.normals, expected, atol=0.01)


def test_without_the_decoder_plain_data_are_read_or_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(document, "can_decode_meshopt", lambda: False)
    (mesh,) = _load(tmp_path, compressed_tetrahedron()).meshes
    np.testing.assert_allclose(mesh.positions, CORNERS - 0.5)
    with pytest.raises(SceneError, match=r"compressed with meshopt, which needs pip .*\[meshopt\]"):
        _load(tmp_path, compressed_tetrahedron(plain=False))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"byteStride": 6}, r"byteStride: expected a multiple of 4 up to 256, got 6"),
        ({"mode": "POINTS"}, r"mode: expected one of ATTRIBUTES, TRIANGLES, INDICES, got 'POINTS'"),
        ({"filter": "COLOR"}, r"filter: expected one of NONE, OCTAHEDRAL, .*, got 'COLOR'"),
        ({"filter": "QUATERNION"}, r"byteStride: expected 8, got 12"),
        ({"count": 10**9}, r"count: expected a count that \d+ compressed bytes can hold"),
        ({"byteLength": 10**6}, r"expected \d+ bytes in its buffer"),
    ],
)
def test_a_damaged_view_is_one_line(values, message, tmp_path, monkeypatch):
    monkeypatch.setattr(document, "can_decode_meshopt", lambda: True)
    with pytest.raises(SceneError, match=message) as error:
        _load(tmp_path, compressed_tetrahedron(**values))
    assert "\n" not in str(error.value)
