"""How a scene file's textures and material files are found, and which were not."""

from __future__ import annotations

import unicodedata
from contextlib import suppress
from pathlib import Path
from urllib.parse import unquote

from trimesh.resolvers import FilePathResolver

from omnisim.scene.obj_text import MATERIAL_FILES, plain_mtl


class AssetResolver(FilePathResolver):
    """Looks files up beside the scene, as their authors meant them, and remembers the missing.

    Scene files from Windows write `Textures\\Wood.JPG` for `textures/wood.jpg`; names with
    spaces arrive percent-encoded. Both are found. Files outside the scene's folder are read too:
    scenes refer to `../textures` all the time.
    """

    def __init__(self, scene_file: Path, missing: list[str] | None = None):
        super().__init__(str(scene_file), allow_anywhere=True)
        self.missing: list[str] = [] if missing is None else missing
        self.material_files: list[str] = []  # what an OBJ's `mtllib` lines name

    def get(self, name: str) -> bytes:
        """Return the bytes of the file called `name`.

        Raises:
            FileNotFoundError: no such file; its name is then in `missing`.
        """
        if name == MATERIAL_FILES:
            return self._material_files()
        found = _find(Path(self.parent), name)
        if found is None:
            if name not in self.missing:
                self.missing.append(name)
            raise FileNotFoundError(name)
        return found.read_bytes()

    def _material_files(self) -> bytes:
        """All material files of an OBJ as one; those that are not there are in `missing`."""
        parts = []
        for line in self.material_files:
            # "a.mtl b.mtl" is two files, "my file.mtl" is one
            whole = _find(Path(self.parent), line) is not None
            for name in [line] if whole else line.split():
                with suppress(FileNotFoundError):
                    parts.append(plain_mtl(self.get(name)))
        return b"\n".join(parts)

    def namespaced(self, namespace: str) -> AssetResolver:
        """Return the resolver of a folder below; it shares `missing`."""
        return AssetResolver(Path(self.parent) / namespace / "_", self.missing)


def _find(folder: Path, name: str) -> Path | None:
    plain = unquote(name).strip().removeprefix("file://").replace("\\", "/")
    for candidate in (name.strip(), plain, plain.lstrip("/"), Path(plain).name):
        exact = folder / candidate
        if exact.is_file():
            return exact
        other_case = _ignoring_case(folder, candidate)
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
    """A name without case, in one of the two ways in which Unicode writes accents."""
    return unicodedata.normalize("NFC", name).casefold()
