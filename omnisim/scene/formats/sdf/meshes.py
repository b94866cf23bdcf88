"""Mesh files of visuals, each read only once."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from omnisim.core.errors import SceneError
from omnisim.core.files.sources import read_source
from omnisim.core.short_repr import counted
from omnisim.scene.files.asset_resolver import AssetResolver
from omnisim.scene.files.file_axes import FileAxes, world_from_file
from omnisim.scene.files.imported_scene import material_notices
from omnisim.scene.formats.gltf.animations import NO_ANIMATION, AnimationChoice
from omnisim.scene.formats.gltf.reader import read_gltf
from omnisim.scene.formats.mesh.other_formats import check_format, read_other
from omnisim.scene.parts import Instance, Material, Mesh
from omnisim.scene.textures import TextureStore

_GLTF = {".glb", ".gltf"}
_COLLADA = {".dae", ".zae"}
_TEXTURE_FOLDERS = ("../materials/textures", "materials/textures", "../textures")


class MeshFile(NamedTuple):
    """Contents of a mesh file.

    Attributes:
        instances: instances in the file's axes; `world_from_mesh` is still file_from_mesh, in
            meters.
        meshes, materials: meshes and materials of the file.
        data: content of a COLLADA file, for Gazebo's submesh names; otherwise empty.
    """

    instances: tuple[Instance, ...]
    meshes: tuple[Mesh, ...]
    materials: tuple[Material, ...]
    data: bytes = b""


class MeshLibrary:
    """Mesh files by path. As in Gazebo, their axes are not rotated."""

    def __init__(self, textures: TextureStore) -> None:
        self._notices: dict[str, list[tuple[str, str]]] = {}  # by text without its count
        self._textures = textures
        self._files: dict[Path, MeshFile | str] = {}

    @property
    def notices(self) -> list[str]:
        """One line for each feature that is not drawn, with the first of several files."""
        return [
            f"{name}: {notice}"
            if not others
            else f"{name} and {counted(len(others), 'more file')}: {text}"
            for text, ((name, notice), *others) in self._notices.items()
        ]

    def load(self, path: Path) -> MeshFile | str:
        """Contents of a file, or the reason why it cannot be read.

        Raises:
            SceneError: the extra for COLLADA is not installed.
        """
        if path not in self._files:
            if path.suffix.lower() in _COLLADA:
                check_format(path)
            try:
                self._files[path] = self._read(path)
            except SceneError as reason:
                self._files[path] = str(reason).removeprefix(f"{path}: ")
        return self._files[path]

    def _read(self, path: Path) -> MeshFile:
        suffix = path.suffix.lower()
        if suffix not in _GLTF:
            check_format(path)
        try:
            data = read_source(path)
        except OSError as reason:
            raise SceneError(f"cannot be read: {reason.strerror}") from None
        if not data:
            raise SceneError("is an empty file")
        folder = path.parent
        assets = AssetResolver(path, [folder / inner for inner in _TEXTURE_FOLDERS])
        meters_from_file = world_from_file(suffix, data, FileAxes("z"))
        if suffix in _GLTF:
            none = AnimationChoice(NO_ANIMATION)
            read = read_gltf(data, self._textures, assets, np.eye(4), none)
        else:
            read = read_other(path, data, self._textures, assets)
        if not read.instances:
            raise SceneError("has no triangles")
        for notice in (*assets.notices, *material_notices(read), *read.notices):
            text = re.sub(r" \([\d,]+ [a-z ]+\)$", "", notice)
            self._notices.setdefault(text, []).append((path.name, notice))
        instances = tuple(
            replace(one, world_from_mesh=meters_from_file @ one.world_from_mesh)
            for one in read.instances
        )
        return MeshFile(instances, read.meshes, read.materials, data if suffix == ".dae" else b"")


def submesh(file: MeshFile, name: str) -> tuple[Instance, ...]:
    """Instances of a submesh, whose node or mesh has the name, possibly with a number appended.

    In COLLADA files, node names decide, as in Gazebo, then geometry names if no node matches.
    """
    if file.data:
        from omnisim.scene.formats.sdf.collada_submeshes import submesh_names  # slow to import

        names = submesh_names(file.data)
        for kind in (0, 1):
            chosen = (one for one in file.instances if names.get(one.name, ("", ""))[kind] == name)
            if instances := tuple(chosen):
                return instances
        return ()
    named = [(one, (one.name, file.meshes[one.mesh].name)) for one in file.instances]
    exact = tuple(one for one, names in named if name in names)
    return exact or tuple(
        one for one, names in named if any(_is_numbered(own, name) for own in names)
    )


def _is_numbered(own: str, name: str) -> bool:
    """True for a name with a number appended, as readers do to make names unique."""
    return own.startswith(name) and own[len(name) :].lstrip("._- ").isdigit()


def centered(file: MeshFile, instances: tuple[Instance, ...]) -> tuple[Instance, ...]:
    """Instances moved to the origin, each by the center of its own bounding box.

    Source: gz-rendering, Ogre2MeshFactory: each part of a submesh is centered separately.
    """
    return tuple(_centered(one, file.meshes[one.mesh]) for one in instances)


def _centered(instance: Instance, mesh: Mesh) -> Instance:
    file_from_mesh = instance.world_from_mesh.copy()
    points = mesh.positions @ file_from_mesh[:3, :3].T
    file_from_mesh[:3, 3] = -0.5 * (points.min(axis=0) + points.max(axis=0))
    return replace(instance, world_from_mesh=file_from_mesh)
