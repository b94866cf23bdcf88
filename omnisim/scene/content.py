"""What a mesh file holds, as the readers of the formats hand it on."""

from __future__ import annotations

from typing import NamedTuple

from omnisim.scene.model import Instance, Light, Material, Mesh


class Content(NamedTuple):
    """Instances still in the file's axes and units (`world_from_mesh` is file_from_mesh); lights
    in the world."""  # fmt: skip

    meshes: tuple[Mesh, ...]
    materials: tuple[Material, ...]
    instances: tuple[Instance, ...]
    notices: list[str]
    lights: tuple[Light, ...] = ()
