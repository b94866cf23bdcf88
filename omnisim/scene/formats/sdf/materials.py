"""Materials of visuals."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from PIL import Image

from omnisim.core.arrays import Floats
from omnisim.scene.formats.imported_scene import Omissions
from omnisim.scene.formats.resources import ResourcePath
from omnisim.scene.formats.sdf.geometry import Layer, blend, terrain_size_m
from omnisim.scene.formats.xml.element import XmlElement
from omnisim.scene.parts import AlphaMode, Material, Texture
from omnisim.scene.textures import NO_IMAGE, TextureStore, alpha_mode_of, unreadable_image

_DEFAULT = (0.7, 0.7, 0.7)  # Gazebo's color for visuals without a material
_TEXTURE_FOLDERS = ("", "materials/textures", "../materials/textures", "../textures")


class MaterialReader:
    """Reader of materials, which merges equal ones."""

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
        metal = element.find("pbr/metal")
        values = metal or element.find("pbr/specular")
        if values is None:
            return plain
        emissive_map = self._map(values, "emissive_map", is_linear=False)
        normal_map = values.find("normal_map")
        is_placed = normal_map is not None and normal_map.attribute("type") == "object"
        if is_placed:
            self._omissions.count("normal maps in the object's frame are not drawn", "material")
        is_dark = emissive_map is not None and element.find("emissive") is None
        material = replace(
            plain,
            emissive=(1.0, 1.0, 1.0) if is_dark else plain.emissive,
            emissive_map=emissive_map,
            normal_map=None if is_placed else self._map(values, "normal_map"),
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
        stated = element.children("diffuse", "ambient", "emissive", "pbr")
        return any(True for _ in stated) or self._script(element) is not None

    def terrain(self, element: XmlElement, levels: Floats) -> tuple[int, float]:
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

    def _metal_map(self, metal: XmlElement) -> Texture | None:
        """Texture with roughness in green and metal in blue, from two gray images."""
        maps = [metal.find(key) for key in ("roughness_map", "metalness_map")]
        images = [self._image(one, one.own_text) if one and one.own_text else None for one in maps]
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
                reason = unreadable_image(self._resources.reader.read(path))
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
                    image = Image.open(io.BytesIO(self._resources.reader.read(path)))
                    image.load()
                    self._images[path] = image
            except MemoryError:
                raise
            except Exception:  # Pillow's readers raise exceptions of any type
                return None
        return self._images[path]

    def _folders(self, element: XmlElement) -> Iterator[Path]:
        for uri in element.children("script"):
            for each in uri.children("uri"):
                path = self._resources.find(each.own_text, element.file.parent)
                if path is not None:
                    folder = path if path.is_dir() else path.parent
                    yield folder
                    yield folder.parent / "textures"

    def _script(self, element: XmlElement) -> ScriptMaterial | None:
        name = element.text("script/name")
        script = element.find("script")
        if script is None or not name:
            return None
        uris = [uri.own_text for uri in script.children("uri")]
        paths = [self._resources.find(uri, element.file.parent) for uri in uris if uri]
        files = tuple(path for path in paths if path is not None)
        if files not in self._scripts:
            materials = self._scripts[files] = {}
            for path in files:
                for file in sorted(path.glob("*.material")) if path.is_dir() else [path]:
                    with suppress(OSError):  # the missing material is reported below
                        text = self._resources.reader.read(file).decode("utf-8", "replace")
                        materials |= parse_scripts(text, materials)
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


# OGRE material scripts of Gazebo Classic: colors and textures.

Rgb = tuple[float, float, float]


class ScriptMaterial(NamedTuple):
    """First pass of a script material."""

    diffuse: Rgb | None = None  # linear RGB; None: not stated
    alpha: float = 1.0  # opacity
    emissive: Rgb = (0.0, 0.0, 0.0)  # linear RGB
    texture: str = ""  # name of an image file; empty: no texture
    is_known: bool = True  # True if these values describe the material completely


_GRAY: Rgb = (0.7, 0.7, 0.7)
# Materials of Gazebo's own script, which is not in a world's folder.
_COLORS: dict[str, Rgb] = {
    "Gray": _GRAY, "Grey": _GRAY, "DarkGray": (0.175,) * 3, "DarkGrey": (0.175,) * 3,
    "White": (1.0,) * 3, "FlatBlack": (0.1,) * 3, "Black": (0.0,) * 3, "Red": (1.0, 0.0, 0.0),
    "RedBright": (0.87, 0.26, 0.07), "Green": (0.0, 1.0, 0.0), "Blue": (0.0, 0.0, 1.0),
    "SkyBlue": (0.13, 0.44, 0.7), "Yellow": (1.0, 1.0, 0.0), "ZincYellow": (0.9725, 0.9529, 0.2078),
    "DarkYellow": (0.7, 0.7, 0.0), "Purple": (1.0, 0.0, 1.0), "Turquoise": (0.0, 1.0, 1.0),
    "Orange": (1.0, 0.5088, 0.0468), "Indigo": (0.33, 0.0, 0.5), "Gold": (0.8, 0.64869, 0.120759),
    "Pioneer2Body": (0.681193, 0.000923, 0.000923),
}  # fmt: skip
_GLOWS = ("White", "Red", "Green", "Blue", "Yellow", "Purple", "Turquoise")
_TRANSPARENT: dict[str, Rgb] = {
    "Red": (1.0, 0.0, 0.0), "Green": (0.0, 1.0, 0.0), "Blue": (0.0, 0.0, 1.0),
    "DarkMagenta": (0.6, 0.0, 0.6), "Grey": (0.5,) * 3, "Black": (0.0,) * 3,
    "Yellow": (1.0, 1.0, 0.0), "Orange": (1.0, 0.44, 0.0),
}  # fmt: skip
# Substitute colors for materials with Gazebo's own textures.
_TEXTURED: dict[str, Rgb] = {
    "Wood": (0.36, 0.2, 0.1), "WoodFloor": (0.4, 0.25, 0.13), "WoodPallet": (0.45, 0.32, 0.18),
    "CeilingTiled": (0.7,) * 3, "PaintedWall": (0.75, 0.73, 0.68), "Bricks": (0.35, 0.14, 0.1),
    "Road": (0.08,) * 3, "Residential": (0.1,) * 3, "Tertiary": (0.1,) * 3, "Motorway": (0.08,) * 3,
    "Trunk": (0.08,) * 3, "Primary": (0.08,) * 3, "Secondary": (0.08,) * 3, "Runway": (0.08,) * 3,
    "Pedestrian": (0.35,) * 3, "Footway": (0.35,) * 3, "Steps": (0.35,) * 3,
    "Grass": (0.1, 0.22, 0.05), "PioneerBody": (0.6, 0.02, 0.02), "BuildingFrame": (0.5,) * 3,
}  # fmt: skip
GAZEBO_MATERIALS = {f"Gazebo/{name}": ScriptMaterial(color) for name, color in _COLORS.items()}
for _name in _GLOWS:
    GAZEBO_MATERIALS[f"Gazebo/{_name}Glow"] = ScriptMaterial(
        _COLORS[_name], emissive=_COLORS[_name]
    )
for _name, _color in _TRANSPARENT.items():
    GAZEBO_MATERIALS[f"Gazebo/{_name}Transparent"] = ScriptMaterial(_color, alpha=0.5)
for _name, _color in _TEXTURED.items():
    GAZEBO_MATERIALS[f"Gazebo/{_name}"] = ScriptMaterial(_color, is_known=False)
_HEAD = re.compile(r"^\s*material\s+([^\s:{]+)(?:\s*:\s*([^\s{]+))?", re.MULTILINE)
_PASS = re.compile(r"\bpass\b[^{}]*\{")
_LINE = re.compile(r"(?:^|\{)[ \t]*(diffuse|ambient|emissive|texture)[ \t]+([^\n}]+)", re.MULTILINE)


def parse_scripts(text: str, parents: dict[str, ScriptMaterial]) -> dict[str, ScriptMaterial]:
    """Materials of a script by name, with the first colors and texture of each, or its parent's.

    `parents` are materials of other scripts.
    """
    text = re.sub(r"//[^\n]*", "", text)
    heads = list(_HEAD.finditer(text))
    materials: dict[str, ScriptMaterial] = {}
    for head, end in zip(heads, [*(h.start() for h in heads), len(text)][1:], strict=True):
        parent = materials.get(head[2] or "") or parents.get(head[2] or "") or ScriptMaterial()
        values: dict[str, str] = {}
        passes = list(_PASS.finditer(text, head.end(), end))
        first_end = passes[1].start() if len(passes) > 1 else end
        for line in _LINE.finditer(text, head.end(), first_end):
            values.setdefault(line[1], line[2].strip())
        color = _numbers(values.get("diffuse", ""))
        emissive = _numbers(values.get("emissive", ""))
        materials[head[1]] = ScriptMaterial(
            _rgb(color) or parent.diffuse,
            min(max(color[3], 0.0), 1.0) if len(color) > 3 and color[3] > 0.0 else parent.alpha,
            _rgb(emissive) or parent.emissive,
            values["texture"].split()[0].strip('"') if "texture" in values else parent.texture,
        )
    return materials


def _numbers(text: str) -> tuple[float, ...]:
    try:
        values = tuple(float(word) for word in text.split())
    except ValueError:  # the keyword vertexcolor
        return ()
    return values if all(0.0 <= value <= 1e6 for value in values) else ()


def _rgb(values: tuple[float, ...]) -> Rgb | None:
    return (values[0], values[1], values[2]) if len(values) >= 3 else None
