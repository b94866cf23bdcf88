"""Output folders of bakes: new or empty, with the same finished bake, or with another."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from omnisim.core.errors import OutputError
from omnisim.core.files.atomic_file import check_new_folder
from omnisim.rendering.baking.settings import BakeSettings

FILES = ("baked.json", "irradiance.exr", "probes.npz", "unwrapping.npz")


def is_finished(
    output: Path, fingerprint: str, settings: BakeSettings, force: bool = False
) -> bool:
    """True if a folder holds exactly this bake; False if it has to be written.

    Args:
        output: folder of the bake.
        fingerprint: fingerprint of the scene.
        settings: settings of the bake.
        force: allow another bake in the folder, which is overwritten.

    Raises:
        OutputError: the folder holds another bake or other files, or cannot be written.
    """
    names = sorted(path.name for path in output.iterdir()) if output.is_dir() else []
    if not names:
        if not output.is_dir():
            check_new_folder(output)
        return False
    if not set(names) <= set(FILES):
        raise OutputError(f"{output}: is not a bake: expected a new or empty folder")
    document = _document(output)
    if document.get("fingerprint") != fingerprint:
        what = "of another scene, or of this one before it changed"
    elif len(names) < len(FILES) or not _has_settings(document, settings):
        what = "with other settings"
    else:
        return not force
    if not force:
        raise OutputError(f"{output}: is a bake {what}: expected --force to replace it")
    return False


def clear(output: Path) -> None:
    """Remove the files of a bake, to make room for another."""
    for name in FILES:
        (output / name).unlink(missing_ok=True)


def _document(output: Path) -> Mapping[str, Any]:
    try:
        document = json.loads((output / FILES[0]).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return document if isinstance(document, dict) else {}


def _has_settings(document: Mapping[str, Any], settings: BakeSettings) -> bool:
    texel_m = settings.texel_m
    wanted = {name: getattr(settings, name) for name in ("samples", "bounces", "seed")}
    return texel_m in (None, document.get("texel_m")) and wanted.items() <= document.items()
