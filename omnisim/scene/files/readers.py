"""Readers of scene files, by their suffixes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import SceneError
from omnisim.core.extras import require_extra
from omnisim.core.files.sources import read_source
from omnisim.scene.files.asset_resolver import AssetResolver
from omnisim.scene.files.file_axes import FileAxes, world_from_file
from omnisim.scene.files.imported import ImportedScene, texture_notices
from omnisim.scene.formats.gltf.animations import FIRST_ANIMATION, NO_ANIMATION, AnimationChoice
from omnisim.scene.formats.gltf.reader import read_gltf
from omnisim.scene.textures import TextureStore, large_textures

_GLTF = {".glb", ".gltf"}
_SDF = {".sdf", ".world"}
_MJCF = {".xml", ".mjcf"}
_URDF = ".urdf"
_USD = {".usd", ".usda", ".usdc", ".usdz"}
_EXTRAS = dict.fromkeys(_MJCF, "mujoco") | dict.fromkeys(_USD, "usd")


def check_format(path: Path) -> None:
    """Check that there is a reader for files with the suffix of a path.

    Raises:
        SceneError: there is none, or its extra is not installed.
    """
    suffix = path.suffix.lower()
    if _is_urdf(path):
        return
    if suffix in _EXTRAS:
        require_extra(_EXTRAS[suffix], str(path), SceneError)
    elif suffix not in _GLTF | _SDF:
        from omnisim.scene.formats.mesh.other_formats import (
            check_format,
        )  # with trimesh, slow to import

        check_format(path)


def is_mjcf(path: Path) -> bool:
    """True for a model of MuJoCo."""
    return path.suffix.lower() in _MJCF and not _is_urdf(path)


def _is_urdf(path: Path) -> bool:
    """True for a robot's file, which may be named like a MuJoCo model."""
    if path.suffix.lower() in _MJCF:
        from omnisim.scene.formats.urdf.document import is_urdf  # with an XML parser

        return is_urdf(path)
    return path.suffix.lower() == _URDF


def read_file(
    path: Path,
    axes: FileAxes,
    resources: Sequence[Path],
    animation: AnimationChoice = FIRST_ANIMATION,
) -> tuple[ImportedScene, NDArray[np.float64]]:
    """Read a file of any format.

    Args:
        path: of the file.
        axes: overrule those of the file.
        resources: folders of models and packages, see `load_scene`.
        animation: that glTF plays.

    Returns:
        The contents, with all notices, and the transform (4, 4) world_from_file.

    Raises:
        SceneError: it is damaged, or has nothing to draw.
        OSError: it cannot be read.
    """
    textures, assets = TextureStore(), AssetResolver(path)
    with large_textures():
        read, matrix = _read(path, axes, resources, textures, assets, animation)
    if not read.instances:
        raise SceneError("has no triangles to draw")
    notices = [*assets.notices, *textures.notices, *texture_notices(read), *read.notices]
    return read._replace(notices=list(dict.fromkeys(notices))), matrix


def _read(
    path: Path,
    axes: FileAxes,
    resources: Sequence[Path],
    textures: TextureStore,
    assets: AssetResolver,
    animation: AnimationChoice,
) -> tuple[ImportedScene, NDArray[np.float64]]:
    suffix = path.suffix.lower()
    if suffix not in _GLTF and animation.name not in (None, NO_ANIMATION):
        raise SceneError(f"animation = {animation.name!r}: expected a glTF file, got {suffix}")
    if suffix in _USD:
        from omnisim.scene.formats.usd.reader import read_usd  # of an extra

        return read_usd(path, axes)
    data = read_source(path)
    matrix = world_from_file(suffix, data, axes)
    if suffix in _GLTF:
        return read_gltf(data, textures, assets, matrix, animation), matrix
    if _is_urdf(path):
        from omnisim.scene.files.search_path import ResourcePath
        from omnisim.scene.formats.urdf.reader import read_urdf  # with trimesh, slow to import

        return read_urdf(path, data, textures, ResourcePath(path, resources)), matrix
    if suffix in _MJCF:
        from omnisim.scene.formats.mjcf.reader import read_mjcf  # of an extra

        return read_mjcf(path, matrix), matrix
    if suffix in _SDF:
        from omnisim.scene.files.search_path import ResourcePath
        from omnisim.scene.formats.sdf.reader import read_sdf  # with trimesh, slow to import

        return read_sdf(path, data, textures, ResourcePath(path, resources), matrix), matrix
    from omnisim.scene.formats.mesh.other_formats import read_other  # slow to import

    return read_other(path, data, textures, assets), matrix
