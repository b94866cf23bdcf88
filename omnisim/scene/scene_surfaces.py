"""Surfaces of a scene and its dynamic objects, and those of them that planar mirrors hold."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.model import Material, Mesh, Scene
from omnisim.scene.planar_mirrors import MirrorPlane


class SceneSurface(NamedTuple):
    """Instance of a mesh, see `ShownSurface`."""

    mesh: Mesh
    material: Material
    object_from_mesh: NDArray[np.float64]
    object_index: int | None


def scene_surfaces(scene: Scene, objects: Iterable[Scene]) -> dict[int, SceneSurface]:
    """Surfaces of a scene, then those of dynamic objects, by their number.

    Args:
        scene: static scene.
        objects: shapes of the dynamic objects.
    """
    shapes = [(None, scene), *enumerate(objects)]
    surfaces = [
        SceneSurface(
            shape.meshes[one.mesh],
            shape.materials[shape.meshes[one.mesh].material],
            one.world_from_mesh,
            index,
        )
        for index, shape in shapes
        for one in shape.instances
    ]
    return dict(enumerate(surfaces))


def is_surface_planar(number: int, planes: Sequence[MirrorPlane]) -> bool:
    """True if planar mirrors hold all triangles of a surface."""
    masks = [plane.parts[number] for plane in planes if number in plane.parts]
    return bool(masks) and bool(np.any(masks, axis=0).all())
