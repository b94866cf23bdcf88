"""Tree of models: frames, nested models, and those included from files."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote
from xml.etree.ElementTree import Element

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import SceneError, did_you_mean
from omnisim.core.files.sources import SourceReader
from omnisim.core.poses import inverse
from omnisim.core.short_repr import counted
from omnisim.scene.formats.imported_scene import Omissions, unique_name
from omnisim.scene.formats.resources import ResourcePath
from omnisim.scene.formats.sdf.geometry import ROUND
from omnisim.scene.formats.xml.element import XmlElement, parse_xml, step_to

_OWN = frozenset(("", "__model__", "world", "__root__"))


class _Frame(NamedTuple):
    """Frame in a scope."""

    element: XmlElement  # element with the frame's pose
    default: str  # reference frame if the pose names none
    inner: Scope | None  # scope of a nested model; None: not a model
    # frame of the inner scope to which the pose applies; empty: the model's own frame
    placement: str


class UnplacedError(SceneError):
    """Error for a pose relative to a missing model."""


class Scope:
    """Named frames of the world or of a model; the empty name is its own frame."""

    def __init__(self) -> None:
        self._frames: dict[str, _Frame] = {}
        self.missing: set[str] = set()  # nested models; poses relative to them are undefined
        self._poses: dict[str, Floats] = {}
        self.aliases: dict[str, str] = {}  # frames of merged models by their own names
        self._active: list[str] = []

    def add(self, name: str, element: XmlElement, default: str = "") -> None:
        """Add a link, frame or joint with an element's pose, by default relative to `default`."""
        self._frames.setdefault(name, _Frame(element, default, None, ""))

    def add_model(self, name: str, element: XmlElement, inner: Scope, placement: str = "") -> None:
        """Add a nested model, to whose frame `placement`, or else own frame, the pose applies."""
        self._frames.setdefault(name, _Frame(element, "", inner, placement))

    def place(self, name: str, scope_from_frame: Floats) -> None:
        """Override the pose of a link or model from the file."""
        self._poses[name] = scope_from_frame

    def pose_of(self, element: XmlElement, default: str = "") -> Floats:
        """Pose (4, 4) scope_from_element, relative to the frame `default` if it names none.

        Raises:
            UnplacedError: a pose relative to a missing model.
            SceneError: an unknown frame, or a frame relative to itself.
        """
        return self._scope_from(element.relative_to or default, element) @ element.pose()

    def model_pose(self, name: str) -> Floats:
        """Pose (4, 4) scope_from_model of a nested model."""
        return self._scope_from(name, self._frames[name].element)

    def _scope_from(self, name: str, element: XmlElement) -> Floats:
        if name in self._poses:
            return self._poses[name]
        frame = self._frames.get(name)
        if frame is None:
            return self._outside(name, element)
        if name in self._active:
            circle = " → ".join((*self._active[self._active.index(name) :], name))
            raise element.error("frames that are not relative to themselves", circle)
        self._active.append(name)
        pose = self.pose_of(frame.element, frame.default)
        if frame.inner is not None and frame.placement:
            pose = pose @ inverse(frame.inner._scope_from(frame.placement, frame.element))
        self._active.pop()
        self._poses[name] = pose
        return pose

    def _outside(self, name: str, element: XmlElement) -> Floats:
        """Pose (4, 4) of the scope itself, or of a frame `model::frame` in a nested model."""
        if name in _OWN:
            return np.eye(4)
        name = self.aliases.get(name, name)
        outer, separator, rest = name.partition("::")
        frame = self._frames.get(outer)
        if frame is None and outer in self.missing:
            raise UnplacedError(f"{element.place}: its pose is relative to {outer!r}, not found")
        if not separator or frame is None or frame.inner is None:
            hint = did_you_mean(name, self._frames, "there are")
            raise element.error(f"the name of a frame; {hint}", name)
        inner = frame.inner._scope_from(rest, element)
        return self._scope_from(outer, element) @ inner


# Tree of models: nested ones, and those included from files.

_MAX_DEPTH = 24  # nesting depth of models
_MAX_MODELS = 200_000  # models per world: a few files with repeated includes could make billions
_SHOWN = 4  # names per notice
UNPLACED = "left out with the models that they are posed relative to"
ENTITIES = ("model", "light", "actor")


@dataclass
class Model:
    """World or model with its frames."""

    name: str  # name, unique within the enclosing model or world
    element: XmlElement  # `<world>` or `<model>` element
    scope: Scope = field(default_factory=Scope)  # frames of the world or model
    models: list[Model] = field(default_factory=list)  # nested models
    # lights and actors, including those of included files
    others: list[XmlElement] = field(default_factory=list)
    is_merged: bool = False  # its links belong to the including model
    is_static: bool = False  # its links, and those of the models in it, never move


class ModelLibrary:
    """Models by URI, each file read only once, and the parts of them that are left out."""

    def __init__(self, resources: ResourcePath, omissions: Omissions) -> None:
        self.resources, self.omissions = resources, omissions
        self._files: dict[Path, Element] = {}
        self._missing: Counter[str] = Counter()
        self._remote: Counter[str] = Counter()
        self._substitutes: set[str] = set()
        self.round_shapes = 0  # spheres, cylinders and other round shapes in all trees
        self._count = 0

    @property
    def notices(self) -> list[str]:
        """One line each for missing and for remote models, and for each substitute."""
        notices = []
        if self._missing:
            notices.append(
                f"{counted(self._missing.total(), 'object')} not found, and not drawn: "
                f"{_names(self._missing)}: pass the folder of their models as --resources"
            )
        if self._remote:
            notices.append(
                f"{counted(self._remote.total(), 'object')} not fetched from the net, and not "
                f"drawn: {_names(self._remote)}: `gz fuel download -u ADDRESS` gets them"
            )
        substitutes = sorted(self._substitutes)
        return notices + [f"{_short(uri)} not found: omnisim's own is drawn" for uri in substitutes]

    def drop_unplaced(self, model: Model) -> None:
        """Remove the nested models whose poses are relative to a missing one."""
        for inner in list(model.models):
            try:
                model.scope.model_pose(inner.name)
            except UnplacedError:
                model.models.remove(inner)
                self.omissions.count(UNPLACED, "model")
            else:
                self.drop_unplaced(inner)

    def used_folders(self, root: XmlElement) -> tuple[Path, ...]:
        """Folders required by a file and its models, except those around the file."""
        roots = (root.element, *self._files.values())
        texts = {(one.text or "").strip() for each in roots for one in each.iter()}
        return self.resources.used(sorted(text for text in texts if "://" in text))

    def miss(self, uri: str) -> None:
        """Count a missing object."""
        (self._remote if uri.startswith(("http://", "https://")) else self._missing)[uri] += 1

    def tree(self, element: XmlElement, name: str, depth: int = 0) -> Model:
        """Model or world with everything it includes."""
        self._count += 1
        if depth > _MAX_DEPTH or self._count > _MAX_MODELS:
            raise element.error(f"at most {_MAX_DEPTH} models in each other", "more, or a circle")
        model = Model(name, element, is_static=element.flag("static"))
        used_names: set[str] = set()
        for child in element.children("model", "include"):
            if child.element.tag == "include":
                self._include(model, child, used_names, depth)
            else:
                name = unique_name(child.name or "model", used_names)
                model.models.append(self.tree(child, name, depth + 1))
                placement = child.attribute("placement_frame")
                model.scope.add_model(name, child, model.models[-1].scope, placement)
        for link in element.children("link"):
            model.scope.add(link.name, link)
            shapes = (visual.find("geometry") for visual in link.children("visual"))
            self.round_shapes += sum(
                one.tag in ROUND for shape in shapes if shape is not None for one in shape.element
            )
        for frame in element.children("frame"):
            model.scope.add(frame.name, frame, frame.attribute("attached_to"))
        for joint in element.children("joint"):
            model.scope.add(joint.name, joint, joint.text("child"))
        model.others += element.children("light", "actor")
        return model

    def _include(self, model: Model, include: XmlElement, used_names: set[str], depth: int) -> None:
        entity = self._included(include)
        if entity is None:
            model.scope.missing.add(include.text("name") or _last_part(include.text("uri")))
            return
        posed = include if include.find("pose") is not None else entity
        if entity.element.tag != "model":
            model.others.append(with_pose_of(entity, posed))
            return
        is_merged = include.attribute("merge").lower() in ("true", "1")
        name = unique_name(include.text("name") or entity.name or "model", used_names)
        inner = self.tree(entity, name, depth + 1)
        inner.is_merged = is_merged
        inner.is_static = include.flag("static", inner.is_static)
        model.models.append(inner)
        placement = include.text("placement_frame") or entity.attribute("placement_frame")
        first, _, rest = placement.partition("::")
        frames = {child.name for child in entity.children("link", "frame", "joint", "model")}
        if first in (name, entity.name) and first not in frames:  # the model itself
            placement = rest
        model.scope.add_model(name, posed, inner.scope, placement)
        if is_merged:
            for frame in entity.children("link", "frame", "joint", "model"):
                model.scope.aliases.setdefault(frame.name, f"{name}::{frame.name}")

    def _included(self, include: XmlElement) -> XmlElement | None:
        """First entity of an included file; None: the file is missing, and is counted."""
        uri = include.text("uri")
        if not uri:
            raise include.error("a <uri>", "none")
        path = self.resources.find(uri, include.file.parent)
        if path is not None and path.is_dir():
            path = model_file(path, self.resources.reader)
        if path is None:
            name = _last_part(uri).lower().replace(" ", "_")
            if name not in BUILTIN_MODELS:
                self.miss(uri)
                return None
            self._substitutes.add(uri)
            substitute = parse_xml(BUILTIN_MODELS[name].encode())
            return XmlElement(substitute, f"{uri}: {substitute.tag}", Path(name))
        if path not in self._files:
            self._files[path] = read_xml(path, self.resources.reader)
        entity = next((child for child in self._files[path] if child.tag in ENTITIES), None)
        if entity is None:
            raise include.error(f"a model, light or actor in {path}", uri)
        return XmlElement(entity, f"{path}: {step_to(entity)}", path)


def _names(uris: Counter[str]) -> str:
    """Most frequent URIs in short form, and the number of others."""
    counts: Counter[str] = Counter()
    for uri, count in uris.items():
        counts[_short(uri)] += count
    most = counts.most_common(_SHOWN)
    shown = [name if count == 1 else f"{name} × {count}" for name, count in most]
    if more := len(counts) - len(shown):
        shown.append(f"and {counted(more, 'other')}")
    return ", ".join(shown)


def _short(uri: str) -> str:
    """Owner and name of a Gazebo Fuel model; other URIs unchanged."""
    match = re.match(r"https?://[^/]+/[\d.]+/([^/]+)/models/([^/]+)", uri)
    return uri if match is None else f"{match[1]}/{unquote(match[2])}"


def _last_part(uri: str) -> str:
    return unquote(uri.strip("/").rpartition("/")[2])


def with_pose_of(entity: XmlElement, posed: XmlElement) -> XmlElement:
    """Entity with the pose of another element, such as its `<include>`."""
    pose = posed.element.find("pose")
    if posed is entity or pose is None:
        return entity
    copy = Element(entity.element.tag, entity.element.attrib)
    copy.extend([pose, *(child for child in entity.element if child.tag != "pose")])
    return entity._replace(element=copy)


class PlacedModel(NamedTuple):
    """Model in the frame of an outer one."""

    path: str  # names of the enclosing models, each followed by a slash; merged models are omitted
    model: Model  # placed model
    outer_from_model: Floats  # (4, 4) pose
    is_static: bool  # it, or a model around it, never moves

    def pose_of(self, element: XmlElement, default: str = "") -> Floats:
        """Pose (4, 4) outer_from_element, relative to the frame `default` if it names none."""
        return self.outer_from_model @ self.model.scope.pose_of(element, default)


def placed_models(
    model: Model, outer_from_model: Floats | None = None, path: str = "", is_static: bool = False
) -> Iterator[PlacedModel]:
    """World or model with all models in it; the default outer frame is its own."""
    own = np.eye(4) if outer_from_model is None else outer_from_model
    is_static |= model.is_static
    yield PlacedModel(path, model, own, is_static)
    for inner in model.models:
        pose = own @ model.scope.model_pose(inner.name)
        name = path if inner.is_merged else f"{path}{inner.name}/"
        yield from placed_models(inner, pose, name, is_static)


def read_root(path: Path, data: bytes | None = None) -> XmlElement:
    """Read the `<sdf>` of a file.

    Raises:
        SceneError: an unreadable file, or another root element.
    """
    try:
        root = parse_xml(path.read_bytes() if data is None else data)
    except OSError as reason:
        raise SceneError(f"cannot be read: {reason.strerror}") from None
    if root.tag != "sdf":
        raise SceneError(f"expected <sdf>, got <{root.tag}>")
    return XmlElement(root, "", path)


# Substitutes for models that Gazebo Classic worlds expect to be installed.

BUILTIN_MODELS = {
    "sun": """
        <light name="sun" type="directional">
          <pose>0 0 10 0 0 0</pose>
          <cast_shadows>true</cast_shadows>
          <diffuse>0.8 0.8 0.8 1</diffuse>
          <direction>-0.5 0.1 -0.9</direction>
        </light>""",
    "ground_plane": """
        <model name="ground_plane">
          <link name="link">
            <visual name="visual">
              <geometry><plane><normal>0 0 1</normal><size>100 100</size></plane></geometry>
              <material><diffuse>0.5 0.5 0.5 1</diffuse></material>
            </visual>
          </link>
        </model>""",
}


# Folders of Gazebo models, whose SDF files are listed in `model.config`.

MANIFESTS = ("model.config", "manifest.xml")


def model_file(folder: Path, reader: SourceReader) -> Path | None:
    """SDF file in a model folder, of the latest version listed in its `model.config`.

    Raises:
        SceneError: the `model.config` is damaged.
    """
    manifest = next((path for name in MANIFESTS if (path := folder / name).is_file()), None)
    named = []
    if manifest is not None:
        entries = [entry for entry in read_xml(manifest, reader).iter("sdf") if entry.text]
        entries.sort(key=lambda entry: _numbers(entry.get("version") or ""), reverse=True)
        named = [(entry.text or "").strip() for entry in entries]
    for name in (*named, "model.sdf"):
        if (folder / name).is_file():
            return folder / name
    return next(iter(sorted(folder.glob("*.sdf"))), None)


def read_xml(path: Path, reader: SourceReader) -> Element:
    """Root of an XML file."""
    try:
        return parse_xml(reader.read(path))
    except OSError as reason:
        raise SceneError(f"{path}: cannot be read: {reason.strerror}") from None
    except SceneError as reason:
        raise SceneError(f"{path}: {reason}") from None


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split(".") if part.isdecimal())
