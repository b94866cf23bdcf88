"""The scene under construction: named models placed at named nodes, then written as GLB."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import trimesh
from trimesh.visual.material import PBRMaterial
from trimesh.visual.texture import TextureVisuals

from scenes.modeling.geometry import Patch, pose

# glTF is Y up: world (x, y, z) is stored as (x, z, -y).
TO_GLTF = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
UNLIT = "KHR_materials_unlit"
SPECULAR, STRENGTH = "KHR_materials_specular", "KHR_materials_emissive_strength"


@dataclass(frozen=True)
class Model:
    """A shape in one material; placed any number of times."""

    name: str
    material: str
    patch: Patch


@dataclass
class Stage:
    """Collects nodes; each node is one object, and its name says which.

    Attributes:
        name: of the scene.
        materials: by name.
        unlit: names of materials that show their plain colors under any lamp
            (KHR_materials_unlit).
        emissive: luminance of materials that are seen as lamps, times their color
            (KHR_materials_emissive_strength).
        is_matte: all others are without gloss (KHR_materials_specular), except the `glossy` ones.
        glossy: names of materials that keep their gloss or metal.
        extensions: further glTF extensions of materials, by the material's name.
        models, nodes: filled by `place`.
    """

    name: str
    materials: dict[str, PBRMaterial]
    unlit: frozenset[str] = frozenset()
    emissive: Mapping[str, float] = field(default_factory=dict)
    is_matte: bool = False
    glossy: frozenset[str] = frozenset()
    extensions: Mapping[str, Mapping[str, dict]] = field(default_factory=dict)
    models: dict[str, Model] = field(default_factory=dict)
    nodes: dict[str, tuple[str, np.ndarray]] = field(default_factory=dict)

    def place(self, node: str, model: Model, matrix: np.ndarray | None = None) -> None:
        """Add one object."""
        if node in self.nodes:
            raise ValueError(f"two objects are called {node}")
        known = self.models.setdefault(model.name, model)
        if known is not model:
            raise ValueError(f"two models are called {model.name}")
        self.nodes[node] = (model.name, pose() if matrix is None else matrix)

    def triangle_count(self) -> int:
        """Triangles drawn, instances counted each time."""
        return sum(len(self.models[name].patch.faces) for name, _ in self.nodes.values())

    def write(self, path: Path, compact: bool = False) -> int:
        """Write a GLB file; returns its size in bytes.

        `compact` leaves out normals that no lamp and texture coordinates that no picture needs,
        and stores indices in 16 bits where they fit.
        """
        scene = trimesh.Scene()
        scene.geometry.update(
            {name: self._mesh(model, compact) for name, model in self.models.items()}
        )
        for node, (name, matrix) in self.nodes.items():
            stored = TO_GLTF @ matrix @ np.linalg.inv(TO_GLTF)
            # Rounding keeps the file free of 1e-17 noise that differs between machines.
            stored = np.round(stored, 6) + 0.0
            # Not add_geometry, which would store a copy of the mesh for every instance.
            scene.graph.update(frame_to=node, matrix=stored, geometry=name)
        return path.write_bytes(
            trimesh.exchange.gltf.export_glb(
                scene,
                include_normals=not (compact and self.unlit == set(self.materials)),
                tree_postprocessor=self._finish_tree,
                buffer_postprocessor=_shorten_indices if compact else None,
            )
        )

    def _mesh(self, model: Model, compact: bool) -> trimesh.Trimesh:
        turn = TO_GLTF[:3, :3]
        material = self.materials[model.material]
        plain = compact and material.baseColorTexture is None
        return trimesh.Trimesh(
            vertices=np.round(model.patch.positions @ turn.T, 5),
            faces=model.patch.faces,
            vertex_normals=np.round(model.patch.normals @ turn.T, 5),
            visual=TextureVisuals(
                uv=None if plain else np.round(model.patch.uvs, 5), material=material
            ),
            process=False,
        )

    def _extensions(self, material: dict) -> dict[str, dict]:
        """Extensions of a material, whose own keys follow them."""
        if material["name"] in self.unlit:
            return {UNLIT: {}}
        is_matte = self.is_matte and material["name"] not in self.glossy
        found: dict[str, dict] = {SPECULAR: {"specularFactor": 0.0}} if is_matte else {}
        found |= self.extensions.get(material["name"], {})
        if material["name"] in self.emissive:
            shape = material["pbrMetallicRoughness"]
            material["emissiveFactor"] = shape["baseColorFactor"][:3]
            shape["baseColorFactor"] = [0.0, 0.0, 0.0, 1.0]
            found[STRENGTH] = {"emissiveStrength": self.emissive[material["name"]]}
        return found

    def _finish_tree(self, tree: dict) -> None:
        """State what the exporter leaves to chance: texture filtering, buffer use, origin."""
        tree["asset"] = {"version": "2.0", "generator": f"omnisim scenes/{self.name}/build.py"}
        linear, linear_mipmap_linear, repeat = 9729, 9987, 10497
        tree["samplers"] = [
            {
                "magFilter": linear,
                "minFilter": linear_mipmap_linear,
                "wrapS": repeat,
                "wrapT": repeat,
            }
        ]
        for texture in tree.get("textures", []):
            texture["sampler"] = 0
        vertex_data, index_data = 34962, 34963
        for mesh in tree["meshes"]:
            mesh.pop("extras", None)
            for primitive in mesh["primitives"]:
                uses = [(accessor, vertex_data) for accessor in primitive["attributes"].values()]
                for accessor, target in [*uses, (primitive["indices"], index_data)]:
                    tree["bufferViews"][tree["accessors"][accessor]["bufferView"]]["target"] = (
                        target
                    )
        for material in tree.get("materials", []):
            if found := self._extensions(material):
                material["extensions"] = found
                tree["extensionsUsed"] = sorted({*tree.get("extensionsUsed", ()), *found})
        for scene in tree["scenes"]:
            scene["name"] = self.name
            scene.pop("extras", None)


def _shorten_indices(buffers: dict[int, bytes], tree: dict) -> None:
    """Store indices below 65535, which glTF reserves, in 16 bits; the exporter makes 32."""
    views, accessors = list(buffers), list(tree["accessors"].values())
    long_index, short_index = 5125, 5123
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            accessor = accessors[primitive["indices"]]
            if accessor["componentType"] != long_index or accessor["max"][0] >= 0xFFFF:
                continue
            view = views[accessor["bufferView"]]
            short = np.frombuffer(buffers[view], "<u4").astype("<u2").tobytes()
            buffers[view] = short + bytes(-len(short) % 4)
            accessor["componentType"] = short_index
