"""Readers of scene files in all formats, by suffix."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

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

_FORMATS = {
    ".glb": "gltf", ".gltf": "gltf", ".sdf": "sdf", ".world": "sdf", ".urdf": "urdf",
    ".xml": "mjcf", ".mjcf": "mjcf", ".usd": "usd", ".usda": "usd", ".usdc": "usd", ".usdz": "usd",
}  # fmt: skip
_OTHER = "other"  # a format that trimesh reads, or none
_EXTRAS = {"mjcf": "mujoco", "usd": "usd"}  # extras that formats require


def _format_of(path: Path) -> str:
    found = _FORMATS.get(path.suffix.lower(), _OTHER)
    if found == "mjcf":
        from omnisim.scene.formats.xml.element import is_urdf  # imports an XML parser

        return "urdf" if is_urdf(path) else "mjcf"
    return found


def check_format(path: Path) -> None:
    """Check that a reader exists for the suffix of a path.

    Raises:
        SceneError: no reader exists, or its extra is not installed.
    """
    found = _format_of(path)
    if found == _OTHER:
        from omnisim.scene.formats.mesh import other_formats  # imports trimesh, slow

        other_formats.check_format(path)
    elif found in _EXTRAS:
        require_extra(_EXTRAS[found], str(path), SceneError)


def is_mjcf(path: Path) -> bool:
    """True for a MuJoCo model file."""
    return _format_of(path) == "mjcf"


def read_file(
    path: Path,
    reader: SourceReader,
    axes: FileAxes,
    folders: Sequence[Path],
    animation: AnimationChoice,
    urdf_materials: str | None,
) -> tuple[ImportedScene, Floats]:
    """Read a file in any supported format.

    `folders` are those of models and packages, see `load_scene`; `urdf_materials` are "robot" or
    "mesh", see `SceneFile`, or None if they are not stated.

    Returns:
        File contents with all notices, and the transform (4, 4) world_from_file.

    Raises:
        SceneError: the file is damaged or has no geometry.
        OSError: the file cannot be read.
    """
    found, suffix = _format_of(path), path.suffix.lower()
    if found != "gltf" and animation.name not in (None, NO_ANIMATION):
        raise SceneError(f"animation = {animation.name!r}: expected a glTF file, got {suffix}")
    textures, assets = TextureStore(), AssetResolver(path, reader)
    resources = ResourcePath(path, folders, reader)
    # every reader except glTF's is slow to import, or requires an extra
    with large_textures():
        data = b"" if found == "usd" else reader.read(path)
        matrix = world_from_file(suffix, data, axes)  # a stage states its own
        if found == "gltf":
            read = read_gltf(data, textures, assets, matrix, animation)
        elif found == "sdf":
            from omnisim.scene.formats.sdf.reader import read_sdf

            read = read_sdf(path, data, textures, resources, matrix)
        elif found == "urdf":
            from omnisim.scene.formats.urdf.reader import read_urdf

            read = read_urdf(path, data, textures, resources, urdf_materials)
        elif found == "mjcf":
            from omnisim.scene.formats.mjcf.reader import read_mjcf

            read = read_mjcf(path, matrix, reader)
        elif found == "usd":
            from omnisim.scene.formats.usd.reader import read_usd

            read, matrix = read_usd(path, axes, reader)
        else:
            from omnisim.scene.formats.mesh.other_formats import read_other

            read = read_other(path, data, textures, assets)
            if suffix == ".dae" and axes.up_axis is None and b"<up_axis>" not in data:
                read.notices.append(
                    "states no up axis: y is up, as in COLLADA; RViz and Gazebo assume z (up_axis)"
                )
    if not read.instances:
        raise SceneError("; ".join(["has no triangles to draw", *read.notices[:1]]))
    notices = [*assets.notices, *textures.notices, *material_notices(read), *read.notices]
    return read._replace(notices=list(dict.fromkeys(notices))), matrix
