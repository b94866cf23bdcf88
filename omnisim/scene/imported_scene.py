"""What a mesh file holds, as the readers of the formats hand it on."""

from __future__ import annotations

import io
from pathlib import Path
from typing import NamedTuple

import trimesh

from omnisim.errors import SceneError
from omnisim.scene.asset_resolver import AssetResolver
from omnisim.scene.model import Instance, Light, Material, Mesh


class ImportedScene(NamedTuple):
    """Instances still in the file's axes and units (`world_from_mesh` is file_from_mesh); lights
    in the world."""  # fmt: skip

    meshes: tuple[Mesh, ...]
    materials: tuple[Material, ...]
    instances: tuple[Instance, ...]
    notices: list[str]
    lights: tuple[Light, ...] = ()


def load_with_trimesh(path: Path, data: bytes, resolver: AssetResolver) -> trimesh.Scene:
    """What trimesh makes of a file's bytes.

    Raises:
        SceneError: it cannot make anything of them.
    """
    kind = path.suffix[1:].lower()
    try:
        return trimesh.load_scene(
            io.BytesIO(data), file_type=kind, resolver=resolver, process=False
        )
    except Exception as reason:  # a damaged file can make trimesh's readers fail in any way
        words = f"{' '.join(str(reason).split())[:200]} ({type(reason).__name__})"
        if isinstance(reason, ImportError):  # trimesh guesses encodings with a library of its own
            words = "it is not text, and not its binary form either"
        missing = f"{resolver.missing[-1]} is not there; " if resolver.missing else ""
        raise SceneError(f"cannot be read as {kind}: {missing}{words}") from None
