"""Scene loading, from a file or by built-in name, into the world frame."""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import NoticeWarning, SceneError, did_you_mean, printable
from omnisim.core.files.parameters import parse_table
from omnisim.core.files.sources import SourceReader, source_digest
from omnisim.core.files.toml_file import base_source, find_beside, read_tables
from omnisim.core.package_files import SCENES, built_in
from omnisim.scene import model
from omnisim.scene.files import extension
from omnisim.scene.files.readers import check_format, read_file
from omnisim.scene.files.scene_file import SceneFile
from omnisim.scene.formats.gltf.nodes import NO_ANIMATION, AnimationChoice
from omnisim.scene.formats.imported_scene import FileAxes, ImportedScene, place, place_links
from omnisim.scene.identity import SourceDigests
from omnisim.scene.labels import label_rules
from omnisim.scene.light.baked import with_baked_light
from omnisim.scene.light.light_tables import SkyTable, SunTable
from omnisim.scene.light.lighting import DEFAULT_BACKGROUND, expose, with_environment
from omnisim.scene.light.sky import with_sky
from omnisim.scene.space.start_pose import default_start, find_start

MAX_NOTICE = 300
MAX_HEIGHT_M = 75.0  # of scenes without a note on their size
ROOM_HEIGHT_M = 2.7
UNITS = {"millimeters": 0.001, "centimeters": 0.01}
_LIGHT_KEYS = {"background", "light", "lamps", "sun", "sky"}
NO_BAKED_LIGHT = "none"  # in place of a folder name
CLEAR_SKY = "clear"
NO_SKY = "none"  # in place of a sky: even light


def load_scene(
    source: str | Path,
    up_axis: str | None = None,
    meters_per_unit: float | None = None,
    resources: Sequence[str | Path] = (),
    animation: str | None = None,
    sky: str | Path | None = None,
    baked: str | Path | None = None,
) -> model.Scene:
    """Load a scene from a mesh file, a scene TOML file or a built-in name.

    The world is in meters with z up: a Y-up point (x, y, z) becomes (x, −z, y).

    Args:
        source: file path or built-in name.
        up_axis: up axis of the file, "x", "y" or "z"; None: the format's (glTF and OBJ: y; COLLADA:
            from the file; others: z).
        meters_per_unit: size of the file's unit in meters; None: the format's (COLLADA: from the
            file; 3MF: 0.001; others: 1). Poses in a scene's TOML file stay in meters.
        resources: folders of the models and packages that the scene references by URI, searched
            before those of the environment variables.
        animation: name of the glTF animation to play, "none" for none; None: the one in the TOML
            file, or else the first. Animated parts become dynamic objects.
        sky: "clear" or an environment map (.hdr, .exr), in place of the TOML file's sky and sun;
            "none" for neither; None: those of the TOML file. A clear sky takes its sun from the
            TOML file, if there is one.
        baked: folder of baked light, "none" for none; None: that of the TOML file, if any.

    Each notice of the scene is also issued as a `NoticeWarning`.

    Raises:
        SceneError: the file is missing, empty, damaged or in an unknown format, or has no geometry.
    """
    scene = read_scene(source, up_axis, meters_per_unit, resources, animation, sky, baked)
    for notice in scene.notices:
        warnings.warn(notice, NoticeWarning, stacklevel=2)
    return scene


def read_scene(
    source: str | Path,
    up_axis: str | None = None,
    meters_per_unit: float | None = None,
    resources: Sequence[str | Path] = (),
    animation: str | None = None,
    sky: str | Path | None = None,
    baked: str | Path | None = None,
    reader: SourceReader | None = None,
) -> model.Scene:
    """Load a scene like `load_scene` but without warnings, for callers that print its notices.

    Args:
        source, up_axis, meters_per_unit, resources, animation, sky, baked: see `load_scene`.
        reader: reader of more than the scene, such as a robot, which remembers its files, too.

    Raises:
        SceneError: see `load_scene`.
    """
    options = _Options(
        FileAxes(up_axis, meters_per_unit),
        tuple(map(Path, resources)),
        animation,
        sky=None if sky is None or str(sky) == NO_SKY else _sky_table(sky),
        keeps_sky=sky is None,
        takes_baked=baked is None and sky is None,
    )
    own_reader, bake_reader = SourceReader(), SourceReader()
    files = _resolve(source, own_reader)
    scene, light = _build(files, options, own_reader)
    bake = None if baked is None or str(baked) == NO_BAKED_LIGHT else Path(baked)
    if bake is not None:
        scene = with_baked_light(scene, bake, bake_reader, light)
    if reader is not None:
        reader.update(own_reader)
        reader.update(bake_reader)
    content = source_digest(own_reader.digest(files.folder), options)
    identity = SourceDigests(content, light)
    if bake is not None:
        identity = identity.baked(bake_reader.digest(bake))
    return scene.identified(identity)


class _Options(NamedTuple):
    """Options that override the files."""

    axes: FileAxes
    resources: tuple[Path, ...]
    animation: str | None
    is_shape: bool = False  # load geometry only: no start pose, no nested objects
    sky: SkyTable | None = None  # sky in place of those of the TOML files
    keeps_sky: bool = True  # use the skies and suns of the TOML files
    takes_baked: bool = False  # use the baked light of the scene's own TOML file


class _Built(NamedTuple):
    """Scene from files, before it is identified."""

    scene: model.Scene
    light: str  # digest of the inputs of its light: those of the mesh file, and keys that change it


def _resolve(source: str | Path, reader: SourceReader) -> SceneSource:
    try:
        return resolve_source(source, reader)
    except OSError as reason:  # a name too long, or a folder without permission
        raise SceneError(f"{source}: cannot be read: {reason.strerror}") from None


def _build(
    files: SceneSource, options: _Options, reader: SourceReader, outer: tuple[Path, ...] = ()
) -> _Built:
    """Build the scene of files that the outer TOML files extend, or use as the shape of an object.

    It depends on nothing but the arguments and the files that `reader` reads.
    """
    if not options.keeps_sky:  # also of the base scenes; a clear sky keeps the files' sun
        sky = None if outer else options.sky
        is_clear = sky is not None and sky.file is None
        files = files.with_sky(sky, _shining_sun(files, reader) if is_clear else None)
    folder = Path() if options.sky is not None or files.toml is None else files.folder
    if files.toml is None:
        return _lit(_build_mesh_file(files, options, reader), files, folder, reader)
    path = files.toml.resolve()
    if path in outer:
        raise SceneError(f"{files.toml}: extends itself, or has itself as an object")
    outer = (*outer, path)
    if files.settings.extends is None:
        built = _build_mesh_file(files, options, reader)
    else:
        built = _build_extended(files, options, reader, outer)
    built = _with_materials(built, files, options, reader, outer)
    scene, light = _lit(built, files, folder, reader)

    def load_shape(path: Path, axis: str | None, animation: str | None) -> model.Scene:
        played = animation or NO_ANIMATION
        shape = _Options(FileAxes(axis), options.resources, played, is_shape=True, keeps_sky=False)
        return _build(_resolve(path, reader), shape, reader, outer).scene

    try:
        objects = tuple(
            extension.load_object(table, files.folder, load_shape, reader)
            for table in files.settings.objects
        )
    except SceneError as reason:
        raise SceneError(f"{files.toml}: {reason}") from None
    scene = extension.with_objects(scene, objects, str(files.toml))
    baked = files.settings.light.baked
    if baked is not None and options.takes_baked:
        scene = with_baked_light(scene, files.folder / baked, reader, light)
    return _Built(scene, light)


def _lit(built: _Built, files: SceneSource, folder: Path, reader: SourceReader) -> _Built:
    """Scene lit by its settings; its light follows from their keys and from the sky's map."""
    settings, sky_reader = files.settings, SourceReader()
    scene = extension.lit_scene(built.scene, settings)
    if settings.sky is not None:
        toml = str(files.toml or files.mesh_file)
        scene = with_sky(
            scene, settings.sky, settings.light, settings.sun, toml, folder, sky_reader
        )
        reader.update(sky_reader)
    keys = settings.model_dump(
        mode="json", include=_LIGHT_KEYS, exclude_defaults=True, exclude={"light": {"baked"}}
    )
    if settings.sky is not None:  # of a map, the content counts, not its path
        keys["sky"] = settings.sky.model_dump(mode="json", exclude={"file"})
    keys = {key: value for key, value in keys.items() if value or key == "sky"}
    light = source_digest(built.light, keys, sky_reader.digest(folder)) if keys else built.light
    return _Built(scene, light)


def _build_extended(
    files: SceneSource, options: _Options, reader: SourceReader, outer: tuple[Path, ...]
) -> _Built:
    """Build the base scene that a TOML file extends, and add the TOML file's content."""
    settings = files.settings
    assert files.base is not None
    if settings.has_own_light:
        options = options._replace(takes_baked=False)
    if settings.has_own_sky:
        options = options._replace(keeps_sky=False)
    try:
        base, light = _build(_resolve(files.base, reader), options, reader, outer)
    except SceneError as reason:
        raise SceneError(f"{files.toml}: extends = {settings.extends!r}: {reason}") from None
    named = dataclasses.replace(base, name=files.name)
    extended = extension.extend(base, _with_settings(named, settings), str(files.toml))
    return _Built(extended, light)


def _with_materials(
    built: _Built,
    files: SceneSource,
    options: _Options,
    reader: SourceReader,
    outer: tuple[Path, ...],
) -> _Built:
    """Scene with the materials of its settings.

    If they change the light, the baked light of the base scene does not apply.
    """
    tables, toml = files.settings.materials, files.toml
    assert toml is not None
    changed = extension.with_materials(built.scene, tables, toml)
    if not extension.changes_light(built.scene, changed):
        return _Built(changed, built.light)
    if changed.lighting.baked is not None:
        unbaked = _build_extended(files, options._replace(takes_baked=False), reader, outer)
        changed = extension.with_materials(unbaked.scene, tables, toml)
        notice = (
            f"{toml.name}: materials change the light: the base scene's baked light is not used"
        )
        changed = dataclasses.replace(changed, notices=(*changed.notices, notice))
    keys = [table.model_dump(mode="json") for table in tables]
    return _Built(changed, source_digest(built.light, keys))


def _build_mesh_file(files: SceneSource, options: _Options, reader: SourceReader) -> _Built:
    path, settings, file_reader = files.mesh_file, files.settings, SourceReader()
    assert path is not None
    up_axis, unit = options.axes
    axes = FileAxes(up_axis or settings.up_axis, settings.meters_per_unit if unit is None else unit)
    animation = settings.animation if options.animation is None else options.animation
    choice = AnimationChoice(animation, moves_objects=not options.is_shape)
    chosen = settings.urdf_materials
    try:
        check_format(path)
        if path.stat().st_size == 0:
            raise SceneError(f"{path}: is an empty file")
        try:
            read, matrix = read_file(path, file_reader, axes, options.resources, choice, chosen)
            has_unit = axes.meters_per_unit is not None
            scene = _scene(files.name, path, read, matrix, settings, options.is_shape, has_unit)
            scene = extension.with_moving_instances(scene, read.objects)
        except SceneError as reason:
            raise SceneError(f"{path}: {reason}") from None
    except OSError as reason:  # no permission, or a name too long
        raise SceneError(f"{files.name}: cannot be read: {reason.strerror}") from None
    except MemoryError:
        raise SceneError(f"{path}: needs more memory than available") from None
    reader.update(file_reader)
    moving = choice.name or True if read.objects else None
    inputs = (axes, moving) if chosen is None else (axes, moving, chosen)
    return _Built(scene, source_digest(file_reader.digest(path.parent), *inputs))


def _scene(
    name: str,
    path: Path,
    read: ImportedScene,
    matrix: Floats,
    settings: SceneFile,
    is_shape: bool,
    has_unit: bool,
) -> model.Scene:
    """Scene from a file's contents and the settings of its TOML file, which may state its unit."""
    instances = place(read, matrix)
    if not is_shape and not has_unit:
        unit = float(np.linalg.norm(matrix[:3, 0]))
        read.notices.extend(_size_notices(model.bounds_m(read.meshes, instances), unit))
    if len(read.lights) > model.MAX_LIGHTS:
        read.notices.append(
            f"has {len(read.lights)} lights: only the {model.MAX_LIGHTS} strongest are used"
        )
    # a shape needs no start pose, so the search for one is skipped
    start = (
        default_start(model.bounds_m(read.meshes, instances))
        if is_shape or settings.start is not None or read.start is not None
        else find_start(read.meshes, instances)
    )
    lighting = read.lighting or expose(read.lights, read.meshes, instances, read.dome)
    background = read.background or (lighting.ambient if read.dome else DEFAULT_BACKGROUND)
    if read.environment is not None:
        lighting = with_environment(lighting, read.environment)
    scene = model.Scene(
        name,
        read.meshes,
        read.materials,
        instances,
        lighting,
        background,
        read.start or start,
        notices=tuple(printable(f"{path.name}: {notice}", MAX_NOTICE) for notice in read.notices),
        labels=read.labels,
        cameras=read.cameras,
        links=place_links(read, matrix),
    )
    return _with_settings(scene, settings)


def _with_settings(scene: model.Scene, settings: SceneFile) -> model.Scene:
    """Scene with the shading, background, poses, landmarks and labels of its TOML file."""
    start, shading = settings.start, settings.light.shading
    return dataclasses.replace(
        scene,
        lighting=scene.lighting
        if shading is None
        else dataclasses.replace(scene.lighting, is_matte=shading == "matte"),
        background=settings.background or scene.background,
        start=scene.start if start is None else start.build(model.StartPose),
        starts=settings.starts,
        paths=settings.paths,
        landmarks=_landmarks(settings),
        labels=label_rules(settings.labels) or scene.labels,
    )


def _size_notices(bounds: Floats, meters_per_unit: float) -> list[str]:
    """Notice for a scene of an unusual size, with the unit that makes it as high as a room."""
    size = bounds[1] - bounds[0]
    if size[2] <= MAX_HEIGHT_M:  # wide floors are usual
        return []
    unit = min(UNITS, key=lambda unit: abs(math.log(size[2] * UNITS[unit] / ROOM_HEIGHT_M)))
    likely, stated = UNITS[unit] * meters_per_unit, meters_per_unit
    sides = " × ".join(f"{side:.4g}" for side in size)
    return [f"is {sides} m: if those are {unit}, set meters_per_unit = {likely:g}, else {stated:g}"]


def _landmarks(settings: SceneFile) -> tuple[model.Landmark, ...]:
    """Landmarks with the palette's colors; each band starts at the top of the previous one."""
    landmarks = []
    for table in settings.landmarks:
        bottoms_m = (0.0, *(band.top_m for band in table.bands[:-1]))
        bands = tuple(
            model.ColorBand(band.color, settings.palette[band.color], bottom_m, band.top_m)
            for bottom_m, band in zip(bottoms_m, table.bands, strict=True)
        )
        landmarks.append(model.Landmark(table.name, table.position_m, table.footprint_m, bands))
    return tuple(landmarks)


# Files of a scene by its path or built-in name.


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


def _shining_sun(source: SceneSource, reader: SourceReader) -> SunTable | None:
    """Sun of a source or of its base scenes; None: no sun, or faulty files."""
    seen = set()
    while not source.settings.has_own_sky and source.base is not None and source.toml not in seen:
        seen.add(source.toml)
        try:
            source = resolve_source(source.base, reader)
        except (SceneError, OSError):  # reported on loading
            return None
    return source.settings.sun


def _sky_table(sky: str | Path) -> SkyTable:
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
