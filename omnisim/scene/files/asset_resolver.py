"""Resolver for the files that a scene file references."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from urllib.parse import unquote

from omnisim.core.files.sources import read_source


class AssetResolver(Mapping[str, bytes]):
    """Contents of the files referenced by a scene file, by the referenced name.

    Scene files from Windows reference `textures/wood.jpg` as `Textures\\Wood.JPG`, and names with
    spaces arrive percent-encoded. Both resolve. Files outside the scene's folder are read too,
    because references to `../textures` are common. (trimesh takes a mapping as its resolver.)

    Attributes:
        file_name: name of the scene file; trimesh derives the mesh names of an OBJ from it.
        given: contents supplied in advance, by name.
        read: names of the files that were requested and read.
        faults: reasons for the files that were requested but cannot be read, by name.
    """

    def __init__(self, scene_file: Path, further_folders: Sequence[Path] = ()):
        """Resolve names in the scene file's folder, then in further folders."""
        self.file_name = scene_file.name
        self.given: dict[str, bytes] = {}
        self.read: set[str] = set()
        self.faults: dict[str, str] = {}
        self._folders = (scene_file.parent, *further_folders)

    def __contains__(self, name: object) -> bool:
        try:
            return name in self.given or self._find(str(name)) is not None
        except OSError:  # a folder without permission, or a name too long
            return False

    def __getitem__(self, name: str) -> bytes:
        if name in self.given:
            return self.given[name]
        try:
            data = self._read(name)
        except FileNotFoundError as reason:
            self.faults[name] = str(reason)
            raise
        self.read.add(name)
        return data

    @property
    def notices(self) -> list[str]:
        """One line for each file that cannot be read."""
        return [
            f"{name} {reason}" + ("" if "is drawn" in reason else ": drawn without it")
            for name, reason in self.faults.items()
        ]

    def __iter__(self) -> Iterator[str]:
        return iter(self.given)

    def __len__(self) -> int:
        return len(self.given)

    def _read(self, name: str) -> bytes:
        """Content of a file; raises a FileNotFoundError with the reason if it cannot be read."""
        try:
            path = self._find(name)
            if path is None and (tiles := re.search(r"<(UDIM|UVTILE)>", name)) is not None:
                self.faults[name] = (
                    "is a set of UDIM tiles, of which the first, 1001, is drawn alone"
                )
                first = {"UDIM": "1001", "UVTILE": "u1_v1"}[tiles[1]]
                path = self._find(name.replace(tiles[0], first))
            data = b"" if path is None else read_source(path)
        except OSError as reason:  # no permission, a disk error or a name too long
            raise FileNotFoundError(f"cannot be read: {reason.strerror}") from None
        if path is None:
            raise FileNotFoundError("is not there")
        if not data:
            raise FileNotFoundError("is an empty file")
        return data

    def _find(self, name: str) -> Path | None:
        plain = unquote(name).strip().removeprefix("file://").replace("\\", "/")
        for candidate in (name.strip(), plain, plain.lstrip("/"), Path(plain).name):
            for folder in self._folders:
                exact = folder / candidate
                if exact.is_file():
                    return exact
                other_case = find_ignoring_case(folder, candidate)
                if other_case is not None:
                    return other_case
        return None


def find_ignoring_case(folder: Path, name: str) -> Path | None:
    """File in a folder by its path, ignoring case; None: no such file."""
    for part in Path(name).parts:
        if part in ("..", ".", "/"):
            folder = folder / part
            continue
        if not folder.is_dir():
            return None
        same = [entry for entry in folder.iterdir() if _folded(entry.name) == _folded(part)]
        if not same:
            return None
        folder = min(same)
    return folder if folder.is_file() else None


def _folded(name: str) -> str:
    """Case-folded name with composed accents."""
    return unicodedata.normalize("NFC", name).casefold()
