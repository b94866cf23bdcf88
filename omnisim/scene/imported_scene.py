"""Contents of a mesh file, before they are placed in the world."""

from __future__ import annotations

from typing import NamedTuple

from omnisim.scene.model import Instance, Light, Material, Mesh


class ImportedScene(NamedTuple):
    """Contents of a mesh file.

    Attributes:
        meshes, materials: as in the scene.
        instances: `world_from_mesh` is still file_from_mesh, in the file's axes and unit.
        notices: one line for each feature that is not drawn.
        lights: in the world frame.
    """

    meshes: tuple[Mesh, ...]
    materials: tuple[Material, ...]
    instances: tuple[Instance, ...]
    notices: list[str]
    lights: tuple[Light, ...] = ()
