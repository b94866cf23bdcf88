"""Mesh files of all formats but glTF, through trimesh."""

from __future__ import annotations

import io
import logging
from collections.abc import Iterator, Mapping
from pathlib import Path

import trimesh
from trimesh.resolvers import Resolver

from omnisim.errors import SceneError
from omnisim.scene.asset_resolver import AssetResolver

# trimesh also reads paths without surfaces, voxels, and archives of files.
_NOT_SCENES = {"dxf", "svg", "binvox", "zip", "tar.gz", "tar.bz2", "tgz", "bz2", "gz"}
# What it would write to standard error is said by errors and notices.
logging.getLogger("trimesh").addHandler(logging.NullHandler())


class _Resolver(Resolver):
    """Our asset resolver as trimesh wants it, with files that are given beforehand."""

    def __init__(self, path: Path, assets: AssetResolver, given: Mapping[str, bytes]):
        self.file_name = path.name  # names the meshes of an OBJ
        self._assets, self._given = assets, given

    def get(self, name: str) -> bytes:
        return self._given[name] if name in self._given else self._assets.read(name)

    def write(self, name: str, data: object) -> None:
        raise NotImplementedError

    def namespaced(self, namespace: str) -> _Resolver:
        raise NotImplementedError

    def keys(self) -> Iterator[str]:
        return iter(self._given)


def check_format(path: Path) -> None:
    """Check that trimesh reads surfaces from files with the suffix of `path`.

    Raises:
        SceneError: it does not.
    """
    if path.suffix.lower()[1:] not in set(trimesh.available_formats()) - _NOT_SCENES:
        raise SceneError(
            f"{path}: unknown scene format: expected .glb .gltf .obj .ply .stl .dae, or a scene's "
            f".toml, got {path.suffix or '(no suffix)'!r}"
        )


def load_with_trimesh(
    path: Path, data: bytes, assets: AssetResolver, given: Mapping[str, bytes]
) -> trimesh.Scene:
    """Scene that trimesh reads from a file's content.

    Args:
        path: of the file.
        data: its content.
        assets: finds the files that it refers to.
        given: content of such files that need not be found, by name.

    Raises:
        SceneError: it cannot be read.
    """
    kind = path.suffix[1:].lower()
    try:
        return trimesh.load_scene(
            io.BytesIO(data), file_type=kind, resolver=_Resolver(path, assets, given), process=False
        )
    except Exception as reason:  # a damaged file can make trimesh's readers fail in any way
        words = f"{' '.join(str(reason).split())[:200]} ({type(reason).__name__})"
        if isinstance(reason, ImportError):  # trimesh guesses encodings with a library of its own
            words = "it is not text, and not its binary form either"
        missing = f"{assets.missing[-1]} is not there; " if assets.missing else ""
        raise SceneError(f"cannot be read as {kind}: {missing}{words}") from None
