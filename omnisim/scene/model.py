"""Scene as plain data in the world frame, free of files and of the GPU."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from omnisim.ground_truth.boxes_3d import OrientedBox
from omnisim.scene.instance_boxes import instance_boxes
from omnisim.scene.parts import (
    MAX_LIGHTS,
    SLIM_M,
    AlphaMode,
    ColorBand,
    Instance,
    LabelRule,
    Landmark,
    Light,
    Lighting,
    LightKind,
    Material,
    Mesh,
    NamedStart,
    ScenePath,
    StartPose,
    Texture,
    Wrap,
    bounds_m,
)
from omnisim.short_repr import counted, short_repr

__all__ = [
    "MAX_LIGHTS",
    "SLIM_M",
    "AlphaMode",
    "ColorBand",
    "Instance",
    "LabelRule",
    "Landmark",
    "Light",
    "LightKind",
    "Lighting",
    "Material",
    "Mesh",
    "NamedStart",
    "Scene",
    "ScenePath",
    "StartPose",
    "Texture",
    "Wrap",
    "bounds_m",
]


@dataclass(frozen=True, eq=False)
class Scene:
    """Meshes, materials, instances and lights, and where vehicles may be.

    Attributes:
        name: file or built-in name.
        meshes, materials, instances: geometry and its appearance.
        lighting: ambient light and lights.
        background: linear RGB where nothing is hit.
        start: default pose of the camera.
        notices: one line for each feature of the file that is not drawn.
        starts: start poses of vehicles; names are distinct.
        paths: routes of vehicles; names are distinct.
        landmarks: names are distinct.
        labels: class rules, the first that matches a name has it; without any: by names.
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

    def __repr__(self) -> str:
        return short_repr(
            self,
            repr(self.name),
            counted(len(self.instances), "instance"),
            counted(self.triangle_count, "triangle"),
            counted(len(self.lighting.lights), "light"),
            counted(len(self.landmarks), "landmark"),
            counted(len(self.starts), "start"),
            counted(len(self.paths), "path"),
        )

    @property
    def triangle_count(self) -> int:
        """Number of triangles of all instances."""
        return sum(len(self.meshes[instance.mesh].triangles) for instance in self.instances)

    @cached_property
    def instance_boxes(self) -> dict[str, OrientedBox]:
        """Oriented boxes of the instances by name, along the axes of their own meshes."""
        return instance_boxes(self.instances, self.meshes)

    def bounds_m(self) -> NDArray[np.float64]:
        """Smallest and largest corner (2, 3) of all instances in the world."""
        return bounds_m(self.meshes, self.instances)
