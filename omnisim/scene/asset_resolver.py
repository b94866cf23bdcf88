"""Files that a scene file refers to: found beside it, or noted as missing."""

from __future__ import annotations

import unicodedata
from pathlib import Path
from urllib.parse import unquote


class AssetResolver:
    """Finds files beside a scene file, as its author meant them.

    Scene files from Windows write `Textures\\Wood.JPG` for `textures/wood.jpg`; names with
    spaces arrive percent-encoded. Both are found. Files outside the scene's folder are read too:
    scenes refer to `../textures` all the time.

    Attributes:
        missing: names of the files that were asked for and are not there.
    """

    def __init__(self, scene_file: Path):
        self.missing: list[str] = []
        self._folder = scene_file.parent

    def has(self, name: str) -> bool:
        """True where there is a file of that name."""
        return self._find(name) is not None

    def read(self, name: str) -> bytes:
        """Content of a file.

        Raises:
            FileNotFoundError: no such file; its name is then in `missing`.
        """
        found = self._find(name)
        if found is None:
            if name not in self.missing:
                self.missing.append(name)
            raise FileNotFoundError(f"{name}: no such file")
        return found.read_bytes()

    def _find(self, name: str) -> Path | None:
        plain = unquote(name).strip().removeprefix("file://").replace("\\", "/")
        for candidate in (name.strip(), plain, plain.lstrip("/"), Path(plain).name):
            exact = self._folder / candidate
            if exact.is_file():
                return exact
            other_case = _ignoring_case(self._folder, candidate)
            if other_case is not None:
                return other_case
        return None


def _ignoring_case(folder: Path, name: str) -> Path | None:
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
    """The name without case, its accents composed."""
    return unicodedata.normalize("NFC", name).casefold()
