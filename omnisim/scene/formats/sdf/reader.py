"""Importer for SDF: visuals and lights of a world or model, as stated in the file."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

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
    MeshLibrary,
    Shape,
    centered,
    make_shape,
    read_levels,
    segment_limit,
    submesh,
    terrain,
)
from omnisim.scene.formats.sdf.materials import MaterialReader
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
from omnisim.scene.parts import Instance, Light, LightKind, Mesh
from omnisim.scene.textures import TextureStore

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
        self._shapes: dict[tuple[object, ...], Shape] = {}
        # mesh index and center, keyed by ids of shape or mesh, and material
        self._made: dict[tuple[int, int], tuple[int, Floats]] = {}
        self._instances: list[Instance] = []
        self._lights: list[Light] = []
        self._cameras = Cameras()

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
        )

    def _read_model(self, placed: PlacedModel) -> None:
        for other in placed.model.others:
            if other.element.tag == "light":
                self._read_light(other, self._pose_of(placed, other))
        for link in placed.model.element.children("link"):
            for visual in link.children("visual"):
                name = f"{placed.path}{link.name or 'link'}/{visual.name or 'visual'}"
                self._read_visual(visual, self._pose_of(placed, visual, link.name), name)
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
        if file_from_light is None:
            return
        light = read_light(element, self._world_from_file @ file_from_light, self._omissions)
        if light is not None:
            self._lights.append(light)

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
            key = tuple((one.tag, (one.text or "").strip()) for one in geometry.element.iter())
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

    def _place(self, shape: Shape, material: int, file_from_visual: Floats, name: str) -> None:
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
        for one in instances:
            mesh = file.meshes[one.mesh]
            material = own
            if material is None:
                material = self._materials.of_mesh(file.materials[mesh.material], visual)
            key = id(mesh), material
            if key not in self._made:
                self._made[key] = len(self._meshes), np.zeros(3)
                self._meshes.append(replace(mesh, material=material))
            pose = file_from_visual @ visual_from_file @ one.world_from_mesh
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
    world.others[:] = [with_pose_of(one, lights.get(one.name, one)) for one in world.others]
    for _ in state.children("insertions"):
        omissions.count("insertions of a state are not made", "state")


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
_ATTENUATION = "attenuation of lights is drawn as that of 1/distance², equal at a few meters"


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
