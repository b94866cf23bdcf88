"""Files referenced by a MuJoCo model and read by MuJoCo itself, recorded as sources."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from omnisim.core.files.sources import note_file

_FOLDERS = ("assetdir", "meshdir", "texturedir")


def note_model_files(path: Path) -> list[Element]:
    """Record the files of a model: included files, meshes, textures and height fields.

    Returns:
        The roots of the model's XML files.
    """
    roots = []
    names, folders = {""}, {""}
    waiting, seen = [path], set()
    while waiting:
        file = waiting.pop()
        if file in seen:
            continue
        seen.add(file)
        note_file(file)
        try:
            roots.append(ElementTree.parse(file).getroot())
        except (OSError, ElementTree.ParseError):  # MuJoCo reports faults itself
            continue
        for element in roots[-1].iter():
            folders |= {element.get(key, "") for key in _FOLDERS}
            # cube textures have one file per side: fileright, fileleft, …
            given = {value for key, value in element.items() if key.startswith("file")}
            names |= given
            if element.tag == "include":
                waiting += [path.parent / name for name in given]
    for name in names - {""}:
        for folder in folders:
            candidate = path.parent / folder / name
            if candidate.is_file():
                note_file(candidate)
    return roots
