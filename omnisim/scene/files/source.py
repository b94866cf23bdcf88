"""Scene sources: mesh files, scene TOML files and built-in names."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from omnisim.core.errors import SceneError, did_you_mean
from omnisim.core.files.parameters import parse_table
from omnisim.core.files.sources import SourceReader
from omnisim.core.files.toml_file import base_source, find_beside, read_tables
from omnisim.core.package_files import SCENES, built_in
from omnisim.scene.files.scene_file import SceneFile
from omnisim.scene.light.light_tables import SkyTable, SunTable

CLEAR_SKY = "clear"
NO_SKY = "none"  # in place of a sky: even light


def builtin_scenes() -> list[str]:
    """Sorted names of the built-in scenes, which are folders with a `scene.toml`."""
    return built_in("scene.toml")


class SceneSource(NamedTuple):
    """Files of a scene."""

    name: str  # path or built-in name
    mesh_file: Path | None  # path of the mesh file; None: the scene extends another
    settings: SceneFile  # settings of the TOML file, or the defaults
    toml: Path | None  # path of the TOML file; None: no TOML file

    @property
    def folder(self) -> Path:
        """Folder of the TOML file, or else of the mesh file."""
        path = self.toml or self.mesh_file
        assert path is not None
        return path.parent

    @property
    def base(self) -> str | Path | None:
        """Source of the base scene; None: the scene has a mesh file."""
        if self.toml is None or self.settings.extends is None:
            return None
        return base_source(self.toml.parent, self.settings.extends)

    def with_sky(self, sky: SkyTable | None, sun: SunTable | None) -> SceneSource:
        """Source with its sky and sun replaced or removed."""
        return self._replace(settings=self.settings.model_copy(update={"sky": sky, "sun": sun}))


def shining_sun(source: SceneSource, reader: SourceReader) -> SunTable | None:
    """Sun of a source or of its base scenes; None: no sun, or faulty files."""
    seen = set()
    while not source.settings.has_own_sky and source.base is not None and source.toml not in seen:
        seen.add(source.toml)
        try:
            source = resolve_source(source.base, reader)
        except (SceneError, OSError):  # reported on loading
            return None
    return source.settings.sun


def sky_table(sky: str | Path) -> SkyTable:
    """Sky table from the name "clear" or from the path of an environment map.

    Raises:
        SceneError: neither "clear" nor an existing environment map.
    """
    if sky == CLEAR_SKY:
        return SkyTable()
    path = Path(sky)
    if not path.is_file():
        raise SceneError(
            f"sky {str(sky)!r}: expected {CLEAR_SKY!r}, {NO_SKY!r} or an environment map (.hdr, "
            ".exr), got no file"
        )
    return SkyTable(file=str(path))


def resolve_source(source: str | Path, reader: SourceReader | None = None) -> SceneSource:
    """Files of a scene, from its path or built-in name; `reader` reads its TOML file.

    Raises:
        SceneError: a missing file or a faulty TOML file.
    """
    if not isinstance(source, str | Path):
        raise SceneError(f"scene: expected a path or a name, got {type(source).__name__}")
    reader, path, name = reader or SourceReader(), Path(source), str(source)
    if (path / "scene.toml").is_file():
        path = path / "scene.toml"
    if not path.is_file() and name in builtin_scenes():
        path = SCENES / name / "scene.toml"
    if path.is_dir():
        path = _gazebo_model(path, reader)
    try:
        path.stat()  # from Python 3.14 on, `exists` returns false for every error
    except (FileNotFoundError, NotADirectoryError, ValueError):
        hint = did_you_mean(name, builtin_scenes(), "built-in:")
        raise SceneError(f"{name}: no such scene file, and no built-in scene; {hint}") from None
    if not path.is_file():
        raise SceneError(f"{path}: is not a regular file")
    if path.suffix.lower() != ".toml":
        return SceneSource(name, path, SceneFile(file=path.name), None)
    tables = read_tables(path, SceneError)
    reader.note_table(path, tables)
    settings = parse_table(tables, SceneFile, SceneError, str(path))
    if settings.file is None:
        return SceneSource(name, None, settings, path)
    mesh_file = find_beside(path.parent, settings.file, f"{path}: file", SceneError)
    return SceneSource(name, mesh_file, settings, path)


def _gazebo_model(folder: Path, reader: SourceReader) -> Path:
    """Model file in a Gazebo model folder."""
    from omnisim.scene.formats.sdf.models import MANIFESTS, model_file  # XML parser

    manifests = (*MANIFESTS, "model.sdf")
    is_model = any((folder / name).is_file() for name in manifests)
    file = model_file(folder, reader) if is_model else None
    if file is None:
        raise SceneError(
            f"{folder}: expected a scene file, got a folder without a scene.toml or model.config"
        )
    return file
