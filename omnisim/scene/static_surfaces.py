"""Static surfaces of a scene, and those of them that planar mirrors hold."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.model import Material, Mesh, Scene
from omnisim.scene.planar_mirrors import MirrorPlane


class StaticSurface(NamedTuple):
    """Instance of a static mesh, see `ShownSurface`."""

    mesh: Mesh
    material: Material
    object_from_mesh: NDArray[np.float64]
    object_index: None = None


def shown_surfaces(scene: Scene) -> dict[int, StaticSurface]:
    """Static surfaces by the index of their instance."""
    return {
        number: StaticSurface(
            scene.meshes[one.mesh],
            scene.materials[scene.meshes[one.mesh].material],
            one.world_from_mesh,
        )
        for number, one in enumerate(scene.instances)
    }


def is_surface_planar(number: int, planes: Sequence[MirrorPlane]) -> bool:
    """True if planar mirrors hold all triangles of a surface."""
    masks = [plane.parts[number] for plane in planes if number in plane.parts]
    return bool(masks) and bool(np.any(masks, axis=0).all())
