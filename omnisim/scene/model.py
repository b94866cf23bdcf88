"""Scene as plain data in the world frame, independent of files and of the GPU."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.arrays import Floats
from omnisim.core.files.sources import NOT_IDENTITY, fingerprint
from omnisim.core.poses import proper_rotation
from omnisim.core.short_repr import counted, short_repr
from omnisim.ground_truth.boxes import OrientedBox
from omnisim.scene import editing
from omnisim.scene.editing import import_arrays
from omnisim.scene.formats.imported_scene import ImportedScene, place, world_from_axes
from omnisim.scene.identity import SourceDigests, light_of_arrays
from omnisim.scene.light.lighting import DEFAULT_BACKGROUND, expose, is_even
from omnisim.scene.motion.object_motion import ObjectMotion
from omnisim.scene.parts import (
    LAMP_NEAR_M,
    MAX_LIGHTS,
    SLIM_M,
    AlphaMode,
    CameraPose,
    ColorBand,
    Fog,
    Instance,
    LabelRule,
    Landmark,
    Light,
    Lighting,
    LightKind,
    Link,
    Material,
    Mesh,
    NamedStart,
    ScenePath,
    StartPose,
    Texture,
    Wrap,
    bounds_m,
)
from omnisim.scene.slabs import with_slabs
from omnisim.scene.space.start_pose import find_start

__all__ = [
    "LAMP_NEAR_M", "MAX_LIGHTS", "SLIM_M", "AlphaMode", "CameraPose", "ColorBand", "Fog",
    "Instance", "LabelRule", "Landmark", "Light", "LightKind", "Lighting", "Link", "Material",
    "Mesh", "NamedStart", "Scene", "ScenePath", "StartPose", "Texture", "Wrap", "bounds_m",
]  # fmt: skip


@dataclass(frozen=True, eq=False)
class DynamicObject:
    """Object whose pose is a function of world time."""

    name: str  # name, unique within the scene
    shape: Scene  # geometry in the object's own frame; its lights and background are ignored
    motion: ObjectMotion  # pose of that frame in the world over time

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name), type(self.motion).__name__)


@dataclass(frozen=True, eq=False)
class Scene:
    """Meshes, materials, instances, lights, and the start poses and paths of vehicles.

    A scene is immutable: `added`, `removed`, `moved` and `recolored` return a new scene that shares
    all unchanged data. An open renderer draws it as soon as it is assigned to `scene`.

    Attributes:
        name: file name or built-in name.
        meshes, materials, instances: geometry and its appearance.
        lighting: ambient light and lights.
        background: linear RGB of rays without a hit.
        start: default camera pose.
        notices: one line for each feature of the file that is not rendered.
        cameras: camera poses of the file, with unique names.
        starts: vehicle start poses, with unique names.
        paths: vehicle routes, with unique names.
        landmarks: landmarks, with unique names.
        labels: class rules, of which the first match decides; empty: classes from instance names.
        objects: dynamic objects, with unique names.
        links: rigid parts of the file's robots and models; a simulator may move them.
        given: digests of the sources of a loaded scene and of its edits; see `identity`.
    """

    name: str
    meshes: tuple[Mesh, ...]
    materials: tuple[Material, ...]
    instances: tuple[Instance, ...]
    lighting: Lighting
    background: tuple[float, float, float]
    start: StartPose
    notices: tuple[str, ...] = ()
    starts: tuple[NamedStart, ...] = ()
    paths: tuple[ScenePath, ...] = ()
    landmarks: tuple[Landmark, ...] = ()
    labels: tuple[LabelRule, ...] = ()
    objects: tuple[DynamicObject, ...] = ()
    cameras: tuple[CameraPose, ...] = ()
    links: tuple[Link, ...] = field(default=(), metadata=NOT_IDENTITY)
    given: SourceDigests | None = field(default=None, init=False)

    @property
    def identity(self) -> SourceDigests:
        """Digests of the files, options and edits that the scene was made from; else of its arrays.

        A copy by `dataclasses.replace` is identified by its arrays.
        """
        return self.given or SourceDigests(fingerprint(self), self.light_of_arrays)

    @property
    def light_of_arrays(self) -> str:
        """Digest (64 hexadecimal digits) of the arrays on which baked light depends.

        Those of a loaded scene may differ in their last bits on another machine.
        """
        return light_of_arrays(
            self.meshes, self.materials, self.instances, self.lighting, self.background
        )

    def __post_init__(self) -> None:
        meshes, materials = with_slabs(self.meshes, self.materials, self.instances)
        object.__setattr__(self, "meshes", meshes)
        object.__setattr__(self, "materials", materials)

    def __repr__(self) -> str:
        return short_repr(
            self,
            repr(self.name),
            counted(len(self.instances), "instance"),
            counted(self.triangle_count, "triangle"),
            self._short_light,
            counted(len(self.landmarks), "landmark"),
            counted(len(self.starts), "start"),
            counted(len(self.paths), "path"),
            counted(len(self.objects), "dynamic object") if self.objects else "",
        )

    @property
    def _short_light(self) -> str:
        lights, is_baked = self.lighting.lights, self.lighting.baked is not None
        if is_even(self.lighting) or (is_baked and not lights):
            return "baked light" if is_baked else "even light"
        return counted(len(lights), "light")

    @property
    def triangle_count(self) -> int:
        """Number of triangles, summed over all instances."""
        return sum(len(self.meshes[instance.mesh].triangles) for instance in self.instances)

    @cached_property
    def instance_boxes(self) -> dict[str, OrientedBox]:
        """Oriented boxes of the instances by name, aligned with their own frames, at 0 s."""
        return _boxes(self.instances, self.meshes)

    @cached_property
    def deforms(self) -> bool:
        """True if any instance has a mesh that deforms over time."""
        return any(
            self.meshes[instance.mesh].deformation is not None for instance in self.instances
        )

    def boxes_at(self, time_s: float) -> dict[str, OrientedBox]:
        """Oriented boxes of the instances, like `instance_boxes`, at a world time."""
        if not self.deforms or time_s == 0.0:
            return self.instance_boxes
        is_rigid = [mesh.deformation is None for mesh in self.meshes]
        names = {instance.name for instance in self.instances if not is_rigid[instance.mesh]}
        deforming = [instance for instance in self.instances if instance.name in names]
        return self.instance_boxes | _boxes(deforming, self.meshes, time_s)

    @property
    def instance_names(self) -> tuple[str, ...]:
        """Unique names of the instances; all parts with one name form one instance."""
        return tuple(dict.fromkeys(instance.name for instance in self.instances))

    def bounds_m(self, name: str | None = None) -> Floats:
        """Smallest and largest corner (2, 3) of all instances, or of one, world frame, m.

        Without instances: the bounds of the dynamic objects at 0 s.

        Raises:
            SceneError: unknown instance.
        """
        if name is None and not self.instances:
            return bounds_m(self._still.meshes, self._still.instances)
        instances = self.instances if name is None else editing.find(self._content, name)
        return bounds_m(self.meshes, instances)

    def pose_of(self, name: str) -> Floats:
        """Pose (4, 4) world_from_instance of an instance's frame.

        The frame is that of the instance's node, which is z up unless the node is rotated. An added
        instance keeps the frame of the added scene.

        Raises:
            SceneError: unknown instance.
        """
        return editing.pose_of(self._content, name)

    def added(self, name: str, part: Scene, world_from_part: ArrayLike | None = None) -> Scene:
        """Scene with another scene added as one instance.

        Args:
            name: name of the new instance, not yet in the scene.
            part: added scene: its instances, and its dynamic objects posed as at 0 s. Its lights,
                background, starts, paths and landmarks are ignored.
            world_from_part: (4, 4) pose; None: identity, as in its own scene.

        Raises:
            SceneError: an existing name or an invalid pose.
        """
        pose = np.eye(4) if world_from_part is None else world_from_part
        content = editing.add(self._content, name, part._still, pose)
        return self.altered("added", name, part, pose, **content._asdict())

    def at_start(self) -> Scene:
        """Scene whose dynamic objects are static instances, posed as at 0 s."""
        if not self.objects:
            return self
        return self.altered("at start", objects=(), **self._still._asdict())

    def removed(self, name: str) -> Scene:
        """Scene without an instance.

        Raises:
            SceneError: unknown instance.
        """
        content = editing.remove(self._content, name)
        return self.altered("removed", name, **content._asdict())

    def moved(self, name: str, world_from_instance: ArrayLike) -> Scene:
        """Scene with an instance moved to another pose (4, 4), see `pose_of`; its scale is kept.

        Raises:
            SceneError: an unknown instance or an invalid pose.
        """
        content = editing.move(self._content, name, world_from_instance)
        return self.altered("moved", name, world_from_instance, **content._asdict())

    def recolored(
        self, name: str, base_color: ArrayLike = (1.0, 1.0, 1.0), texture: ArrayLike | None = None
    ) -> Scene:
        """Scene in which one color, or one texture, replaces an instance's appearance.

        Args:
            name: instance name.
            base_color: linear RGB or RGBA from 0 to 1; it multiplies the texture.
            texture: (height, width, 3 or 4) uint8 sRGB, for a mesh with texture coordinates.

        Raises:
            SceneError: an unknown instance, or an invalid color or texture.
        """
        content = editing.recolor(self._content, name, base_color, texture)
        return self.altered("recolored", name, base_color, texture, **content._asdict())

    @classmethod
    def from_arrays(
        cls,
        name: str,
        vertices_m: ArrayLike,
        triangles: ArrayLike,
        *,
        normals: ArrayLike | None = None,
        uv: ArrayLike | None = None,
        colors: ArrayLike | None = None,
        texture: ArrayLike | None = None,
        base_color: ArrayLike | None = None,
        double_sided: bool = True,
    ) -> Scene:
        """Scene with one instance built from arrays, in daylight; `added` joins several.

        Args:
            name: name of the instance and of the scene.
            vertices_m: (n, 3), m, z up.
            triangles: (m, 3) vertex indices, counter-clockwise seen from the front.
            normals: (n, 3) vertex normals; None: flat shading.
            uv: (n, 2) texture coordinates, (0, 0) at the top left of the texture, as in glTF.
            colors: (n, 3 or 4) vertex colors: sRGB if uint8, linear if numbers from 0 to 1.
            texture: (height, width, 3 or 4) uint8 sRGB; it repeats beyond its edges.
            base_color: linear RGB or RGBA from 0 to 1, multiplied with the colors and the texture;
                None: white, or light gray without colors and texture.
            double_sided: render both sides of each triangle; False is faster.

        Raises:
            SceneError: an array with a wrong shape, with NaN or with values out of range.
        """
        imported = import_arrays(
            name, vertices_m, triangles, normals, uv, colors, texture, base_color, double_sided
        )
        return cls._of(name, imported, imported.instances)

    @classmethod
    def from_trimesh(
        cls,
        source: object,
        name: str = "trimesh",
        *,
        up_axis: str = "z",
        meters_per_unit: float | None = None,
        smooth: bool | None = None,
    ) -> Scene:
        """Scene of a `trimesh.Scene` or `trimesh.Trimesh`, with materials, textures and instances.

        Its cameras and lights are ignored: the scene is in daylight. Colors and textures are sRGB;
        only the base color of a `PBRMaterial` is linear. Nodes of the graph become instances.

        Args:
            source: trimesh object, left unchanged; a single mesh becomes an instance named `name`.
            name: scene name.
            up_axis: "x", "y" or "z". trimesh rotates nothing: a scene loaded from glTF is "y".
            meters_per_unit: scale; None: from its `units`, or 1 without units.
            smooth: True: vertex normals; False: flat shading; None: vertex normals if the mesh was
                given them or has computed them.

        Raises:
            SceneError: another type, no geometry, invalid numbers or an unknown unit.
        """
        from omnisim.scene.formats.mesh.other_formats import read_trimesh  # slow to import

        imported, units = read_trimesh(source, name, smooth)
        axes = world_from_axes(up_axis, units if meters_per_unit is None else meters_per_unit)
        return cls._of(name, imported, place(imported, axes))

    @classmethod
    def _of(cls, name: str, read: ImportedScene, instances: tuple[Instance, ...]) -> Scene:
        return cls(
            name=name,
            meshes=read.meshes,
            materials=read.materials,
            instances=instances,
            lighting=expose(read.lights, read.meshes, instances),
            background=DEFAULT_BACKGROUND,
            start=find_start(read.meshes, instances),
            notices=tuple(read.notices),
        )

    @property
    def _content(self) -> editing.Content:
        return editing.Content(self.meshes, self.materials, self.instances)

    @property
    def _still(self) -> editing.Content:
        """Content in which the dynamic objects are instances, posed as at 0 s."""
        content = self._content
        for moving in self.objects:
            name = editing.free_name(content, moving.name)
            content = editing.add(content, name, moving.shape._content, moving.motion.pose_at(0.0))
        return content

    def altered(self, *change: object, **fields: Any) -> Scene:
        """Scene with some fields replaced, identified as this one after a change.

        Args:
            change: text, numbers, arrays and scenes that determine the new values; none: the
                identity stays the same.
            fields: new values by field name, as for `dataclasses.replace`.
        """
        scene = replace(self, **fields)
        if self.given is None:  # identified by its arrays
            return scene
        return scene.identified(self.given.edited(*change) if change else self.given)

    def identified(self, given: SourceDigests) -> Scene:
        """Same scene, identified by the digests of its sources."""
        scene = copy.copy(self)
        object.__setattr__(scene, "given", given)
        return scene


def _boxes(
    instances: Sequence[Instance], meshes: Sequence[Mesh], time_s: float = 0.0
) -> dict[str, OrientedBox]:
    """Boxes by instance name at a world time, in the frame in which the instances are placed.

    All parts with one name share one box, which bounds them along the axes of the instance's frame,
    see `Scene.pose_of`.
    """
    parts: dict[str, list[Floats]] = {}
    axes: dict[str, Floats] = {}
    for instance in instances:
        mesh, matrix = meshes[instance.mesh], instance.world_from_mesh
        used = np.unique(mesh.triangles).astype(np.intp)
        points = mesh.positions[used].astype(np.float64)
        if mesh.deformation is not None:
            points = mesh.deformation.positions_at(time_s, used)
        points_m = points @ matrix[:3, :3].T + matrix[:3, 3]
        parts.setdefault(instance.name, []).append(points_m)
        axes.setdefault(instance.name, instance.world_from_node[:3, :3])
    boxes = {}
    for name, of_name in parts.items():
        points_m = np.concatenate(of_name)
        if len(points_m):
            boxes[name] = OrientedBox.of_points(points_m, proper_rotation(axes[name]))
    return boxes
