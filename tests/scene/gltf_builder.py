"""glTF files from plain numbers."""

import base64
import io
import json
import struct

import numpy as np
from PIL import Image


def png(pixels):
    data = io.BytesIO()
    Image.fromarray(np.asarray(pixels, dtype=np.uint8)).save(data, "PNG")
    return data.getvalue()


def glb(tree, blob):
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    size = 28 + len(text) + len(blob)
    head = struct.pack("<5I", 0x46546C67, 2, size, len(text), 0x4E4F534A)
    return head + text + struct.pack("<2I", len(blob), 0x4E4942) + blob


class GltfBuilder:
    """A glTF file with everything inside, from plain numbers."""

    def __init__(self):
        self.blob = b""
        self.tree = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
            "meshes": [],
            "accessors": [],
            "bufferViews": [],
        }

    def accessor(self, values, kind, normalized=False):
        values = np.ascontiguousarray(values)
        component = {"f4": 5126, "u4": 5125, "u2": 5123, "u1": 5121, "i2": 5122}
        self.blob += b"\0" * (-len(self.blob) % 4)
        view = {"buffer": 0, "byteOffset": len(self.blob), "byteLength": values.nbytes}
        self.blob += values.tobytes()
        self.tree["bufferViews"].append(view)
        entry = {
            "bufferView": len(self.tree["bufferViews"]) - 1,
            "componentType": component[values.dtype.str[1:]],
            "count": len(values),
            "type": kind,
        }
        if normalized:
            entry["normalized"] = True
        self.tree["accessors"].append(entry)
        return len(self.tree["accessors"]) - 1

    def triangle(self, material=None, positions=None, **attributes):
        positions = [[0, 0, 0], [1, 0, 0], [0, 1, 0]] if positions is None else positions
        attributes["POSITION"] = self.accessor(np.asarray(positions, "<f4"), "VEC3")
        primitive = {"attributes": attributes}
        if material is not None:
            primitive["material"] = material
        self.tree["meshes"].append({"primitives": [primitive]})
        return len(self.tree["meshes"]) - 1

    def node(self, **node):
        self.tree["nodes"].append(node)
        self.tree["scenes"][0]["nodes"].append(len(self.tree["nodes"]) - 1)

    def texture(self, pixels, **sampler):
        uri = "data:image/png;base64," + base64.b64encode(png(pixels)).decode()
        self.tree.setdefault("images", []).append({"uri": uri})
        texture = {"source": len(self.tree["images"]) - 1}
        if sampler:
            self.tree.setdefault("samplers", []).append(sampler)
            texture["sampler"] = len(self.tree["samplers"]) - 1
        self.tree.setdefault("textures", []).append(texture)
        return len(self.tree["textures"]) - 1

    def write(self, path):
        if path.suffix == ".glb":
            self.tree["buffers"] = [{"byteLength": len(self.blob)}]
            path.write_bytes(glb(self.tree, self.blob))
            return path
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.blob).decode()
        self.tree["buffers"] = [{"byteLength": len(self.blob), "uri": uri}]
        path.write_text(json.dumps(self.tree))
        return path


def skinned_and_textured():
    """JSON and buffer of a file with most of what glTF has."""
    gltf = GltfBuilder()
    texture = gltf.texture(np.full((2, 2, 3), 9), wrapS=33648)
    gltf.tree["materials"] = [
        {"pbrMetallicRoughness": {"baseColorTexture": {"index": texture, "texCoord": 0}}}
    ]
    mesh = gltf.triangle(
        material=0,
        JOINTS_0=gltf.accessor(np.zeros((3, 4), "u1"), "VEC4"),
        WEIGHTS_0=gltf.accessor(np.ones((3, 4), "<f4"), "VEC4"),
        TEXCOORD_0=gltf.accessor(np.zeros((3, 2), "<u2"), "VEC2", normalized=True),
        COLOR_0=gltf.accessor(np.ones((3, 4), "<f4"), "VEC4"),
    )
    primitive = gltf.tree["meshes"][mesh]["primitives"][0]
    primitive["indices"] = gltf.accessor(np.arange(3, dtype="<u2"), "SCALAR")
    indices = gltf.tree["accessors"][primitive["indices"]]["bufferView"]
    position = gltf.tree["accessors"][primitive["attributes"]["POSITION"]]
    position["sparse"] = {
        "count": 1,
        "indices": {"bufferView": indices, "componentType": 5123},
        "values": {"bufferView": position["bufferView"]},
    }
    binds = gltf.accessor(np.eye(4, dtype="<f4").reshape(1, 16), "MAT4")
    gltf.tree["skins"] = [{"joints": [1], "inverseBindMatrices": binds}]
    gltf.tree["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "spot", "range": 5.0}]}}
    gltf.node(mesh=mesh, skin=0)
    gltf.node(rotation=[0.0, 0.6, 0.0, 0.8], scale=[1.0, 2.0, -1.0], translation=[1.0, 2.0, 3.0])
    gltf.node(mesh=mesh, extensions={"KHR_lights_punctual": {"light": 0}})
    gltf.tree["cameras"] = [{"name": "eye", "type": "perspective", "perspective": {"yfov": 1.0}}]
    gltf.node(camera=0, rotation=[0.0, 0.6, 0.0, 0.8])
    times = gltf.accessor(np.array([0.0, 1.0], "<f4"), "SCALAR")
    turns = gltf.accessor(np.repeat(np.eye(4, dtype="<f4")[1:3], 3, axis=0), "VEC4")
    offsets = gltf.accessor(np.eye(3, dtype="<f4"), "VEC3")
    primitive["targets"] = [{"POSITION": offsets, "NORMAL": offsets}, {"POSITION": offsets}]
    gltf.tree["meshes"][mesh]["weights"] = [0.5, 0.0]
    weights = gltf.accessor(np.array([0, 1, 2, 0], "<f4"), "SCALAR")
    scales = gltf.accessor(np.array([[1, 1, 1], [2, 1, 1]], "<f4"), "VEC3")
    targets = [(2, "rotation"), (0, "weights"), (1, "scale")]
    gltf.tree["animations"] = [
        {
            "channels": [
                {"sampler": number, "target": {"node": node, "path": path}}
                for number, (node, path) in enumerate(targets)
            ],
            "samplers": [
                {"input": times, "output": turns, "interpolation": "CUBICSPLINE"},
                {"input": times, "output": weights},
                {"input": times, "output": scales, "interpolation": "STEP"},
            ],
        }
    ]
    gltf.tree["buffers"] = [{"byteLength": len(gltf.blob)}]
    return gltf.tree, gltf.blob
