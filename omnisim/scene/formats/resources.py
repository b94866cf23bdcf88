"""Files that scenes refer to: search paths, and names that other systems wrote."""

from __future__ import annotations

import itertools
import os
import re
import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from urllib.parse import unquote, urlsplit

from omnisim.core.files.sources import SourceReader

# Environment variables of Gazebo, newer names first, and of ROS.
VARIABLES = (
    "GZ_SIM_RESOURCE_PATH",
    "IGN_GAZEBO_RESOURCE_PATH",
    "SDF_PATH",
    "GAZEBO_MODEL_PATH",
    "GAZEBO_RESOURCE_PATH",
    "ROS_PACKAGE_PATH",
)
PREFIXES = "AMENT_PREFIX_PATH"  # packages are in the share folder of each prefix
_HOME = (".gazebo/models",)
_FUEL = (".gz/fuel", ".ignition/fuel")  # Gazebo's download caches
_PARENTS = 3  # number of searched folders above a scene file


class ResourcePath:
    """Folders of models and packages, in search order.

    They are the given ones, those of the environment variables, those in the home folder, then the
    scene file's own and those above it, each followed by its `models`. `reader` reads what they
    find.
    """

    def __init__(
        self,
        scene_file: Path,
        given: Sequence[str | Path] = (),
        reader: SourceReader | None = None,
    ):
        self.reader = reader or SourceReader()
        listed = [os.environ.get(name, "").split(os.pathsep) for name in (*VARIABLES, PREFIXES)]
        *variables, prefixes = (map(Path, filter(None, paths)) for paths in listed)
        stated = [*map(Path, given), *itertools.chain(*variables)]
        stated += [*(prefix / "share" for prefix in prefixes), *_homes(_HOME)]
        folder = scene_file.absolute().parent
        above = (folder, *folder.parents[:_PARENTS])
        around = (place for parent in above for place in (parent, parent / "models"))
        self._stated, self.folders = _distinct(stated), _distinct([*stated, *around])
        self._packages: dict[str, Path] | None = None

    def find(self, uri: str, *beside: Path) -> Path | None:
        """File or folder of a URI or path; None: not found.

        Args:
            uri: `model://name/…`, `package://name/…`, `file://…`, a path, or a Gazebo Fuel address,
                whose model is looked up in Gazebo's download caches, then by name.
            beside: base folders of a relative path, searched before the search path; folders around
                the scene file apply to URIs only.
        """
        places = list(self._places(uri.strip(), *beside))
        is_model = re.fullmatch(r"model://[^/]+/?", uri.strip()) is not None  # a folder
        for folder, name in places:
            if _exists(folder / name) and not (is_model and (folder / name).is_file()):
                return folder / name
        for folder, name in () if is_model else places:
            with suppress(OSError, ValueError):  # no permission, or a name too long
                path = find_ignoring_case(folder, name) if name else None
                if path is not None:
                    return path
        return None

    def used(self, uris: Iterable[str]) -> tuple[Path, ...]:
        """Folders in which URIs are found: given ones, the environment's and the home's."""
        paths = [path.absolute() for uri in uris if (path := self.find(uri)) is not None]
        return tuple(
            folder
            for folder in self._stated
            if any(path.is_relative_to(folder.absolute()) for path in paths)
        )

    def _places(self, uri: str, *beside: Path) -> Iterator[tuple[Path, str]]:
        """Candidate folders, each with a relative path."""
        scheme, separator, rest = uri.partition("://")
        if not separator:
            scheme, rest = "", uri
        if not rest.strip("/"):
            return
        if scheme in ("http", "https"):
            yield from self._downloaded(uri)
            return
        for name in dict.fromkeys((rest, unquote(rest))):
            relative = name.lstrip("/")
            if scheme in ("", "file"):
                for folder in (Path("/"),) if name.startswith("/") else beside:
                    yield folder, relative
            for folder in self.folders if scheme else self._stated:
                yield folder, relative
                first, _, inner = relative.partition("/")
                if folder.name == first:  # the folder of the model itself
                    yield folder, inner
            if scheme == "package":
                first, _, inner = relative.partition("/")
                if first in self._package_folders():
                    yield self._package_folders()[first], inner

    def _package_folders(self) -> dict[str, Path]:
        """Folders of ROS packages by the names in `package.xml`: clones have other names."""
        if self._packages is None:
            self._packages = {}
            for folder in self.folders:
                for file in (folder / "package.xml", *sorted(folder.glob("*/package.xml"))):
                    with suppress(OSError):
                        name = re.search(rb"<name>\s*([^<\s]+)\s*</name>", file.read_bytes())
                        if name is not None:
                            self._packages.setdefault(name[1].decode("latin-1"), file.parent)
        return self._packages

    def _downloaded(self, uri: str) -> Iterator[tuple[Path, str]]:
        """Candidates for a Gazebo Fuel URI: https://host/1.0/owner/models/name/version/files/…."""
        address = urlsplit(uri)
        parts = [unquote(part) for part in address.path.split("/") if part]
        if "models" not in parts[1:-1]:
            return
        at = parts.index("models", 1)
        owner, name, rest = parts[at - 1], parts[at + 1], parts[at + 2 :]
        version = rest.pop(0) if rest and (rest[0].isdecimal() or rest[0] == "tip") else "tip"
        inner = "/".join(rest[1:] if rest[:1] == ["files"] else rest)
        for cache in _homes(_FUEL):
            model = cache / (address.hostname or "") / owner.lower() / "models" / name.lower()
            if version != "tip":
                yield model / version, inner
            elif _exists(model):
                versions = (entry for entry in model.iterdir() if entry.name.isdecimal())
                for entry in sorted(versions, key=lambda entry: -int(entry.name)):
                    yield entry, inner
        for folder in self.folders:
            for same in dict.fromkeys((name, name.lower(), name.replace(" ", "_"))):
                yield folder / same, inner


def _homes(names: Sequence[str]) -> Iterator[Path]:
    home = os.environ.get("HOME", "")
    return (Path(home, name) for name in names if home)


def _distinct(folders: Sequence[Path]) -> tuple[Path, ...]:
    return tuple(dict.fromkeys(folder for folder in folders if _exists(folder)))


def _exists(path: Path) -> bool:
    try:
        return path.is_file() or path.is_dir()
    except (OSError, ValueError):  # a name too long or with a null byte
        return False


# Resolver for the files that a scene file references.


class AssetResolver(Mapping[str, bytes]):
    """Contents of the files referenced by a scene file, by the referenced name.

    Scene files from Windows reference `textures/wood.jpg` as `Textures\\Wood.JPG`, and names with
    spaces arrive percent-encoded. Both resolve. Files outside the scene's folder are read too,
    because references to `../textures` are common. (trimesh takes a mapping as its resolver.)
    """

    def __init__(
        self, scene_file: Path, reader: SourceReader, further_folders: Sequence[Path] = ()
    ):
        """Resolve names in the scene file's folder, then in further folders."""
        self.file_name = scene_file.name  # trimesh derives the mesh names of an OBJ from it
        self.given: dict[str, bytes] = {}  # contents supplied in advance, by name
        self.read: set[str] = set()  # names of the files that were requested and read
        self.faults: dict[str, str] = {}  # reasons why others cannot be read, by name
        self.reader = reader
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
            data = b"" if path is None else self.reader.read(path)
        except OSError as reason:  # no permission, a disk error or a name too long
            raise FileNotFoundError(f"cannot be read: {reason.strerror}") from None
        if path is None:
            raise FileNotFoundError("is missing")
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
    return unicodedata.normalize("NFC", name).casefold()
