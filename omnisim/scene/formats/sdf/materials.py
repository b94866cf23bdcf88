"""Materials of visuals."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from omnisim.core.files.sources import read_source
from omnisim.scene.files.search_path import ResourcePath
from omnisim.scene.formats.omissions import Omissions
from omnisim.scene.formats.sdf.heightmaps import Layer, blend, terrain_size_m
from omnisim.scene.formats.sdf.scripts import GAZEBO_MATERIALS, ScriptMaterial, read_scripts
from omnisim.scene.formats.xml.element import XmlElement
from omnisim.scene.parts import AlphaMode, Material, Texture
from omnisim.scene.textures import NO_IMAGE, TextureStore, alpha_mode_of, unreadable_image

_DEFAULT = (0.7, 0.7, 0.7)  # Gazebo's color for visuals without a material
_TEXTURE_FOLDERS = ("", "materials/textures", "../materials/textures", "../textures")


class MaterialReader:
    """Reader of materials, which merges equal ones.

    Attributes:
        materials: all materials read so far.
    """

    def __init__(
        self, resources: ResourcePath, textures: TextureStore, omissions: Omissions
    ) -> None:
        self.materials: list[Material] = []
        self._resources, self._textures, self._omissions = resources, textures, omissions
        self._indices: dict[tuple[object, ...], int] = {}
        self._images: dict[Path, Image.Image | None] = {}
        self._joined: dict[tuple[int, ...], Image.Image] = {}
        self._scripts: dict[tuple[Path, ...], dict[str, ScriptMaterial]] = {}

    def read(self, visual: XmlElement, double_sided: bool) -> int:
        """Index of a visual's material, or of a default one."""
        element = visual.find("material")
        material = Material("", (*_DEFAULT, 1.0), double_sided=double_sided)
        if element is not None:
            material = self._reflectance(element, self._plain(element, double_sided))
        return self._index(_of_visual(material, visual))

    def _plain(self, element: XmlElement, double_sided: bool) -> Material:
        """Material with color, texture and sides of a `<material>`."""
        script = self._script(element) or ScriptMaterial()
        texture = self._albedo(element, script)
        color = (
            script.diffuse
            or element.color("diffuse")
            or element.color("ambient")
            or ((1.0, 1.0, 1.0) if texture is not None else _DEFAULT)
        )
        mode = AlphaMode.BLEND if script.alpha < 1.0 else alpha_mode_of(texture)
        return Material(
            element.text("script/name"),
            (*color, script.alpha),
            texture,
            mode,
            double_sided=double_sided
            or element.flag("double_sided")
            or mode is not AlphaMode.OPAQUE,
            unlit=not element.flag("lighting", default=True),
            emissive=element.color("emissive") or script.emissive,
        )

    def _reflectance(self, element: XmlElement, plain: Material) -> Material:
        """Material with metal, roughness and maps of its `<pbr>`; matte without `<pbr>`."""
        metal = element.find("pbr/metal")
        values = metal or element.find("pbr/specular")
        if values is None:
            return plain
        emissive_map = self._map(values, "emissive_map", is_linear=False)
        is_dark = emissive_map is not None and element.find("emissive") is None
        material = replace(
            plain,
            emissive=(1.0, 1.0, 1.0) if is_dark else plain.emissive,
            emissive_map=emissive_map,
            normal_map=self._normal_map(values),
            occlusion_map=self._map(values, "ambient_occlusion_map"),
        )
        if metal is None:  # Gazebo also renders it as matte
            return material
        return replace(
            material,
            metallic=min(max(metal.number("metalness", 0.5), 0.0), 1.0),
            roughness=min(max(metal.number("roughness", 0.5), 0.0), 1.0),
            specular=1.0,
            metallic_roughness_map=self._metal_map(metal),
        )

    def is_stated(self, visual: XmlElement) -> bool:
        """True if a visual has a material that replaces its mesh's."""
        element = visual.find("material")
        if element is None:
            return False
        if any(True for _ in element.children("diffuse", "ambient", "emissive", "pbr")):
            return True
        return self._script(element) is not None

    def terrain(self, element: XmlElement, levels: NDArray[np.float64]) -> tuple[int, float]:
        """Index of a heightmap's material, and its texture's side length, m; 0: the whole map."""
        layers = []
        blends = [
            (one.number("min_height", 0.0), one.number("fade_dist", 0.0))
            for one in element.children("blend")
        ]
        starts = [(0.0, 0.0), *blends]
        for stated, (from_m, fade_m) in zip(element.children("texture"), starts, strict=False):
            image = self._image(stated, stated.text("diffuse"))
            if image is not None:
                layers.append(Layer(image, stated.positive("size", 10.0), from_m, fade_m))
        if not layers:
            return self._index(Material("", (*_DEFAULT, 1.0))), 0.0
        size = terrain_size_m(element)
        if len(layers) == 1:
            pixels, tile_m = layers[0].image, layers[0].size_m
        else:
            pixels, tile_m = blend(layers, levels, size), 0.0
        texture = self._textures.texture(pixels, "terrain")
        return self._index(Material("", texture=texture)), tile_m

    def of_mesh(self, material: Material, visual: XmlElement) -> int:
        """Index of a mesh's own material, with its visual's transparency and shadow settings."""
        return self._index(_of_visual(material, visual))

    def _index(self, material: Material) -> int:
        values = vars(material).values()
        key = tuple(id(value) if isinstance(value, Texture) else value for value in values)
        if key not in self._indices:
            self._indices[key] = len(self.materials)
            self.materials.append(material)
        return self._indices[key]

    def _albedo(self, element: XmlElement, script: ScriptMaterial) -> Texture | None:
        for workflow in ("metal", "specular"):
            albedo_map = element.find(f"pbr/{workflow}/albedo_map")
            if albedo_map is not None and albedo_map.own_text:
                return self._texture(albedo_map, albedo_map.own_text)
        return self._texture(element, script.texture) if script.texture else None

    def _map(self, values: XmlElement, key: str, is_linear: bool = True) -> Texture | None:
        map_element = values.find(key)
        if map_element is None or not map_element.own_text:
            return None
        return self._texture(map_element, map_element.own_text, is_linear)

    def _normal_map(self, values: XmlElement) -> Texture | None:
        normal_map = values.find("normal_map")
        if normal_map is not None and normal_map.attribute("type") == "object":
            self._omissions.count("normal maps in the object's frame are not drawn", "material")
            return None
        return self._map(values, "normal_map")

    def _metal_map(self, metal: XmlElement) -> Texture | None:
        """Texture with roughness in green and metal in blue, from two gray images."""
        images = []
        for key in ("roughness_map", "metalness_map"):
            map_element = metal.find(key)
            name = "" if map_element is None else map_element.own_text
            images.append(
                self._image(map_element, name) if map_element is not None and name else None
            )
        given = [image for image in images if image is not None]
        if not given:
            return None
        pair = tuple(map(id, images))
        if pair not in self._joined:
            size = max(given, key=lambda image: image.size).size
            white = Image.new("L", size, 255)
            bands = [white if one is None else one.convert("L").resize(size) for one in images]
            self._joined[pair] = Image.merge("RGB", [white, *bands])
        return self._textures.texture(self._joined[pair], "roughness_map", is_linear=True)

    def _texture(self, element: XmlElement, name: str, is_linear: bool = False) -> Texture | None:
        image = self._image(element, name)
        if image is None:
            return None
        return self._textures.texture(image, Path(name).name, is_linear=is_linear)

    def _image(self, element: XmlElement, name: str) -> Image.Image | None:
        """Image by its name in an element; None, with a notice, if it cannot be read."""
        path = self.find_image(element, name)
        if path is None:
            self._omissions.count(f"image {name} is not there: drawn without it", "material")
            return None
        image = self.image(path)
        if image is None:
            reason = NO_IMAGE
            with suppress(OSError):
                reason = unreadable_image(read_source(path))
            self._omissions.count(f"image {name} {reason}: drawn without it", "material")
        return image

    def find_image(self, element: XmlElement, name: str) -> Path | None:
        """Path of an image file by its name in an element; None: not found."""
        folder = element.file.parent
        folders = [folder / inner for inner in _TEXTURE_FOLDERS]
        path = self._resources.find(name, *folders, *self._folders(element))
        return path if path is not None and path.is_file() else None

    def image(self, path: Path) -> Image.Image | None:
        """Image of a file, opened once; None: unreadable."""
        if path not in self._images:
            self._images[path] = None
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")  # about large images
                    image = Image.open(io.BytesIO(read_source(path)))
                    image.load()
                    self._images[path] = image
            except MemoryError:
                raise
            except Exception:  # Pillow's readers raise exceptions of any type
                return None
        return self._images[path]

    def _folders(self, element: XmlElement) -> Iterator[Path]:
        """Folders referenced by a script's URIs."""
        for uri in element.children("script"):
            for each in uri.children("uri"):
                path = self._resources.find(each.own_text, element.file.parent)
                if path is not None:
                    folder = path if path.is_dir() else path.parent
                    yield folder
                    yield folder.parent / "textures"

    def _script(self, element: XmlElement) -> ScriptMaterial | None:
        """Material of a script, from its files or among Gazebo's own; None: not found."""
        name = element.text("script/name")
        script = element.find("script")
        if script is None or not name:
            return None
        uris = [uri.own_text for uri in script.children("uri")]
        paths = [self._resources.find(uri, element.file.parent) for uri in uris if uri]
        files = tuple(path for path in paths if path is not None)
        if files not in self._scripts:
            self._scripts[files] = read_scripts(list(files))
        material = self._scripts[files].get(name) or GAZEBO_MATERIALS.get(name)
        if material is None:
            has_color = element.find("diffuse") is not None
            other = "its <diffuse> is" if has_color else "gray is"
            self._omissions.count(f"material {name} not found: {other} drawn", "visual")
        elif not material.is_known:
            self._omissions.count(f"material {name} is drawn in a plain color", "visual")
        return material


def _of_visual(material: Material, visual: XmlElement) -> Material:
    """Material with its visual's transparency and shadow settings."""
    material = replace(material, casts_shadow=visual.flag("cast_shadows", default=True))
    transparency = min(max(visual.number("transparency", 0.0), 0.0), 1.0)
    if transparency == 0.0:
        return material
    *color, alpha = material.base_color
    red, green, blue = color
    return replace(
        material,
        base_color=(red, green, blue, alpha * (1.0 - transparency)),
        alpha_mode=AlphaMode.BLEND,
        double_sided=True,
    )
