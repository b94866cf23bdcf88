"""OBJ, PLY, STL, COLLADA and the other formats that trimesh reads, with simpler materials.

Meshes and materials are imported by `omnisim.scene.formats.mesh.trimesh_import`.
"""

from __future__ import annotations

import io
import logging
import warnings
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image

from omnisim.core.errors import SceneError
from omnisim.scene.formats.conversions import conversion_hint
from omnisim.scene.formats.imported_scene import ImportedScene
from omnisim.scene.formats.mesh.features import mesh_notices
from omnisim.scene.formats.mesh.mesh_faults import early_end, mesh_fault, points_fault
from omnisim.scene.formats.mesh.obj_text import (
    MATERIAL_FILES,
    plain_mtl,
    plain_obj,
    undefined_materials,
)
from omnisim.scene.formats.mesh.trimesh_import import import_trimesh
from omnisim.scene.formats.resources import AssetResolver
from omnisim.scene.textures import TextureStore, unreadable_image

# Formats that trimesh reads, but not as surfaces: paths, voxels and archives.
_NOT_SCENES = {"dxf", "svg", "binvox", "zip", "tar.gz", "tar.bz2", "tgz", "bz2", "gz"}
_DAMAGED = "is damaged, or of another format than its name says"
# Errors and notices replace trimesh's output to standard error.
logging.getLogger("trimesh").addHandler(logging.NullHandler())


def check_format(path: Path) -> None:
    """Check that trimesh reads surfaces from files with the suffix of `path`.

    Raises:
        SceneError: trimesh does not read the format.
    """
    if path.suffix.lower()[1:] not in set(trimesh.available_formats()) - _NOT_SCENES:
        if hint := conversion_hint(path):
            raise SceneError(f"{path}: {hint}")
        raise SceneError(
            f"{path}: unknown scene format: expected .glb .gltf .obj .ply .stl .dae .sdf "
            f".world .urdf .xml .usd, or a scene's .toml, got {path.suffix or '(no suffix)'!r}"
        )


def read_other(
    path: Path, data: bytes, textures: TextureStore, assets: AssetResolver
) -> ImportedScene:
    """Read a file of any trimesh format.

    Raises:
        SceneError: the file is damaged or has no triangles.
    """
    plain, objects = None, list[str]()
    if path.suffix.lower() == ".obj":
        plain, names, objects = plain_obj(data)
        assets.given[MATERIAL_FILES] = _material_files(names, assets)
    kind = path.suffix[1:].lower()
    if fault := early_end(kind, data):
        raise SceneError(f"cannot be read as {kind}: {fault}")
    texts = set(assets.read)
    loaded = _load_with_trimesh(kind, data, plain, assets)
    imported = import_trimesh(loaded, textures, assets, objects=objects)
    if not imported.instances and (fault := mesh_fault(kind, data) or points_fault(kind, data)):
        raise SceneError(f"cannot be read as {kind}: {fault}")
    imported.notices.extend(mesh_notices(kind, data))
    if plain is not None:
        imported.notices.extend(mesh_notices("mtl", assets.given[MATERIAL_FILES]))
        imported.notices.extend(undefined_materials(plain, assets.given[MATERIAL_FILES]))
    for asset in sorted(assets.read - texts):
        _check_image(asset, assets)
    return imported


def _load_with_trimesh(
    kind: str, data: bytes, plain: bytes | None, assets: AssetResolver
) -> trimesh.Scene:
    """Load a file with trimesh, from its normalized form `plain` if there is one."""
    try:
        # suppresses NumPy's warnings about damaged files and Pillow's about large images
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            file = io.BytesIO(data if plain is None else plain)
            apart: dict[str, Any] = {"split_objects": True} if plain is not None else {}
            return trimesh.load_scene(file, file_type=kind, resolver=assets, process=False, **apart)
    except MemoryError:
        raise
    except Exception as reason:  # trimesh's readers raise any exception on a damaged file
        if isinstance(reason, ImportError) and reason.name != "charset_normalizer":
            message = f"it needs {reason.name}: pip install {reason.name}"
        else:  # trimesh uses charset_normalizer only to guess encodings
            message = mesh_fault(kind, data) or _DAMAGED
        faults = "".join(f"{name} {fault}; " for name, fault in [*assets.faults.items()][-1:])
        raise SceneError(f"cannot be read as {kind}: {faults}{message}") from None


def _check_image(name: str, assets: AssetResolver) -> None:
    """Record an image that cannot be opened, which trimesh ignores silently."""
    data = b""
    try:
        data = assets[name]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about large images
            Image.open(io.BytesIO(data)).close()
    except MemoryError:
        raise
    except Exception:  # Pillow's readers raise exceptions of any type
        assets.faults[name] = unreadable_image(data)


def _material_files(names: list[str], assets: AssetResolver) -> bytes:
    """Concatenated, normalized material files of an OBJ's `mtllib` lines."""
    parts = []
    for line in names:
        # "a.mtl b.mtl" is two files, "my file.mtl" is one
        for name in [line] if line in assets else line.split():
            with suppress(FileNotFoundError):
                part = plain_mtl(assets[name])
                if b"newmtl" not in part:
                    assets.faults[name] = "has no materials"
                parts.append(part)
    return b"\n".join(parts)
