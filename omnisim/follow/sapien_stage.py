"""Stage of a SAPIEN scene: its entities, with their render shapes and lights."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.arrays import Floats
from omnisim.core.errors import SceneError
from omnisim.core.extras import require_extra
from omnisim.core.poses import pose_from_rotation, rotation_type
from omnisim.core.world import Motion, WorldState
from omnisim.follow.body_shapes import Shape, shape_scene
from omnisim.follow.body_stage import BodyStage
from omnisim.rendering.shared_scene import BackendName
from omnisim.scene import primitives
from omnisim.scene.files.load import read_scene
from omnisim.scene.formats.imported_scene import unique_name
from omnisim.scene.light.lighting import DEFAULT_BACKGROUND, DEFAULT_LIGHTING
from omnisim.scene.model import MAX_LIGHTS, Light, Lighting, LightKind, Scene, StartPose
from omnisim.scene.primitives import PrimitiveSurface

_PLANE_M = 500.0  # half the side of an infinite plane
_X_FROM_Z = np.array([(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)])  # SAPIEN's shapes lie
_COLORS = ((0.75, 0.15, 0.1), (0.1, 0.35, 0.7), (0.8, 0.55, 0.1), (0.15, 0.5, 0.2), (0.4, 0.2, 0.6))
_LIGHTS = {
    "RenderDirectionalLightComponent": LightKind.DIRECTIONAL,
    "RenderPointLightComponent": LightKind.POINT,
}


class SapienStage(BodyStage):
    """Stage whose objects are the entities of a SAPIEN 3 scene, as SAPIEN draws them.

    Entities have their own names, links `articulation/link`; of one name the later ones have a
    number. A scene without render bodies, as on a machine without Vulkan, is drawn by its collision
    shapes. Materials are matte.

    Args:
        scene: `sapien.Scene` with its entities; a sequence of them, which are worlds with the same
            entities in the same order; or `env.unwrapped.scene` of ManiSkill, which has several.
        surroundings: what else stands still, and the lights; None: the lights of the scene, or
            those of files without lights.
        device, backend: as for `omnisim.Stage`.

    Raises:
        OmnisimError: SAPIEN is not installed.
        SceneError: nothing to draw.
    """

    def __init__(
        self,
        scene: Any,
        *,
        surroundings: Scene | str | Path | None = None,
        device: int | str | None = None,
        backend: BackendName = "cube",
    ):
        require_extra("sapien", "omnisim.follow.SapienStage")
        scenes = getattr(scene, "sub_scenes", scene)
        self._scenes = tuple(scenes) if isinstance(scenes, Sequence) else (scenes,)
        self._entities = [list(one.entities) for one in self._scenes]
        first, entities = self._scenes[0], self._entities[0]
        for others in self._entities:
            if len(others) != len(entities):
                raise SceneError(
                    f"scenes: expected {len(entities)} entities in each, got {len(others)}"
                )
        used = set[str]()
        names = [unique_name(_name(entity), used, first=2) for entity in entities]
        looks = [_components(entity, "RenderBodyComponent") for entity in entities]
        notices: tuple[str, ...] = ()
        if not any(looks):
            looks = [_components(entity, "PhysxRigidBaseComponent") for entity in entities]
            notices = ("no render bodies in the scene: collision shapes are drawn",)
        robots: dict[str, Scene | str | Path] = {
            name: shape_scene(name, shapes)
            for index, (name, components) in enumerate(zip(names, looks, strict=True))
            if (shapes := [one for each in components for one in _shapes(each, index)])
        }
        if not robots:
            raise SceneError("scene: expected entities with shapes to draw, got none")
        if surroundings is None:
            lighting = _lighting(first)
            sky = DEFAULT_BACKGROUND if lighting is DEFAULT_LIGHTING else (0.0, 0.0, 0.0)
            world = Scene("sapien", (), (), (), lighting, sky, StartPose((0.0, 0.0, 0.0)))
        else:
            world = surroundings if isinstance(surroundings, Scene) else read_scene(surroundings)
        super().__init__(
            replace(world, notices=(*world.notices, *notices)) if notices else world, robots,
            names=names, device=device, backend=backend,
        )  # fmt: skip
        self._rest.clear()  # the order of quaternions is known

    def now(self, time_s: float = 0.0) -> WorldState:
        """State of the scene, or of the first one; SAPIEN does not tell its time.

        Raises:
            OmnisimError: an entity has a pose that is not finite.
        """
        self._sync()
        return self.state(self._poses_of(0), time_s=time_s)

    def worlds_now(self, time_s: float = 0.0) -> list[WorldState]:
        """States of all scenes.

        Raises:
            OmnisimError: as for `now`.
        """
        self._sync()
        worlds = [self._poses_of(world) for world in range(len(self._scenes))]
        return self.states(np.array(worlds), time_s=time_s)

    def motion_now(self, time_s: float = 0.0) -> Motion:
        """Motion of the scene, or of the first one, by its current velocities.

        Raises:
            OmnisimError: as for `now`.
        """
        self._sync()
        poses = self._poses_of(0)
        linear, angular, arms = np.zeros((3, len(poses), 3))
        for index, entity in enumerate(self._entities[0]):
            for body in _components(entity, "PhysxRigidBodyComponent"):
                linear[index], angular[index] = body.linear_velocity, body.angular_velocity
                arms[index] = body.cmass_local_pose.p
        turns = rotation_type().from_quat(poses[:, [4, 5, 6, 3]])
        linear -= np.cross(angular, turns.apply(arms))  # those of the centers of mass
        return self.motion(poses, linear=linear, angular=angular, time_s=time_s)

    def _sync(self) -> None:
        """Take the poses of a simulation on a GPU, which all scenes share."""
        system = self._scenes[0].physx_system
        if hasattr(system, "sync_poses_gpu_to_cpu"):
            system.sync_poses_gpu_to_cpu()
        self._warn_of_added(len(self._scenes[0].entities) - len(self.names))

    def _poses_of(self, world: int) -> Floats:
        """Poses (entities, 7), wxyz, of a scene."""
        poses = [entity.pose for entity in self._entities[world]]
        return np.array([(*pose.p, *pose.q) for pose in poses], dtype=np.float64)


def _components(entity: Any, kind: str) -> list[Any]:
    """Components of an entity of a class of SAPIEN, or of one that is derived from it."""
    return [
        component
        for component in entity.components
        if any(one.__name__ == kind for one in type(component).__mro__)
    ]


def _name(entity: Any) -> str:
    for link in _components(entity, "PhysxArticulationLinkComponent"):
        return f"{link.articulation.name or 'articulation'}/{entity.name or link.name}"
    return entity.name or "entity"


def _shapes(component: Any, index: int) -> Iterator[Shape]:
    """Shapes of a render body; or those of a rigid body that collide, in colors by its index."""
    is_look = hasattr(component, "render_shapes")
    plain = _COLORS[index % len(_COLORS)]
    if getattr(component, "visibility", 1.0) == 0.0:
        return
    for shape in component.render_shapes if is_look else component.collision_shapes:
        kind = type(shape).__name__.partition("Shape")[2]
        pose = _matrix(shape.local_pose)
        name = (is_look and shape.name) or kind.lower()
        if kind in ("TriangleMesh", "ConvexMesh"):
            for part in shape.parts if is_look else [shape]:
                mesh = _mesh(part, shape.scale, pose, name)
                yield mesh if is_look else replace(mesh, color=plain)
            continue
        scale, surface = _primitive(shape, kind)
        material = shape.material if is_look else None
        if material is not None and material.base_color_texture is not None:
            yield _mesh(shape, scale, pose, name)
        else:
            color = None if kind == "Plane" else plain
            if material is not None:
                color = np.clip(material.base_color, 0.0, 1.0)
            yield Shape(surface, pose, color, double_sided=kind == "Plane", name=name)


def _primitive(shape: Any, kind: str) -> tuple[ArrayLike, PrimitiveSurface]:
    """Scale of SAPIEN's coarse triangles of a primitive, and our fine ones."""
    match kind:
        case "Box":
            return shape.half_size, primitives.box(shape.half_size)
        case "Sphere":
            return (shape.radius,) * 3, primitives.ellipsoid((shape.radius,) * 3)
        case "Plane":
            scale = getattr(shape, "scale", (1.0, _PLANE_M, _PLANE_M))
            return scale, _along_x(primitives.rectangle(float(scale[2]), float(scale[1])))
        case "Capsule":
            return (1.0,) * 3, _along_x(primitives.capsule(shape.radius, shape.half_length))
        case "Cylinder":
            sizes = (shape.half_length, shape.radius, shape.radius)
            return sizes, _along_x(primitives.cylinder(shape.radius, shape.half_length))
    raise SceneError(f"shape {kind!r}: expected one of SAPIEN 3")


def _along_x(surface: PrimitiveSurface) -> PrimitiveSurface:
    """Surface around the x axis, of one around the z axis."""
    normals = None if surface.normals is None else surface.normals @ _X_FROM_Z.T
    return surface._replace(positions=surface.positions @ _X_FROM_Z.T, normals=normals)


def _mesh(part: Any, scale: ArrayLike, pose: Floats, name: str) -> Shape:
    """Triangles of SAPIEN at a scale, with their material if they have one."""
    scale = np.asarray(scale, np.float64)
    triangles = part.triangles if np.prod(scale) > 0.0 else part.triangles[:, ::-1]
    material = getattr(part, "material", None)
    if material is None:
        return Shape((part.vertices * scale, triangles, None), pose, None, None, None, True, name)
    normals, uv = _attribute(part.get_vertex_normal), _attribute(part.get_vertex_uv)
    if normals is not None:
        normals = normals / scale
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    image, pixels = material.base_color_texture, None
    if image is not None and uv is not None:
        pixels = np.asarray(image.download())
        if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[2] < 3:
            pixels = None  # of numbers, or gray
    surface = part.vertices * scale, triangles, normals
    color = np.clip(material.base_color, 0.0, 1.0)
    return Shape(surface, pose, color, uv, pixels, True, name)


def _attribute(read: Callable[[], Any]) -> Any:
    """Numbers of each vertex, or None where a mesh has none."""
    try:
        return read()
    except RuntimeError:
        return None


def _matrix(pose: Any) -> Floats:
    turn = rotation_type().from_quat(np.asarray(pose.q, np.float64)[[1, 2, 3, 0]])
    return pose_from_rotation(turn.as_matrix(), pose.p)


def _lighting(scene: Any) -> Lighting:
    """Lights of a scene; those of files without lights where it has none.

    Source: SAPIEN's default shader, in which light of color 1 leaves a white surface with 1/π.
    """
    try:
        system = scene.render_system
    except RuntimeError:  # a scene without
        return DEFAULT_LIGHTING
    lights = []
    for light in system.lights:
        kind, brightness = _LIGHTS.get(type(light).__name__), float(np.max(light.color))
        if kind is None or brightness <= 0.0:
            continue
        pose = _matrix(light.global_pose)
        red, green, blue = (np.asarray(light.color, np.float64) / brightness).tolist()
        lights.append(
            Light(
                kind, (red, green, blue), brightness / math.pi, pose[:3, 3], pose[:3, 0],
                casts_shadow=light.shadow,
            )
        )  # fmt: skip
    red, green, blue = np.asarray(system.ambient_light, np.float64).tolist()
    if not lights and max(red, green, blue) == 0.0:
        return DEFAULT_LIGHTING
    return Lighting((red, green, blue), tuple(lights[:MAX_LIGHTS]), is_matte=True)
