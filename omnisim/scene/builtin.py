"""The scenes that ship with omnisim: each a folder with a `scene.toml`."""

from __future__ import annotations

from pathlib import Path

from omnisim.resources import SCENES


def builtin_scenes() -> list[str]:
    """Names of the built-in scenes, sorted."""
    return sorted(path.parent.name for path in SCENES.glob("*/scene.toml"))


def builtin_scene_file(name: str) -> Path | None:
    """The `scene.toml` of a built-in scene, or None where there is none of that name."""
    return SCENES / name / "scene.toml" if name in builtin_scenes() else None
