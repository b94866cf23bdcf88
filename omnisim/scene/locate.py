"""From what a user calls a scene to the file that holds it."""

from __future__ import annotations

import difflib
from pathlib import Path

from omnisim.errors import SceneError
from omnisim.scene.builtin import builtin_scene_file, builtin_scenes
from omnisim.scene.scene_file import SceneFile, read_scene_file


def locate(source: str | Path) -> tuple[Path, SceneFile]:
    """The mesh file of a path or built-in name, and what a scene's TOML says of it.

    Raises:
        SceneError: there is none, or it is not a file that can be read.
    """
    try:
        return _locate(Path(source), str(source))
    except OSError as reason:  # a folder without permission, a name too long
        raise SceneError(f"{source}: cannot be read: {reason.strerror}") from None


def _locate(path: Path, name: str) -> tuple[Path, SceneFile]:
    if path.is_dir() and (path / "scene.toml").is_file():
        path = path / "scene.toml"
    builtin = None if path.is_file() else builtin_scene_file(name)
    if builtin is not None:
        path = builtin
    if path.is_dir():
        raise SceneError(f"{path}: is a folder without a scene.toml: want a scene file")
    if not path.exists():
        names = builtin_scenes()
        near = difflib.get_close_matches(name, names, n=1)
        hint = f"did you mean {near[0]!r}?" if near else "built-in: " + ", ".join(names)
        raise SceneError(f"{name}: no such scene file, and no built-in scene; {hint}")
    if not path.is_file():
        raise SceneError(f"{path}: is not a regular file")
    if path.suffix.lower() != ".toml":
        return path, SceneFile(file=path.name)
    settings = read_scene_file(path)
    mesh_file = path.parent / settings.file
    if not mesh_file.is_file():
        raise SceneError(f"{path}: file = {settings.file!r}: no such file beside it")
    return mesh_file, settings


def read_bytes(path: Path) -> bytes:
    """The content of a file.

    Raises:
        SceneError: it cannot be read, or is empty.
    """
    try:
        data = path.read_bytes()
    except OSError as reason:
        raise SceneError(f"{path}: cannot be read: {reason.strerror}") from None
    if not data:
        raise SceneError(f"{path}: is an empty file")
    return data
