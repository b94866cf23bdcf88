"""Reader of USD stages as scene contents, in the current process."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pxr import Ar, Kind, Tf, Usd, UsdGeom, UsdPhysics, UsdShade

from omnisim.cameras import CentralCamera
from omnisim.core.arrays import Floats, Ints
from omnisim.core.errors import SceneError
from omnisim.core.files.sources import SourceReader
from omnisim.ground_truth.label_names import distinct_color
from omnisim.scene.formats.features import Parts, feature_table, part_notices
from omnisim.scene.formats.imported_scene import (
    Cameras,
    FileAxes,
    ImportedScene,
    Omissions,
    pinhole,
    read_lens,
    translate,
    world_from_axes,
)
from omnisim.scene.formats.resources import AssetResolver
from omnisim.scene.formats.usd.gprims import Gprims, integers, is_shape, texts
from omnisim.scene.formats.usd.lights import Lights, is_light
from omnisim.scene.formats.usd.surfaces import Surfaces, TextureFiles
from omnisim.scene.parts import Instance, LabelRule, Link, StartPose
from omnisim.scene.textures import TextureStore, large_textures

MAX_INSTANCES = 1_000_000
MAX_NESTED = 16  # nesting depth of point instancers


def read_stage(path: Path, axes: FileAxes, reader: SourceReader) -> tuple[ImportedScene, Floats]:
    """Read a stage; see `omnisim.scene.formats.usd.reader.read_usd`."""
    try:
        with large_textures():
            return _Reader(path, axes, reader).read()
    except Tf.ErrorException as reason:
        text = " ".join(str(reason.args[0].commentary if reason.args else reason).split())
        raise SceneError(f"cannot be read as USD: {text}") from None


class _PlacedMesh(NamedTuple):
    """Scene mesh at a pose, with the object that contains it."""

    name: str
    mesh: int
    frame_from_mesh: Floats
    frame_from_object: Floats
    class_name: str = ""


class _Reader:
    """Reader of one stage."""

    def __init__(self, path: Path, axes: FileAxes, reader: SourceReader):
        self._notices, self._reader = Omissions(), reader
        self._assets, self._textures = AssetResolver(path, reader), TextureStore()
        self._stage = open_stage(path, self._notices)
        reader.note(path)
        # the first frame, or else the earliest time of each attribute
        self._time = Usd.TimeCode.EarliestTime()
        if self._stage.HasAuthoredTimeCodeRange():
            self._time = Usd.TimeCode(self._stage.GetStartTimeCode())
        unit, up_axis = UsdGeom.GetStageMetersPerUnit(self._stage), axes.up_axis
        if not 0.0 < unit < 1e30:
            raise SceneError(f"metersPerUnit = {unit:g}: expected a number > 0")
        unit = unit if axes.meters_per_unit is None else axes.meters_per_unit
        up_axis = up_axis or str(UsdGeom.GetStageUpAxis(self._stage)).lower() or "y"
        self._world_from_stage = world_from_axes(up_axis, unit)
        files = TextureFiles(self._assets, self._textures, self._notices)
        surfaces = Surfaces(files, self._time, self._notices)
        self._gprims = Gprims(surfaces, self._time, unit, self._notices)
        self._lights = Lights(self._world_from_stage, self._time, self._notices, reader)
        self._children = Usd.TraverseInstanceProxies()
        roots = self._stage.GetPseudoRoot().GetChildren()
        alone = roots[0] if len(roots) == 1 else None
        self._whole = self._stage.GetDefaultPrim() or alone  # contains the whole stage
        self._start: StartPose | None = None
        self._cameras = Cameras()
        self._links: dict[str, Link] = {}  # by path
        self._copies_of: dict[str, list[_PlacedMesh]] = {}
        self._names: Counter[str] = Counter()

    def read(self) -> tuple[ImportedScene, Floats]:
        """Read everything that is drawn, and the transform (4, 4) world_from_stage."""
        placed = self._placed(self._stage.GetPseudoRoot(), np.eye(4), 0)
        instances = tuple(Instance(*mesh[:4]) for mesh in placed)
        class_of = {mesh.name: mesh.class_name for mesh in placed if mesh.class_name}
        read = ImportedScene(
            tuple(self._gprims.meshes),
            tuple(self._gprims.materials),
            instances,
            [],
            tuple(self._lights.lights),
            dome=self._lights.dome,
            environment=self._lights.environment,
            start=self._start,
            cameras=self._cameras.poses,
            links=self._fixed_links(),
            labels=tuple(
                LabelRule(
                    number,
                    name,
                    distinct_color(number),
                    tuple(each for each, own in class_of.items() if own == name),
                )
                for number, name in enumerate(sorted(set(class_of.values())), start=1)
            ),
        )
        read.notices.extend((*self._assets.notices, *self._textures.notices))
        read.notices.extend(self._notices.notices)
        read.notices.extend(part_notices("usd", stage_parts(self._stage, self._time)))
        read.notices.extend(self._cameras.notices)
        for layer in self._stage.GetUsedLayers():
            if layer.realPath:
                self._reader.note(Path(Ar.SplitPackageRelativePathOuter(layer.realPath)[0]))
        return read, self._world_from_stage

    def _placed(self, root: Usd.Prim, frame_from_parent: Floats, nested: int) -> list[_PlacedMesh]:
        placed: list[_PlacedMesh] = []
        owners: dict[str, str] = {}  # object names by path
        for site in self._sites(root, frame_from_parent):
            prim = site.prim
            if not nested and is_rigid_body(prim):
                has_frame = site.owner is not None and site.owner.path == str(prim.GetPath())
                name = self._object(site, owners)[0] if has_frame else self._path_name(prim)
                self._links[str(prim.GetPath())] = Link(name, site.stage_from_prim, name)
            if is_light(prim):
                if not nested:
                    self._lights.add(prim, site.stage_from_prim)
            elif prim.IsA(UsdGeom.Camera):
                world_from_camera = self._world_from_stage @ site.stage_from_prim
                self._start = self._start or start_of_camera(world_from_camera)
                lens = read_lens(partial(lens_of, prim, self._time))
                self._cameras.add(self._path_name(prim), world_from_camera, lens)
            elif prim.IsA(UsdGeom.PointInstancer) or prim.IsA(UsdGeom.Mesh) or is_shape(prim):
                if not site.is_drawn:
                    self._notices.count(f"geometry for the purpose {site.purpose} is not drawn")
                elif prim.IsA(UsdGeom.PointInstancer):
                    placed += self._copies(site, owners, nested)
                elif parts := self._gprims.parts(prim):
                    name, frame, class_name = self._object(site, owners)
                    placed += [
                        _PlacedMesh(
                            name, part.mesh, translate(site.stage_from_prim, part.center), frame,
                            class_name,
                        )
                        for part in parts
                    ]  # fmt: skip
            elif prim.IsA(UsdGeom.Gprim):
                self._notices.count(f"{prim.GetTypeName()} is not drawn")
            if len(placed) > MAX_INSTANCES:
                raise SceneError(f"expected at most {MAX_INSTANCES:,} meshes in the scene")
        return placed

    def _fixed_links(self) -> tuple[Link, ...]:
        """Rigid bodies; those of fixed joints know to which one they are fixed."""
        fixed_to = {}
        for prim in self._stage.Traverse():
            if prim.IsA(UsdPhysics.FixedJoint):
                joint = UsdPhysics.Joint(prim)
                first, second = joint.GetBody0Rel().GetTargets(), joint.GetBody1Rel().GetTargets()
                bodies = [self._links.get(str(path)) for path in (*first[:1], *second[:1])]
                known = [link for link in bodies if link is not None]
                if known:
                    fixed_to[known[-1].name] = known[0].name if len(known) == 2 else ""
        return tuple(
            replace(link, fixed_to=fixed_to.get(link.name, link.name))
            for link in self._links.values()
        )

    def _object(self, site: Site, owners: dict[str, str]) -> tuple[str, Floats, str]:
        """Name, frame (4, 4) and class of the object that contains a prim.

        Without such an object: name and frame of the prim itself, and no class.
        """
        owner = site.owner
        if owner is None:
            return self._distinct(self._path_name(site.prim)), site.stage_from_prim, ""
        if owner.path not in owners:
            owners[owner.path] = self._distinct(owner.name)
        return owners[owner.path], owner.stage_from_object, owner.class_name

    def _copies(self, site: Site, owners: dict[str, str], nested: int) -> list[_PlacedMesh]:
        if nested >= MAX_NESTED:
            expected = f"at most {MAX_NESTED} levels of nested point instancers"
            raise SceneError(f"{site.prim.GetPath()}: expected {expected}")
        placed: list[_PlacedMesh] = []
        for copies in read_copies(UsdGeom.PointInstancer(site.prim), self._time):
            path = str(copies.prototype.GetPath())
            if path not in self._copies_of:
                self._copies_of[path] = self._placed(copies.prototype, np.eye(4), nested + 1)
            parts = self._copies_of[path]
            if len(placed) + len(parts) * len(copies.numbers) > MAX_INSTANCES:
                raise SceneError(f"expected at most {MAX_INSTANCES:,} meshes in the scene")
            with np.errstate(all="ignore"):
                frames = site.stage_from_prim @ copies.instancer_from_copies
                poses = [frames @ part.frame_from_mesh for part in parts]
            for row, frame in enumerate(frames):
                if site.owner is None:
                    name = self._distinct(f"{copies.prototype.GetName()}_{copies.numbers[row]}")
                    of_part = [(name, frame, part.class_name) for part in parts]
                else:
                    of_part = [self._object(site, owners)] * len(parts)
                placed += [
                    _PlacedMesh(part_name, part.mesh, pose[row], part_frame, class_name)
                    for part, pose, (part_name, part_frame, class_name) in zip(
                        parts, poses, of_part, strict=True
                    )
                ]
        return placed

    def _distinct(self, name: str) -> str:
        """Name with a number appended if another object already has it."""
        count = self._names[name]
        self._names[name] += 1
        return name if not count else self._distinct(f"{name}_{count}")

    def _sites(self, root: Usd.Prim, stage_from_parent: Floats) -> Iterator[Site]:
        """Sites of a prim and its visible descendants, parents first, but below PointInstancers."""
        stack = [(Site(root, stage_from_parent), 0)]
        while stack:
            parent, depth = stack.pop()
            site = parent if parent.prim.IsPseudoRoot() else self._site(parent)
            if site is None:
                continue
            if depth > MAX_DEPTH:
                raise SceneError(
                    f"{site.prim.GetPath()}: expected at most {MAX_DEPTH} nested prims"
                )
            yield site
            if site.prim.IsA(UsdGeom.PointInstancer) or site.prim.IsA(UsdShade.Material):
                continue
            children = site.prim.GetFilteredChildren(self._children)
            stack += [(site._replace(prim=child), depth + 1) for child in reversed(children)]

    def _path_name(self, prim: Usd.Prim) -> str:
        """Path of a prim, relative to the prim that contains the whole stage."""
        path = prim.GetPath()
        if self._whole and path != self._whole.GetPath() and path.HasPrefix(self._whole.GetPath()):
            return str(path.MakeRelativePath(self._whole.GetPath()))
        return str(path).lstrip("/")

    def _site(self, inherited: Site) -> Site | None:
        """Site of a prim, from its parent's pose, purpose and object; None: invisible."""
        prim, owner = inherited.prim, inherited.owner
        imageable = UsdGeom.Imageable(prim)
        if not imageable:
            return inherited
        if imageable.GetVisibilityAttr().Get(self._time) == UsdGeom.Tokens.invisible:
            self._notices.count("invisible prims are not drawn")
            return None
        purpose = imageable.GetPurposeAttr()
        matrix = self._stage_from_prim(prim, inherited.stage_from_prim)
        class_name, kind = semantic_class(prim, self._time), Usd.ModelAPI(prim).GetKind()
        is_component = bool(kind) and Kind.Registry.IsA(kind, Kind.Tokens.component)
        if class_name or (owner is None and prim != self._whole and is_component):
            owner = ObjectFrame(prim.GetName(), str(prim.GetPath()), matrix, class_name or "")
        elif owner is not None and is_rigid_body(prim):  # a part that moves on its own
            inner = str(prim.GetPath()).removeprefix(f"{owner.path}/")
            owner = ObjectFrame(
                f"{owner.name}/{inner}", str(prim.GetPath()), matrix, owner.class_name
            )
        return Site(
            prim,
            matrix,
            str(purpose.Get()) if purpose.HasAuthoredValue() else inherited.purpose,
            owner,
        )

    def _stage_from_prim(self, prim: Usd.Prim, stage_from_parent: Floats) -> Floats:
        form = UsdGeom.Xformable(prim)
        if not form:
            return stage_from_parent
        # usd-core's matrices multiply row vectors
        parent_from_prim = np.array(form.GetLocalTransformation(self._time)).T
        if form.TransformMightBeTimeVarying():
            self._notices.count("animation: rests at its first frame")
        with np.errstate(all="ignore"):
            if form.GetResetXformStack():
                return parent_from_prim
            return stage_from_parent @ parent_from_prim


# Traversal of a stage: visible prims, their poses, and the objects that contain them.

MAX_DEPTH = 500  # nesting depth of prims, which Sdf paths do not limit
_DRAWN = (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)


class ObjectFrame(NamedTuple):
    """Object that contains prims: a component, or a prim with a class."""

    name: str
    path: str
    stage_from_object: Floats  # (4, 4) transform
    class_name: str = ""  # semantic class; empty: none


def is_rigid_body(prim: Usd.Prim) -> bool:
    """True for a prim that a physics engine moves."""
    return bool(prim.HasAPI(UsdPhysics.RigidBodyAPI))


class Site(NamedTuple):
    """Prim with its inherited properties."""

    prim: Usd.Prim  # the prim itself, or its proxy in an instance
    stage_from_prim: Floats  # (4, 4) transform
    purpose: str = UsdGeom.Tokens.default_  # purpose of UsdGeomImageable
    owner: ObjectFrame | None = None  # object that contains the prim; None: no object

    @property
    def is_drawn(self) -> bool:
        """True for the purposes default and render."""
        return self.purpose in _DRAWN


# Semantic classes of prims: UsdSemantics, and Omniverse's older schema.

_LABELS = "semantics:labels:"
_TAXONOMIES = ("class", "category")  # in order of preference
_OLDER_TYPE, _OLDER_DATA = ":params:semanticType", ":params:semanticData"


def semantic_class(prim: Usd.Prim, time: Usd.TimeCode) -> str | None:
    """Class stated by a prim itself; None: no class."""
    names = [name for name in prim.GetAppliedSchemas() if name.startswith("Semantics")]
    if not names:
        return None
    for taxonomy in _TAXONOMIES:
        labels = prim.GetAttribute(_LABELS + taxonomy)
        values = texts(labels.Get(time)) if labels else []
        if values:
            return values[0]
    for name in names:
        prefix = "semantic:" + name.partition(":")[2]
        kind, data = (prim.GetAttribute(prefix + end) for end in (_OLDER_TYPE, _OLDER_DATA))
        if kind and data and kind.Get(time) == "class" and data.Get(time):
            return str(data.Get(time))
    return None


# Point instancers: prototypes at many poses.


class Copies(NamedTuple):
    """Copies of a prototype."""

    prototype: Usd.Prim  # root prim of the prototype
    numbers: Ints  # (n,) indices of the copies within the instancer
    instancer_from_copies: Floats  # (n, 4, 4) transforms


def read_copies(instancer: UsdGeom.PointInstancer, time: Usd.TimeCode) -> list[Copies]:
    """Visible copies of each prototype of an instancer."""
    prim = instancer.GetPrim()
    targets = instancer.GetPrototypesRel().GetForwardedTargets()
    rows = integers(instancer.GetProtoIndicesAttr().Get(time))
    if not len(rows):
        return []
    if rows.min() < 0 or rows.max() >= len(targets):
        raise SceneError(
            f"{prim.GetPath()}.protoIndices: expected numbers below {len(targets)}, as there are "
            f"prototypes, got {rows.max() if rows.min() >= 0 else rows.min()}"
        )
    poses = instancer.ComputeInstanceTransformsAtTime(
        time, time, UsdGeom.PointInstancer.ExcludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
    )
    # usd-core's matrices multiply row vectors
    matrices = np.array(poses, dtype=np.float64).reshape(-1, 4, 4).swapaxes(1, 2)
    if len(matrices) != len(rows):
        raise SceneError(
            f"{prim.GetPath()}: expected as many positions, orientations and scales as "
            f"protoIndices, {len(rows)}"
        )
    visible = np.array(instancer.ComputeMaskAtTime(time) or np.ones(len(rows)), dtype=bool)
    copies = []
    for row, target in enumerate(targets):
        prototype = prim.GetStage().GetPrimAtPath(target)
        chosen = np.flatnonzero((rows == row) & visible)
        if prototype and len(chosen):
            copies.append(Copies(prototype, chosen, matrices[chosen]))
    return copies


# Opening of USD stages, with usd-core's errors as one-line messages.

_LIGHTS = ("SphereLight", "DiskLight", "RectLight", "CylinderLight", "DistantLight", "DomeLight")
_READ_TYPES = ("Mesh", "Camera", *_LIGHTS)  # types all of whose properties are looked at
_MAX_FAULT = 200  # characters of usd-core's message


def open_stage(path: Path, notices: Omissions) -> Usd.Stage:
    """Open a stage with all payloads; missing references become notices."""
    try:
        stage = Usd.Stage.Open(str(path.resolve()), Usd.Stage.LoadAll)
    except Tf.ErrorException as reason:
        texts = [" ".join(str(error.commentary).split()) for error in reason.args]
        text = next((text for text in texts if not text.startswith("Failed to open layer")), "")
        text = re.sub(r"parse error matching .*?(?= at ')", "syntax error", text)  # parser's types
        text = _relative(text, path)[:_MAX_FAULT]  # without the path, which is named already
        text = text or "is damaged, or not in the format of its suffix"
        raise SceneError(f"cannot be read as USD: {text}") from None
    for error in stage.GetCompositionErrors():
        text = _relative(str(error), path)
        if ".mtlx" in text:
            notices.count("files of MaterialX are not read", "reference")
        else:
            notices.add(f"{text}: drawn without it")
    # a layer may have another unit or up axis than the stage: USD does not convert, and viewers do
    # not either
    axes = ("metersPerUnit", UsdGeom.GetStageMetersPerUnit(stage)), (
        "upAxis", UsdGeom.GetStageUpAxis(stage)
    )  # fmt: skip
    for layer in stage.GetUsedLayers():
        root = layer.pseudoRoot
        others = [
            f"{key} = {root.GetInfo(key)} instead of {value}"
            for key, value in axes
            if layer.realPath and root.HasInfo(key) and root.GetInfo(key) != value
        ]
        if others:
            name = Path(layer.realPath).name
            notices.add(f"{name}: {', '.join(others)} in the stage: USD does not convert it")
    return stage


def stage_parts(stage: Usd.Stage, time: Usd.TimeCode) -> Parts:
    """Types and schemas of the prims of a stage and its prototypes, and properties of some."""
    known = {name for feature in feature_table("usd") for name in feature.names}
    roots = (stage.GetPseudoRoot(), *stage.GetPrototypes())
    for prim in (prim for root in roots for prim in Usd.PrimRange(root)):
        kind = str(prim.GetTypeName())
        names = [
            kind,
            *(
                getappliedschema
                for getappliedschema in prim.GetAppliedSchemas()
                if getappliedschema in known
            ),
        ]
        yield from ((name, "") for name in names if name)
        for attribute in prim.GetAuthoredProperties():
            name = str(attribute.GetName())
            if name in known or (kind in _READ_TYPES and ":" not in name):
                is_value = isinstance(attribute, Usd.Attribute)
                yield name, str(attribute.Get(time)) if is_value else "targets"


def _relative(text: str, path: Path) -> str:
    """Message on one line, with paths relative to the stage's folder."""
    return re.sub(re.escape(f"{path.resolve().parent}/"), "", " ".join(text.split()))


# Cameras of a stage: start poses and lenses.

_LEVEL = 1e-6  # minimum horizontal part of a viewing direction that has a heading


def start_of_camera(world_from_camera: Floats) -> StartPose | None:
    """Start pose from a camera's position and heading; None: an invalid pose.

    Source: UsdGeomCamera looks along −z, with y up.
    """
    position, ahead = world_from_camera[:3, 3], -world_from_camera[:3, 2]
    if not np.isfinite(world_from_camera).all():
        return None
    if np.hypot(*ahead[:2]) < _LEVEL * np.linalg.norm(ahead):
        ahead = world_from_camera[:3, 1] * -np.sign(ahead[2])  # the top of the image
    x, y, z = position.tolist()
    yaw_deg = math.degrees(math.atan2(ahead[1], ahead[0]))
    return StartPose((x, y, z), round(yaw_deg, 6) + 0.0)  # avoids -0.0


def lens_of(prim: Usd.Prim, time: Usd.TimeCode) -> CentralCamera | str:
    """Lens of a camera, or the reason why omnisim has none.

    Source: UsdGeomCamera; NVIDIA's schemas OmniLensDistortion…API, see
    `omnisim.cameras.calibration.formats.isaac`, and the older attributes `cameraProjectionType` and
    `fthetaPolyA` to `fthetaPolyE`.
    """

    from omnisim.cameras.calibration.formats import isaac  # seldom needed

    def value(name: str) -> Any:
        attribute = prim.GetAttribute(name)
        return attribute.Get(time) if attribute else None

    def values(prefix: str, *keys: str) -> list[float]:
        return [float(value(f"{prefix}{key}") or 0.0) for key in keys]

    older = str(value("cameraProjectionType") or "pinhole")
    schemas = prim.GetPrimTypeInfo().GetAppliedAPISchemas()
    model = isaac.model_of(value(f"{isaac.PREFIX}model"), [str(schema) for schema in schemas])
    if model:
        return isaac.lens_of_model(model, lambda key: value(f"{isaac.PREFIX}{model}:{key}"))
    if older == "fisheyePolynomial":
        center = value("fthetaCx"), value("fthetaCy")
        stated = {f"k{index}": value(f"fthetaPoly{letter}") for index, letter in enumerate("ABCDE")}
        stated |= {
            "nominalWidth": value("fthetaWidth"),
            "nominalHeight": value("fthetaHeight"),
            "opticalCenter": None if None in center else center,
            "maxFov": value("fthetaMaxFov"),
        }
        return isaac.lens_of_model("ftheta", stated.get)
    if older != "pinhole":
        return f"omnisim has no model {older}"
    across, down, focal = values("", "horizontalAperture", "verticalAperture", "focalLength")
    right, up = values("", "horizontalApertureOffset", "verticalApertureOffset")
    if value("projection") == "orthographic":
        return "it is orthographic"
    return pinhole((across, down), focal, (right, up))
