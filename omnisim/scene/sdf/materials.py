"""Materials of visuals."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path

from PIL import Image

from omnisim.scene.parts import AlphaMode, Material, Texture
from omnisim.scene.resources import ResourcePath
from omnisim.scene.sdf.element import Omissions, SdfElement
from omnisim.scene.sdf.scripts import GAZEBO_MATERIALS, ScriptMaterial, read_scripts
from omnisim.scene.textures import TextureStore, alpha_mode_of

_DEFAULT = (0.7, 0.7, 0.7)  # of a visual without a material; Gazebo's
_TEXTURE_FOLDERS = ("", "materials/textures", "../materials/textures", "../textures")


class MaterialReader:
    """Reads materials; equal ones are one.

    Attributes:
        materials: all of them.
    """

    def __init__(
        self, resources: ResourcePath, textures: TextureStore, omissions: Omissions
    ) -> None:
        self.materials: list[Material] = []
        self._resources, self._textures, self._omissions = resources, textures, omissions
        self._indices: dict[tuple[object, ...], int] = {}
        self._images: dict[Path, Image.Image | None] = {}
        self._scripts: dict[tuple[Path, ...], dict[str, ScriptMaterial]] = {}

    def read(self, visual: SdfElement, double_sided: bool) -> int:
        """Index of the material of a visual; of a default one where it has none."""
        element, name = visual.find("material"), visual.name
        color, texture, emissive, alpha = _DEFAULT, None, (0.0, 0.0, 0.0), 1.0
        if element is not None:
            double_sided = double_sided or element.flag("double_sided")
            script = self._script(element)
            texture = self._texture(element, script)
            if script is not None:
                name, alpha, emissive = element.text("script/name"), script.alpha, script.emissive
            color = (
                (script.diffuse if script is not None else None)
                or element.color("diffuse")
                or element.color("ambient")
                or ((1.0, 1.0, 1.0) if texture is not None else _DEFAULT)
            )
            emissive = element.color("emissive") or emissive
            self._count_rest(element)
        alpha *= 1.0 - min(max(visual.number("transparency", 0.0), 0.0), 1.0)
        if any(emissive):
            self._omissions.add("emission is not drawn", "material")
        mode = AlphaMode.BLEND if alpha < 1.0 else alpha_mode_of(texture)
        double_sided = double_sided or mode is not AlphaMode.OPAQUE
        key = (color, alpha, id(texture), mode, double_sided)
        return self._index(
            key, Material(name, (*color, alpha), texture, mode, double_sided=double_sided)
        )

    def is_stated(self, visual: SdfElement) -> bool:
        """True for a visual whose own material replaces that of its mesh."""
        element = visual.find("material")
        if element is None:
            return False
        if any(True for _ in element.children("diffuse", "ambient", "emissive", "pbr")):
            return True
        return self._script(element) is not None

    def translucent(self, material: Material, transparency: float) -> int:
        """Index of a mesh's own material, seen through by a visual's transparency."""
        red, green, blue, alpha = material.base_color
        if transparency <= 0.0:
            return self._index((id(material),), material)
        color = (red, green, blue, alpha * (1.0 - min(transparency, 1.0)))
        return self._index(
            (id(material), color),
            Material(material.name, color, material.texture, AlphaMode.BLEND, double_sided=True),
        )

    def _index(self, key: tuple[object, ...], material: Material) -> int:
        if key not in self._indices:
            self._indices[key] = len(self.materials)
            self.materials.append(material)
        return self._indices[key]

    def _texture(self, element: SdfElement, script: ScriptMaterial | None) -> Texture | None:
        for workflow in ("metal", "specular"):
            found = element.find(f"pbr/{workflow}/albedo_map")
            if found is not None and found.own_text:
                return self._open(found, found.own_text)
        if script is not None and script.texture:
            return self._open(element, script.texture)
        return None

    def _open(self, element: SdfElement, name: str) -> Texture | None:
        path = self.find_image(element, name)
        if path is None:
            self._omissions.add(f"texture {name} is not there: its plain colour is drawn", "visual")
            return None
        return self.texture(path)

    def find_image(self, element: SdfElement, name: str) -> Path | None:
        """Image file by the name that an element has, or None."""
        folder = element.file.parent
        folders = [folder / inner for inner in _TEXTURE_FOLDERS]
        found = self._resources.find(name, *folders, *self._folders(element))
        return found if found is not None and found.is_file() else None

    def texture(self, path: Path) -> Texture | None:
        """Texture of an image file, decoded once; None, with a notice, where that fails."""
        if path not in self._images:
            self._images[path] = None
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")  # of a large picture
                    self._images[path] = Image.open(path)
            except MemoryError:
                raise
            except Exception:  # Pillow's readers raise all kinds
                self._omissions.add(
                    f"{path.name} cannot be read: its plain colour is drawn", "image"
                )
        image = self._images[path]
        return None if image is None else self._textures.texture(image, path.name)

    def _folders(self, element: SdfElement) -> Iterator[Path]:
        """Folders that a script's URIs name."""
        for uri in element.children("script"):
            for each in uri.children("uri"):
                found = self._resources.find(each.own_text, element.file.parent)
                if found is not None:
                    folder = found if found.is_dir() else found.parent
                    yield folder
                    yield folder.parent / "textures"

    def _script(self, element: SdfElement) -> ScriptMaterial | None:
        """Material of a script, of its files or Gazebo's own; None: there is none."""
        name = element.text("script/name")
        script = element.find("script")
        if script is None or not name:
            return None
        uris = [uri.own_text for uri in script.children("uri")]
        paths = [self._resources.find(uri, element.file.parent) for uri in uris if uri]
        files = tuple(path for path in paths if path is not None)
        if files not in self._scripts:
            self._scripts[files] = read_scripts(list(files))
        found = self._scripts[files].get(name) or GAZEBO_MATERIALS.get(name)
        if found is None:
            has_color = element.find("diffuse") is not None
            other = "its <diffuse> is" if has_color else "grey is"
            self._omissions.add(f"material {name} not found: {other} drawn", "visual")
        elif not found.is_known:
            self._omissions.add(f"material {name} is drawn in a plain colour", "visual")
        return found

    def _count_rest(self, element: SdfElement) -> None:
        """Count what is not drawn."""
        for workflow in ("metal", "specular"):
            values = element.find(f"pbr/{workflow}")
            for key, effect in _NOT_DRAWN.items():
                if values is not None and values.text(key):
                    self._omissions.add(effect, "material")


_NOT_DRAWN = {
    "metalness": "metals are drawn as matt surfaces of their colour",
    "metalness_map": "maps of metal and roughness are not drawn",
    "roughness_map": "maps of metal and roughness are not drawn",
    "specular_map": "specular colour and glossiness are not drawn",
    "glossiness_map": "specular colour and glossiness are not drawn",
    "normal_map": "normal maps are not drawn",
    "ambient_occlusion_map": "occlusion maps are not drawn",
    "emissive_map": "emission is not drawn",
    "environment_map": "environment maps are not drawn",
    "light_map": "light maps are not drawn",
}
