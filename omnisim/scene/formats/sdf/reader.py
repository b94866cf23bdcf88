"""Importer for SDF: visuals, materials and lights of a world or model, as stated in the file."""

from __future__ import annotations

import io
import itertools
import math
import re
import warnings
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

from omnisim.core.arrays import Floats
from omnisim.core.errors import SceneError
from omnisim.core.poses import inverse
from omnisim.scene.formats.features import part_notices, xml_parts
from omnisim.scene.formats.imported_scene import (
    Cameras,
    ImportedScene,
    Omissions,
    make_mesh,
    read_lens,
    translate,
)
from omnisim.scene.formats.resources import ResourcePath
from omnisim.scene.formats.sdf.geometry import (
    GEOMETRIES,
    SHAPES,
    Layer,
    MeshLibrary,
    VisualShape,
    blend,
    centered,
    make_shape,
    read_levels,
    segment_limit,
    submesh,
    terrain,
    terrain_size_m,
)
from omnisim.scene.formats.sdf.models import (
    ENTITIES,
    UNPLACED,
    Model,
    ModelLibrary,
    PlacedModel,
    UnplacedError,
    placed_models,
    read_root,
    with_pose_of,
)
from omnisim.scene.formats.xml.element import XmlElement
from omnisim.scene.light.lighting import DEFAULT_BACKGROUND
from omnisim.scene.parts import AlphaMode, Instance, Light, LightKind, Link, Material, Mesh, Texture
from omnisim.scene.textures import NO_IMAGE, TextureStore, alpha_mode_of, unreadable_image

_FARTHEST_M = 1e9
_BASE_FROM_OPENGL = np.array(
    [[0.0, 0, -1, 0], [-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]
)  # a camera's x ahead, z up, from −z ahead, y up


def read_sdf(
    path: Path,
    data: bytes,
    textures: TextureStore,
    resources: ResourcePath,
    world_from_file: Floats,
) -> ImportedScene:
    """Read a world or model.

    Raises:
        SceneError: a damaged file; naming element, value and the expected value.
    """
    return _Reader(resources, textures, world_from_file).read(read_root(path, data))


class _Reader:
    """Meshes, materials, instances and lights of a file."""

    def __init__(
        self, resources: ResourcePath, textures: TextureStore, world_from_file: Floats
    ) -> None:
        self._omissions = Omissions()
        self._library = ModelLibrary(resources, self._omissions)
        self._resources = resources
        self._materials = MaterialReader(resources, textures, self._omissions)
        self._files = MeshLibrary(textures, resources.reader)
        self._world_from_file = world_from_file
        self._meshes: list[Mesh] = []
        self._shapes: dict[tuple[object, ...], VisualShape] = {}
        # mesh index and center, keyed by ids of shape or mesh, and material
        self._made: dict[tuple[int, int], tuple[int, Floats]] = {}
        self._instances: list[Instance] = []
        self._lights: list[Light] = []
        self._cameras = Cameras()
        self._links: list[Link] = []

    def read(self, root: XmlElement) -> ImportedScene:
        """Read the first world of a file, or all of its models and lights."""
        worlds = list(root.children("world"))
        for _ in worlds[1:]:
            self._omissions.count("only the first world is drawn", "further world")
        outer = worlds[0] if worlds else root
        if not worlds and not any(True for _ in root.children(*ENTITIES)):
            raise SceneError("expected a <world>, <model> or <light>, got none")
        world = self._library.tree(outer, "")
        apply_state(world, self._omissions)
        self._library.drop_unplaced(world)
        scene, background = outer.find("scene"), None
        if scene is not None:
            has_sky = scene.find("sky") is not None
            background = DEFAULT_BACKGROUND if has_sky else scene.color("background")
        parts: dict[int, list[tuple[str, str]]] = {}  # by id: files may be included repeatedly
        for placed in placed_models(world):
            self._read_model(placed)
            own = placed.model.element.element
            if id(own) not in parts:
                parts[id(own)] = list(xml_parts(own, "sdf", ("model",)))
        unread = part_notices("sdf", itertools.chain(*parts.values()))
        notices = [
            *self._library.notices, *unread, *self._omissions.notices, *self._files.notices,
            *self._cameras.notices,
        ]  # fmt: skip
        return ImportedScene(
            tuple(self._meshes),
            tuple(self._materials.materials),
            tuple(self._instances),
            notices,
            tuple(self._lights),
            background=background,
            cameras=self._cameras.poses,
            links=tuple(self._links),
        )

    def _read_model(self, placed: PlacedModel) -> None:
        for other in placed.model.others:
            if other.element.tag == "light":
                self._read_light(other, self._pose_of(placed, other))
        fixed_to = {
            joint.text("child").replace("::", "/"): joint.text("parent").replace("::", "/")
            for joint in placed.model.element.children("joint")
            if joint.attribute("type") == "fixed"
        }
        for link in placed.model.element.children("link"):
            pose, name = self._pose_of(placed, link), f"{placed.path}{link.name or 'link'}"
            if pose is not None:
                parent = fixed_to.get(link.name, link.name or "link")
                is_still = placed.is_static or parent == "world"
                owner = "" if is_still else f"{placed.path}{parent}"
                self._links.append(Link(name, pose, owner))
            for visual in link.children("visual"):
                place = self._pose_of(placed, visual, link.name)
                self._read_visual(visual, place, f"{name}/{visual.name or 'visual'}")
            for light in link.children("light"):
                self._read_light(light, self._pose_of(placed, light, link.name))
            for sensor in link.children("sensor"):
                for camera in sensor.children("camera"):
                    self._read_camera(placed, link, sensor, camera)

    def _read_camera(
        self, placed: PlacedModel, link: XmlElement, sensor: XmlElement, camera: XmlElement
    ) -> None:
        from omnisim.cameras.calibration.formats import gazebo  # seldom needed

        pose = self._pose_of(placed, sensor, link.name)
        if pose is not None:
            name = f"{placed.path}{sensor.name or camera.name or 'camera'}"
            lens = read_lens(partial(gazebo.read_lens, camera.element, camera.place))
            world_from_camera = self._world_from_file @ pose @ camera.pose() @ _BASE_FROM_OPENGL
            self._cameras.add(name, world_from_camera, lens)

    def _pose_of(
        self, placed: PlacedModel, element: XmlElement, default: str = ""
    ) -> Floats | None:
        """Pose (4, 4) of an element; None, with a notice, if it depends on a missing model."""
        try:
            return placed.pose_of(element, default)
        except UnplacedError:
            self._omissions.count(UNPLACED, element.element.tag)
            return None

    def _read_light(self, element: XmlElement, file_from_light: Floats | None) -> None:
        if file_from_light is not None:
            pose = self._world_from_file @ file_from_light
            self._lights += filter(None, [read_light(element, pose, self._omissions)])

    def _read_visual(self, visual: XmlElement, file_from_visual: Floats | None, name: str) -> None:
        geometry = visual.find("geometry")
        kind = None if geometry is None else next(geometry.children(*GEOMETRIES), None)
        if geometry is None or kind is None or file_from_visual is None:
            return
        tag = kind.element.tag
        if tag == "mesh":
            self._read_mesh(kind, visual, file_from_visual, name)
        elif tag == "heightmap":
            self._read_heightmap(kind, file_from_visual, name)
        elif tag in SHAPES:
            key = tuple(
                (element.tag, (element.text or "").strip()) for element in geometry.element.iter()
            )
            if key not in self._shapes:
                limit = segment_limit(self._library.round_shapes)
                self._shapes[key] = make_shape(geometry, kind, limit)
            shape = self._shapes[key]
            material = self._materials.read(visual, double_sided=not shape.is_closed)
            self._place(shape, material, file_from_visual, name)

    def _read_heightmap(self, element: XmlElement, file_from_visual: Floats, name: str) -> None:
        uri = element.text("uri")
        path = self._materials.find_image(element, uri)
        if path is None:
            self._library.miss(uri)
            return
        image = self._materials.image(path)
        levels = None if image is None else read_levels(image)
        if levels is None:
            self._omissions.count(f"heightmap {path.name} is not drawn: no gray image", "visual")
            return
        material, tile_m = self._materials.terrain(element, levels)
        self._place(terrain(element, levels, tile_m), material, file_from_visual, name)

    def _place(
        self, shape: VisualShape, material: int, file_from_visual: Floats, name: str
    ) -> None:
        key = id(shape), material
        if key not in self._made:
            mesh, center = make_mesh(name, material, *shape.surface, shape.uv)
            self._made[key] = len(self._meshes), center
            self._meshes.append(mesh)
        index, center = self._made[key]
        pose = translate(file_from_visual, center)
        self._instances.append(Instance(name, index, pose, file_from_visual))

    def _read_mesh(
        self, element: XmlElement, visual: XmlElement, file_from_visual: Floats, name: str
    ) -> None:
        uri, scale = element.text("uri"), element.vector("scale", (1.0, 1.0, 1.0))
        if not all(scale):
            raise element.error("a <scale> other than 0", element.text("scale"))
        path = self._resources.find(uri, element.file.parent)
        if path is None or not path.is_file():
            self._library.miss(uri)
            return
        file = self._files.load(path)
        if isinstance(file, str):
            self._omissions.count(f"{path.name}: not drawn: {file}", "visual")
            return
        visual_from_file, instances = np.diag((*scale, 1.0)), file.instances
        if chosen := element.text("submesh/name"):
            instances = submesh(file, chosen)
            if not instances:
                self._omissions.count(f"{path.name}: submesh {chosen!r} not found", "visual")
                return
            if element.flag("submesh/center"):
                instances = centered(file, instances)
        is_stated = self._materials.is_stated(visual)
        own = self._materials.read(visual, double_sided=True) if is_stated else None
        for instance in instances:
            mesh = file.meshes[instance.mesh]
            material = own
            if material is None:
                material = self._materials.of_mesh(file.materials[mesh.material], visual)
            key = id(mesh), material
            if key not in self._made:
                self._made[key] = len(self._meshes), np.zeros(3)
                self._meshes.append(replace(mesh, material=material))
            pose = file_from_visual @ visual_from_file @ instance.world_from_mesh
            if not np.abs(pose).max() < _FARTHEST_M:  # false for NaN as well
                self._omissions.count(f"{path.name}: a part is too far away to be drawn", "part")
                continue
            self._instances.append(Instance(name, self._made[key][0], pose, file_from_visual))


# State of a world: saved poses, from which Gazebo Classic restores its models.

_UNIT = (1.0, 1.0, 1.0)


def apply_state(world: Model, omissions: Omissions) -> None:
    """Move models, links and lights to their saved poses, which are in the world frame."""
    state = world.element.find("state")
    if state is None:
        return
    _move(world, state, omissions)
    lights = {light.name: light for light in state.children("light")}
    world.others[:] = [with_pose_of(other, lights.get(other.name, other)) for other in world.others]
    for _ in state.children("insertions"):
        omissions.count("insertions of a state are not applied", "state")


def _move(outer: Model, state: XmlElement, omissions: Omissions) -> None:
    """Move the models and links of the world, or of a model that is already moved."""
    world_from_outer = state.pose()
    models = {model.name: model for model in outer.models}
    for saved in state.children("model", "link"):
        is_model = saved.element.tag == "model"
        if saved.find("pose") is not None and (saved.name in models or not is_model):
            outer.scope.place(saved.name, inverse(world_from_outer) @ saved.pose())
        if is_model and saved.name in models:
            if saved.vector("scale", _UNIT) != _UNIT:
                omissions.count("scales of a state are not applied", "model")
            _move(models[saved.name], saved, omissions)


# Lights of worlds and links.

_KINDS = {kind.value: kind for kind in LightKind}
_REFERENCE_M = 5.0  # distance of equal brightness for lights with another falloff
_ATTENUATION = "attenuation of lights is drawn as 1/distance², matched at a few meters"


def read_light(element: XmlElement, world_from_light: Floats, omissions: Omissions) -> Light | None:
    """Light in the world; None: switched off or black.

    Intensities are relative: at intensity 1 a white surface appears white.
    """
    kind = _KINDS.get(element.attribute("type") or "point")
    if kind is None:
        raise element.error("type point, directional or spot", element.attribute("type"))
    color = element.color("diffuse") or (1.0, 1.0, 1.0)
    intensity = element.number("intensity", 1.0)
    if not element.flag("light_on", default=True) or not any(color) or intensity <= 0.0:
        return None
    direction = np.array(element.vector("direction", (0.0, 0.0, -1.0)))
    length = float(np.linalg.norm(direction))
    axis = world_from_light[:3, :3] @ (direction / length if length > 1e-9 else (0.0, 0.0, -1.0))
    # Gazebo's point lights cast no shadows, and often sit inside lamp meshes
    casts_shadow = element.flag("cast_shadows") and kind is not LightKind.POINT
    if kind is LightKind.DIRECTIONAL:
        return Light(kind, color, intensity, direction=axis, casts_shadow=casts_shadow)
    range_m, cones = element.positive("attenuation/range", 10.0), (1.0, 0.0)
    constant, linear, quadratic = (
        max(element.number(f"attenuation/{key}", default), 0.0)
        for key, default in (("constant", 1.0), ("linear", 1.0), ("quadratic", 0.0))
    )
    if constant == linear == 0.0 and quadratic > 0.0:
        candela = intensity * (1.0 / quadratic)
    else:
        omissions.count(_ATTENUATION, "light")
        distance = min(0.25 * range_m, _REFERENCE_M)
        falloff = constant + linear * distance + quadratic * distance**2
        candela = intensity * (distance**2 / max(falloff, 1e-3))
    if kind is LightKind.SPOT:  # the file states full angles
        outer = min(max(element.number("spot/outer_angle", 0.0), 1e-3), math.pi)
        inner = min(max(element.number("spot/inner_angle", 0.0), 0.0), outer)
        cones = math.cos(0.5 * inner), math.cos(0.5 * outer)
    return Light(
        kind,
        color,
        candela,
        position_m=world_from_light[:3, 3].copy(),
        direction=axis,
        range_m=range_m,
        casts_shadow=casts_shadow,
        cone_cosines=cones,
    )


# Materials of visuals.


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
            (child.number("min_height", 0.0), child.number("fade_dist", 0.0))
            for child in element.children("blend")
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
        images = [
            self._image(element, element.own_text) if element and element.own_text else None
            for element in maps
        ]
        given = [image for image in images if image is not None]
        if not given:
            return None
        pair = tuple(map(id, images))
        if pair not in self._joined:
            size = max(given, key=lambda image: image.size).size
            white = Image.new("L", size, 255)
            bands = [
                white if image is None else image.convert("L").resize(size) for image in images
            ]
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
            self._omissions.count(f"image {name} is missing: drawn without it", "material")
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
        for uri in (
            child for script in element.children("script") for child in script.children("uri")
        ):
            if (script := self._resources.find(uri.own_text, folder)) is not None:
                scripts = script if script.is_dir() else script.parent
                folders += [scripts, scripts.parent / "textures"]
        path = self._resources.find(name, *folders)
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
