"""Shapes that a simulator makes without a file: boxes, spheres, meshes in memory."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.arrays import Floats
from omnisim.scene.editing import import_arrays, instance_pose
from omnisim.scene.formats.imported_scene import unique_name
from omnisim.scene.light.lighting import DEFAULT_BACKGROUND, DEFAULT_LIGHTING
from omnisim.scene.model import Scene
from omnisim.scene.parts import Instance, Material, Mesh, StartPose
from omnisim.scene.primitives import PrimitiveSurface, grid_triangles

_ORIGIN = StartPose((0.0, 0.0, 0.0))


@dataclass(frozen=True, eq=False)
class Shape:
    """Visual shape of a body.

    `surface` is (positions (n, 3), triangles (m, 3), normals (n, 3) or None), in meters, as
    `omnisim.scene.primitives` makes them of boxes, ellipsoids, cylinders and capsules.
    """

    surface: tuple[ArrayLike, ArrayLike, ArrayLike | None]
    body_from_shape: Floats = field(default_factory=lambda: np.eye(4))  # (4, 4)
    color: ArrayLike | None = None  # linear RGB or RGBA; None: light gray, or white with a texture
    uv: ArrayLike | None = None  # (n, 2), (0, 0) at the top left of the texture
    texture: ArrayLike | None = None  # (height, width, 3 or 4) uint8 sRGB
    double_sided: bool = False
    name: str = "shape"  # instances are named body/name


def shape_scene(body: str, shapes: Iterable[Shape]) -> Scene:
    """Scene of a body's shapes, in its frame, for `BodyStage`; body "" is what stands still.

    Raises:
        SceneError: arrays that `Scene.from_arrays` refuses, or an invalid pose.
    """
    meshes: list[Mesh] = []
    materials: list[Material] = []
    instances: list[Instance] = []
    names: set[str] = set()
    for shape in shapes:
        name = unique_name(f"{body}/{shape.name}".lstrip("/"), names, first=2)
        positions, triangles, normals = shape.surface
        read = import_arrays(
            name, positions, triangles, normals, shape.uv, None, shape.texture, shape.color,
            shape.double_sided,
        )  # fmt: skip
        pose = instance_pose(name, shape.body_from_shape)
        place = pose @ read.instances[0].world_from_mesh
        instances.append(Instance(name, len(meshes), place, pose))
        meshes.append(replace(read.meshes[0], material=len(materials)))
        materials += read.materials
    return Scene(
        body, tuple(meshes), tuple(materials), tuple(instances),
        DEFAULT_LIGHTING, DEFAULT_BACKGROUND, _ORIGIN,
    )  # fmt: skip


def height_field(heights_m: ArrayLike, half_x_m: float, half_y_m: float) -> PrimitiveSurface:
    """Surface over a rectangle around the origin, from heights (rows, columns); rows along y."""
    heights = np.asarray(heights_m, dtype=np.float64)
    rows, columns = heights.shape
    x, y = np.linspace(-half_x_m, half_x_m, columns), np.linspace(-half_y_m, half_y_m, rows)
    positions = np.stack((*np.meshgrid(x, y), heights), axis=-1).reshape(-1, 3)
    return PrimitiveSurface(positions, grid_triangles(rows, columns), None)
