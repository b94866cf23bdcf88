"""Registry of scene file readers, by suffix."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from omnisim.core.arrays import Floats
from omnisim.core.errors import SceneError
from omnisim.core.extras import require_extra
from omnisim.core.files.sources import SourceReader
from omnisim.scene.formats.gltf.nodes import NO_ANIMATION, AnimationChoice
from omnisim.scene.formats.gltf.reader import read_gltf
from omnisim.scene.formats.imported_scene import (
    FileAxes,
    ImportedScene,
    material_notices,
    world_from_file,
)
from omnisim.scene.formats.resources import AssetResolver, ResourcePath
from omnisim.scene.textures import TextureStore, large_textures

Read = tuple[ImportedScene, Floats]  # contents and world_from_file (4, 4)


@dataclass(frozen=True, eq=False)
class SourceFile:
    """Scene file with everything its reader may need; the content is read on first use."""

    path: Path
    axes: FileAxes  # overrides of the file's up axis and unit
    folders: Sequence[Path]  # folders of models and packages, see `load_scene`
    animation: AnimationChoice  # glTF animation to play
    # textures, assets: store and resolver for all images and other files of the scene
    textures: TextureStore
    assets: AssetResolver
    urdf_materials: str | None  # "robot" or "mesh", see `SceneFile`; None: not stated

    @cached_property
    def data(self) -> bytes:
        """Content of the file."""
        return self.assets.reader.read(self.path)

    @cached_property
    def matrix(self) -> Floats:
        """Transform (4, 4) world_from_file."""
        return world_from_file(self.path.suffix.lower(), self.data, self.axes)

    @property
    def resources(self) -> ResourcePath:
        """Search path for models and packages."""
        return ResourcePath(self.path, self.folders, self.assets.reader)


class SceneFormat(NamedTuple):
    """Scene file format."""

    suffixes: tuple[str, ...]  # file suffixes
    read: Callable[[SourceFile], Read]  # reader function
    extra: str | None = None  # name of the extra that it requires; None: no extra


# Every reader except glTF's is slow to import, or requires an extra.


def _read_gltf(file: SourceFile) -> Read:
    read = read_gltf(file.data, file.textures, file.assets, file.matrix, file.animation)
    return read, file.matrix


def _read_sdf(file: SourceFile) -> Read:
    from omnisim.scene.formats.sdf.reader import read_sdf

    read = read_sdf(file.path, file.data, file.textures, file.resources, file.matrix)
    return read, file.matrix


def _read_urdf(file: SourceFile) -> Read:
    from omnisim.scene.formats.urdf.reader import read_urdf

    stated = file.urdf_materials
    return read_urdf(file.path, file.data, file.textures, file.resources, stated), file.matrix


def _read_mjcf(file: SourceFile) -> Read:
    from omnisim.scene.formats.mjcf.reader import read_mjcf

    return read_mjcf(file.path, file.matrix, file.assets.reader), file.matrix


def _read_usd(file: SourceFile) -> Read:
    from omnisim.scene.formats.usd.reader import read_usd

    return read_usd(file.path, file.axes, file.assets.reader)


def _read_other(file: SourceFile) -> Read:
    from omnisim.scene.formats.mesh.other_formats import read_other

    read = read_other(file.path, file.data, file.textures, file.assets)
    is_collada = file.path.suffix.lower() == ".dae"
    if is_collada and file.axes.up_axis is None and b"<up_axis>" not in file.data:
        read.notices.append(
            "states no up axis: y is up, as COLLADA says; RViz and Gazebo take z (up_axis)"
        )
    return read, file.matrix


_GLTF = SceneFormat((".glb", ".gltf"), _read_gltf)
_URDF = SceneFormat((".urdf",), _read_urdf)
_MJCF = SceneFormat((".xml", ".mjcf"), _read_mjcf, "mujoco")
_FORMATS = (
    _GLTF,
    SceneFormat((".sdf", ".world"), _read_sdf),
    _URDF,
    _MJCF,
    SceneFormat((".usd", ".usda", ".usdc", ".usdz"), _read_usd, "usd"),
)


def _format_of(path: Path) -> SceneFormat | None:
    """Format of a file; None: possibly one that trimesh reads."""
    suffix = path.suffix.lower()
    scene_format = next((one for one in _FORMATS if suffix in one.suffixes), None)
    if scene_format is _MJCF:
        from omnisim.scene.formats.xml.element import is_urdf  # imports an XML parser

        return _URDF if is_urdf(path) else _MJCF
    return scene_format


def check_format(path: Path) -> None:
    """Check that a reader exists for the suffix of a path.

    Raises:
        SceneError: no reader exists, or its extra is not installed.
    """
    scene_format = _format_of(path)
    if scene_format is None:
        from omnisim.scene.formats.mesh import other_formats  # imports trimesh, slow

        other_formats.check_format(path)
    elif scene_format.extra is not None:
        require_extra(scene_format.extra, str(path), SceneError)


def is_mjcf(path: Path) -> bool:
    """True for a MuJoCo model file."""
    return _format_of(path) is _MJCF


def read_file(
    path: Path,
    reader: SourceReader,
    axes: FileAxes,
    folders: Sequence[Path],
    animation: AnimationChoice,
    urdf_materials: str | None,
) -> Read:
    """Read a file in any supported format.

    Args:
        path, axes, folders, animation, urdf_materials: see `SourceFile`.
        reader: reader of all files of the scene.

    Returns:
        File contents with all notices, and the transform (4, 4) world_from_file.

    Raises:
        SceneError: the file is damaged or has no geometry.
        OSError: the file cannot be read.
    """
    stores = TextureStore(), AssetResolver(path, reader)
    file = SourceFile(path, axes, folders, animation, *stores, urdf_materials)
    scene_format = _format_of(path)
    if scene_format is not _GLTF and animation.name not in (None, NO_ANIMATION):
        raise SceneError(
            f"animation = {animation.name!r}: expected a glTF file, got {path.suffix.lower()}"
        )
    with large_textures():
        read, matrix = _read_other(file) if scene_format is None else scene_format.read(file)
    if not read.instances:
        raise SceneError("; ".join(["has no triangles to draw", *read.notices[:1]]))
    own = material_notices(read)
    notices = [*file.assets.notices, *file.textures.notices, *own, *read.notices]
    return read._replace(notices=list(dict.fromkeys(notices))), matrix
