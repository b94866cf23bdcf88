"""glTF and GLB: meshes, materials and instances exactly as the file states them."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.exchange.gltf.extensions import register_handler

from omnisim.errors import SceneError
from omnisim.scene.gltf_header import MARKER
from omnisim.scene.mesh_data import colors_rgba, make_mesh
from omnisim.scene.model import AlphaMode, Instance, Material, Mesh, Wrap
from omnisim.scene.textures import TextureStore

_REPEAT, _MIRRORED, _CLAMP = 10497, 33648, 33071  # OpenGL's numbers, as samplers state them
_ALPHA_MODES = {mode.name: mode for mode in AlphaMode}
_NORMALIZED_SCALE = {"u1": 255.0, "u2": 65535.0, "i1": 127.0, "i2": 32767.0}


@register_handler(MARKER, scope="primitive")
def _keep_raw_attributes(context: dict[str, Any]) -> dict[str, Any]:
    """Keep the accessors' own arrays, before trimesh turns them into its types."""
    data, accessors = context["data"], context["accessors"]
    raw = {name: accessors[index] for name, index in data["attributes"].items()}
    return {
        "metadata": {
            MARKER: {"raw": raw, "accessors": data["attributes"], "material": data["material"]}
        }
    }


class GltfReader:
    """Turns what trimesh made of a glTF file, and the file's header, into our data."""

    def __init__(self, header: dict[str, Any], textures: TextureStore):
        self._header = header
        self._textures = textures
        self._images: dict[int, Any] = {}
        self.notices: list[str] = []

    def read(
        self, loaded: trimesh.Scene
    ) -> tuple[tuple[Mesh, ...], tuple[Material, ...], tuple[Instance, ...]]:
        """Return meshes, materials and instances; world_from_mesh is still file_from_mesh.

        Raises:
            SceneError: damaged vertices or indices.
        """
        meshes: list[Mesh] = []
        index_of: dict[str, tuple[int, NDArray[np.float64]]] = {}
        default_material = len(self._header.get("materials", []))
        for name, geometry in loaded.geometry.items():
            if not isinstance(geometry, trimesh.Trimesh):
                self.notices.append(f"mesh {name!r}: points and lines are not drawn")
                continue
            marker = geometry.metadata.get(MARKER)
            if marker is None:
                raise SceneError(f"mesh {name!r}: its attributes cannot be read")
            material = default_material if marker["material"] is None else marker["material"]
            if not 0 <= material <= default_material:
                raise SceneError(f"mesh {name!r}: there is no material {material}")
            image = getattr(geometry.visual, "material", None)
            self._images.setdefault(material, getattr(image, "baseColorTexture", None))
            made = self._mesh(name, geometry, marker, material)
            if made is not None:
                index_of[name] = (len(meshes), made[1])
                meshes.append(made[0])
        materials = tuple(
            self._material(index, data)
            for index, data in enumerate([*self._header.get("materials", []), {}])
        )
        return tuple(meshes), materials, _instances(loaded, index_of)

    def _mesh(
        self, name: str, geometry: trimesh.Trimesh, marker: dict[str, Any], material: int
    ) -> tuple[Mesh, NDArray[np.float64]] | None:
        def attribute(key: str) -> NDArray[Any] | None:
            if key not in marker["raw"]:
                return None
            return self._floats(marker["raw"][key], marker["accessors"][key])

        positions = attribute("POSITION")
        coordinates = attribute(f"TEXCOORD_{self._coordinate_set(material)}")
        if coordinates is not None:
            coordinates = self._transformed(coordinates, material)
            # a mirrored texture is stored with its mirror image beside it
            mirrored = [wrap == _MIRRORED for wrap in self._wraps(material)]
            coordinates = coordinates * np.where(mirrored, 0.5, 1.0)
        colors = attribute("COLOR_0")
        return make_mesh(
            name,
            geometry.vertices if positions is None else positions,
            geometry.faces,
            material,
            normals=attribute("NORMAL"),
            texture_coordinates=coordinates,
            colors=None if colors is None else colors_rgba(colors, 1.0),
        )

    def _floats(self, values: NDArray[Any], accessor: int) -> NDArray[Any]:
        """Integers to the fractions that they stand for, where the accessor says `normalized`."""
        kind = values.dtype.str[1:]
        if self._header["accessors"][accessor].get("normalized") and kind in _NORMALIZED_SCALE:
            return np.maximum(values / _NORMALIZED_SCALE[kind], -1.0)
        return values

    def _texture_info(self, material: int) -> dict[str, Any]:
        materials = self._header.get("materials", [])
        data = materials[material] if material < len(materials) else {}
        glossy = data.get("extensions", {}).get("KHR_materials_pbrSpecularGlossiness")
        if glossy is not None:
            return glossy.get("diffuseTexture", {})
        return data.get("pbrMetallicRoughness", {}).get("baseColorTexture", {})

    def _coordinate_set(self, material: int) -> int:
        info = self._texture_info(material)
        transform = info.get("extensions", {}).get("KHR_texture_transform", {})
        return int(transform.get("texCoord", info.get("texCoord", 0)))

    def _transformed(self, coordinates: NDArray[Any], material: int) -> NDArray[Any]:
        """Source: KHR_texture_transform, translation · rotation · scale."""
        extensions = self._texture_info(material).get("extensions", {})
        transform = extensions.get("KHR_texture_transform")
        if transform is None:
            return coordinates
        scaled = np.asarray(coordinates, dtype=np.float64) * transform.get("scale", (1.0, 1.0))
        cos, sin = np.cos(transform.get("rotation", 0.0)), np.sin(transform.get("rotation", 0.0))
        return scaled @ np.array([[cos, -sin], [sin, cos]]) + transform.get("offset", (0.0, 0.0))

    def _material(self, index: int, data: dict[str, Any]) -> Material:
        extensions = data.get("extensions", {})
        glossy = extensions.get("KHR_materials_pbrSpecularGlossiness")
        if glossy is None:
            factor = data.get("pbrMetallicRoughness", {}).get("baseColorFactor", (1.0,) * 4)
        else:
            factor = glossy.get("diffuseFactor", (1.0,) * 4)
        name = data.get("name", f"material {index}")
        texture, info = None, self._texture_info(index)
        if "index" in info and index in self._images:
            if self._images[index] is None:
                self.notices.append(
                    f"texture of {name} is not there, or in a format that cannot be read: "
                    "its plain colour is drawn"
                )
            else:
                wraps = self._wraps(index)
                texture = self._textures.texture(
                    self._images[index],
                    name,
                    wraps=tuple(Wrap.CLAMP_TO_EDGE if w == _CLAMP else Wrap.REPEAT for w in wraps),
                    mirrored=tuple(w == _MIRRORED for w in wraps),
                )
        red, green, blue, alpha = (float(value) for value in factor)
        mode = _ALPHA_MODES.get(data.get("alphaMode"), AlphaMode.OPAQUE)
        return Material(
            name=name,
            base_color=(red, green, blue, alpha),
            texture=texture,
            alpha_mode=mode,
            alpha_cutoff=float(data.get("alphaCutoff", 0.5)),
            double_sided=bool(data.get("doubleSided", False)),
            unlit="KHR_materials_unlit" in extensions,
        )

    def _wraps(self, material: int) -> tuple[int, int]:
        """OpenGL's numbers for what lies beyond the texture's edges."""
        info = self._texture_info(material)
        data = self._header["textures"][info["index"]] if "index" in info else {}
        sampler = self._header["samplers"][data["sampler"]] if "sampler" in data else {}
        return sampler.get("wrapS", _REPEAT), sampler.get("wrapT", _REPEAT)


def _instances(
    loaded: trimesh.Scene, index_of: dict[str, tuple[int, NDArray[np.float64]]]
) -> tuple[Instance, ...]:
    instances = []
    for node in loaded.graph.nodes_geometry:
        file_from_mesh, geometry = loaded.graph[node]
        if geometry not in index_of:
            continue
        mesh, middle = index_of[geometry]
        # trimesh puts the primitives of a mesh below its node, under names of its own
        if loaded.geometry[geometry].metadata.get("from_gltf_primitive"):
            node = loaded.graph.transforms.parents.get(node, node)
        instances.append(Instance(str(node), mesh, moved(file_from_mesh, middle)))
    return tuple(instances)


def moved(matrix: NDArray[np.float64], middle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pose (4, 4) of a mesh whose origin was moved to `middle` (3,)."""
    result = np.array(matrix, dtype=np.float64)
    result[:3, 3] += result[:3, :3] @ middle
    return result
