"""glTF files with compressed arrays, from stored bytes."""

import base64

import numpy as np

from tests.scene.gltf_builder import GltfBuilder

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "<f4")
TRIANGLES = np.array([0, 1, 2, 0, 2, 3], "<u2")
# Of DracoPy 2.2: a triangle with colors of 16 bits, which its decoder gives in 32.
DRACO_COLORS = (
    "RFJBQ08CAgEAAAABAwEAAQIBAgQEBAABAAkDAAIBAgABAQARA60qN1UVA69agQEA//8AAAEAAAAAAAD//wAAAAEBAA"
    "MDrSpVFQOgeoGIAQAAAAD/PwAAAAAAAAAAAAAAAAAAAACAPw4="
)
# Of meshoptimizer 0.2.30: corners, triangles, and the same indices as a sequence.
SAMPLES = {
    "ATTRIBUTES": (
        "oAAAATwAAAD//wE8AAAAfn0AAAEPAAAA//8BDwAAAH59AAABAwAAAP8BAwAAAH4AAAAAAAAAAAAAAAAAAAAAAAAAAAAA"
        "AAAAAAAAAAAAAA=="
    ),
    "TRIANGLES": "4fAAAHaHVmd4qYZliWiYAWkAAA==",
    "INDICES": "0QAEBAYIBAAAAAA=",
}


def compress(gltf, accessor, kind, data, **values):
    """Put compressed data beside the plain data of an accessor."""
    view = gltf.tree["bufferViews"][gltf.tree["accessors"][accessor]["bufferView"]]
    stride = view["byteLength"] // gltf.tree["accessors"][accessor]["count"]
    entry = {
        "buffer": 0, "byteOffset": len(gltf.blob), "byteLength": len(data), "mode": kind,
        "byteStride": stride, "count": gltf.tree["accessors"][accessor]["count"], **values,
    }  # fmt: skip
    view["extensions"] = {"EXT_meshopt_compression": entry}
    gltf.blob += data
    return view


def compressed_tetrahedron(plain=True, faces="TRIANGLES", **values):
    """Faces whose corners and indices are compressed; without plain data: in an empty buffer."""
    gltf = GltfBuilder()
    mesh = gltf.triangle(positions=CORNERS)
    primitive = gltf.tree["meshes"][mesh]["primitives"][0]
    primitive["indices"] = gltf.accessor(TRIANGLES, "SCALAR")
    corners = base64.b64decode(SAMPLES["ATTRIBUTES"])
    views = [
        compress(gltf, primitive["attributes"]["POSITION"], "ATTRIBUTES", corners, **values),
        compress(gltf, primitive["indices"], faces, base64.b64decode(SAMPLES[faces])),
    ]
    for view in () if plain else views:
        view |= {"buffer": 1, "byteOffset": 0}
    gltf.node(mesh=mesh)
    return gltf


def draco_triangle(gltf, data, **ids):
    """Compress the only mesh of a builder: attributes by their ids in Draco's `data`."""
    primitive = gltf.tree["meshes"][0]["primitives"][0]
    primitive["indices"] = gltf.accessor(np.arange(3, dtype="u1"), "SCALAR")
    for accessor in gltf.tree["accessors"]:
        del accessor["bufferView"]
    gltf.tree["bufferViews"] = [{"buffer": 0, "byteLength": len(data), "byteOffset": 2}]
    gltf.blob = b".." + data
    gltf.tree["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    primitive["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": ids}}
    gltf.node(mesh=0)


def colored_draco_triangle():
    """Triangle of DRACO_COLORS."""
    gltf, colors = GltfBuilder(), np.array([[65535, 32768, 0, 65535]] * 3, "<u2")
    gltf.triangle(COLOR_0=gltf.accessor(colors, "VEC4", normalized=True))
    draco_triangle(gltf, base64.b64decode(DRACO_COLORS), COLOR_0=1, POSITION=2)
    return gltf
