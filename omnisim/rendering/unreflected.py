"""Notices on reflective and transmissive materials, for back ends without reflections."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.short_repr import counted
from omnisim.scene import Scene
from omnisim.scene.model import Material, Mesh
from omnisim.scene.planar_mirrors import MirrorPlane, find_mirrors, is_smooth
from omnisim.scene.surface_reflectance import MAX_TRACED_ROUGHNESS, MIN_ROUGHNESS


def reflection_notes(scene: Scene) -> list[str]:
    """Notices on materials that reflect or transmit the scene with `--backend rays` only."""
    if scene.lighting.is_matte:
        return []
    surfaces = {
        number: _Surface(
            scene.meshes[one.mesh],
            scene.materials[scene.meshes[one.mesh].material],
            one.world_from_mesh,
        )
        for number, one in enumerate(scene.instances)
    }
    planes = find_mirrors(surfaces, MIN_ROUGHNESS)
    materials = {id(one.material): one.material for one in surfaces.values()}
    unreflected = {
        id(one.material)
        for number, one in surfaces.items()
        if reflects_scene(one.material) and not _is_planar(number, planes)
    }
    mirrors = len(unreflected)
    panes = sum(one.transmission > 0.0 and not one.unlit for one in materials.values())
    notes = {
        f"reflections show the sky and lamps, not the scene ({counted(mirrors, 'material')}): "
        "--backend rays shows it": mirrors,
        f"panes are opaque ({counted(panes, 'material')}): "
        "--backend rays shows what is behind them": panes,
    }
    return [note for note, count in notes.items() if count]


class _Surface(NamedTuple):
    """Instance of a static mesh, see `ShownSurface`."""

    mesh: Mesh
    material: Material
    object_from_mesh: NDArray[np.float64]
    object_index: None = None


def _is_planar(number: int, planes: Sequence[MirrorPlane]) -> bool:
    """True if planar mirrors show all triangles of a surface."""
    masks = [plane.parts[number] for plane in planes if number in plane.parts]
    return bool(masks) and bool(np.any(masks, axis=0).all())


def reflects_scene(material: Material) -> bool:
    """True if the ray back end traces reflections: smooth metal, gloss or clear coat."""
    return is_smooth(material, MAX_TRACED_ROUGHNESS)
