"""Folders of Gazebo models, whose SDF files are listed in `model.config`."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element

from omnisim.core.errors import SceneError
from omnisim.core.files.sources import read_source
from omnisim.scene.formats.xml.document import parse_xml

MANIFESTS = ("model.config", "manifest.xml")


def model_file(folder: Path) -> Path | None:
    """SDF file in a model folder, of the latest version listed in its `model.config`.

    Raises:
        SceneError: the `model.config` is damaged.
    """
    manifest = next((path for name in MANIFESTS if (path := folder / name).is_file()), None)
    named = []
    if manifest is not None:
        entries = [entry for entry in read_xml(manifest).iter("sdf") if entry.text]
        entries.sort(key=lambda entry: _version(entry.get("version")), reverse=True)
        named = [(entry.text or "").strip() for entry in entries]
    for name in (*named, "model.sdf"):
        if (folder / name).is_file():
            return folder / name
    return next(iter(sorted(folder.glob("*.sdf"))), None)


def read_xml(path: Path) -> Element:
    """Root of an XML file.

    Raises:
        SceneError: the file is unreadable or invalid XML; names the file.
    """
    try:
        return parse_xml(read_source(path))
    except OSError as reason:
        raise SceneError(f"{path}: cannot be read: {reason.strerror}") from None
    except SceneError as reason:
        raise SceneError(f"{path}: {reason}") from None


def _version(text: str | None) -> tuple[int, ...]:
    return tuple(int(part) for part in (text or "").split(".") if part.isdecimal())
