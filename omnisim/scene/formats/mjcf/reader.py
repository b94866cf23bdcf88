"""Importer for MuJoCo models, from files and from memory."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import chain
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import mujoco
import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import SceneError
from omnisim.core.files.sources import note_file
from omnisim.core.poses import pose_from_rotation
from omnisim.core.short_repr import counted
from omnisim.scene.formats import features
from omnisim.scene.formats.cameras import Cameras, read_lens
from omnisim.scene.formats.features import part_notices, xml_parts
from omnisim.scene.formats.imported_scene import ImportedScene, translate
from omnisim.scene.formats.mjcf.cameras import find_viewpoint, lens_of
from omnisim.scene.formats.mjcf.geometry import Geom
from omnisim.scene.formats.mjcf.materials import read_background, read_lighting, transformed
from omnisim.scene.formats.mjcf.meshes import Meshes, Parts, visible_deformables
from omnisim.scene.model import Scene
from omnisim.scene.parts import Instance

# Geom groups shown by MuJoCo's own viewer; the others usually are collision shapes.
VISIBLE_GROUPS = (0, 1, 2)


def read_mjcf(path: Path, world_from_file: NDArray[np.float64]) -> ImportedScene:
    """Read a model file in its first keyframe, or else in its initial configuration.

    Raises:
        SceneError: MuJoCo cannot read the file.
    """
    model, data, warnings = load_model(path)
    parts = chain(*(xml_parts(root, "mjcf") for root in note_model_files(path)))
    unread = part_notices("mjcf", chain(parts, _drawn_parts(model, VISIBLE_GROUPS)))
    cameras = Cameras()
    try:
        read = ModelReader(model, data, VISIBLE_GROUPS).read()
    except UnicodeDecodeError as reason:
        raise SceneError(f"expected names in UTF-8, got {bytes(reason.object)!r:.40}") from None
    for camera in range(model.ncam):
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_CAMERA, camera) or f"camera_{camera}"
        pose = pose_from_rotation(data.cam_xmat[camera].reshape(3, 3), data.cam_xpos[camera])
        cameras.add(name, world_from_file @ pose, read_lens(partial(lens_of, model, camera)))
    notices = [*(f"MuJoCo: {_one_line(text)}" for text in warnings), *read.notices, *unread]
    notices += cameras.notices
    lighting = None if read.lighting is None else transformed(read.lighting, world_from_file)
    start = find_viewpoint(model, data, world_from_file)
    return read._replace(notices=notices, lighting=lighting, start=start, cameras=cameras.poses)


def load_model(path: Path) -> tuple[mujoco.MjModel, mujoco.MjData, list[str]]:
    """Model of a file, its data in the first keyframe or else initially, and MuJoCo's warnings.

    Raises:
        SceneError: MuJoCo cannot read the file.
    """
    with _warnings() as warnings:
        try:
            model = mujoco.MjModel.from_xml_path(str(path))
        except (ValueError, mujoco.FatalError) as reason:
            raise SceneError(f"cannot be read by MuJoCo: {_one_line(str(reason))}") from None
        data = mujoco.MjData(model)
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, data, 0)
        update_poses(model, data)
    return model, data, warnings


@contextmanager
def _warnings() -> Iterator[list[str]]:
    """Collect MuJoCo's warnings, which otherwise go to the console and to a log file."""
    before, texts = mujoco.get_mju_user_warning(), list[str]()
    mujoco.set_mju_user_warning(texts.append)
    try:
        yield texts
    finally:
        mujoco.set_mju_user_warning(before)


def update_poses(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Compute poses from the joints, like the first part of mj_forward."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)  # lights and cameras in tracking modes need the centers of mass
    mujoco.mj_camlight(model, data)
    mujoco.mj_flex(model, data)


class ModelReader:
    """Importer of a model in the state of its data, with computed poses.

    Args:
        model, data: MuJoCo model and its data.
        groups: visible groups of geoms, skins and flexible bodies.

    Attributes:
        geoms: indices of the visible geoms.
        names: names of all geoms.
        meshes: meshes of the geoms with instances.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, groups: Collection[int]):
        self._model, self._data, self._groups = model, data, groups
        self.meshes, self.names = Meshes(model), geom_names(model)
        self.geoms = [
            geom
            for geom in range(model.ngeom)
            if int(model.geom_group[geom]) in groups and self.meshes.rgba(geom)[3] > 0.0
        ]

    def read(self) -> ImportedScene:
        """Import all visible elements."""
        return self.content([*self.instances(self.geoms, np.eye(4)), *self.deformables()])

    def content(self, instances: Iterable[Instance]) -> ImportedScene:
        """Import instances created by this reader."""
        lighting, lights = read_lighting(self._model, self._data)
        background, sky = read_background(self._model, self.meshes.materials.textures)
        return ImportedScene(
            tuple(self.meshes.entries),
            tuple(self.meshes.materials.entries),
            tuple(instances),
            [*self._notices(), *self.meshes.materials.notices, *lights, *sky],
            lighting=lighting,
            background=background,
        )

    def instances(
        self, geoms: Iterable[int], frame_from_world: NDArray[np.float64]
    ) -> list[Instance]:
        """Instances of geoms in a frame, by frame_from_world (4, 4) in the state of the data."""
        instances = []
        for geom in geoms:
            rotation = self._data.geom_xmat[geom].reshape(3, 3)
            pose = frame_from_world @ pose_from_rotation(rotation, self._data.geom_xpos[geom])
            parts = self.meshes.of_geom(geom, self.names[geom])
            instances += _place(self.names[geom], parts, pose)
        return instances

    def deformables(self) -> list[Instance]:
        """Instances of the skins and flexible bodies, in the world."""
        instances = []
        for one in visible_deformables(self._model, self._data, self._groups):
            parts = self.meshes.add(one.name, one.mapped, one.material, one.rgba)
            instances += _place(one.name, parts, np.eye(4))
        return instances

    def _notices(self) -> list[str]:
        """Notices for geoms that are not drawn, or only approximately, one line per kind."""
        model, groups, notices = self._model, self._groups, []
        hidden = sum(int(group) not in groups for group in model.geom_group)
        if hidden:
            others = sorted({int(group) for group in model.geom_group} - set(groups))
            listed = ", ".join(map(str, others))
            notices.append(f"not drawn, as in MuJoCo: {counted(hidden, 'geom')} of group {listed}")
        fields = sum(int(model.geom_type[geom]) == Geom.mjGEOM_SDF for geom in self.geoms)
        if fields:
            notices.append(f"drawn as meshes: {counted(fields, 'signed distance field')}")
        ropes = int((model.flex_dim == 1).sum())
        if ropes:
            notices.append(f"not drawn: {counted(ropes, 'flexible line')} without a surface")
        return notices


def _place(name: str, parts: Parts, pose: NDArray[np.float64]) -> list[Instance]:
    """Instances of an element's meshes at its pose."""
    return [Instance(name, mesh, translate(pose, center), pose) for mesh, center in parts]


def _drawn_parts(model: mujoco.MjModel, groups: Collection[int]) -> features.Parts:
    """Sites and spatial tendons that MuJoCo draws."""
    for site in range(model.nsite):
        if int(model.site_group[site]) in groups and model.site_rgba[site, 3] > 0.0:
            yield "visible sites", ""
    for tendon in range(model.ntendon):
        kind = int(model.wrap_type[model.tendon_adr[tendon]])
        is_visible = int(model.tendon_group[tendon]) in groups and model.tendon_rgba[tendon, 3] > 0
        if is_visible and kind != mujoco.mjtWrap.mjWRAP_JOINT:
            yield "visible tendons", ""


def _one_line(text: str) -> str:
    return " ".join(text.split())


# Names of a MuJoCo model's elements, and of the instances made from its geoms.


_TYPES = {
    mujoco.mjtGeom.mjGEOM_PLANE: "plane",
    mujoco.mjtGeom.mjGEOM_HFIELD: "hfield",
    mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_BOX: "box",
    mujoco.mjtGeom.mjGEOM_MESH: "mesh",
    mujoco.mjtGeom.mjGEOM_SDF: "sdf",
}
_WORLD = 0


def body_name(model: mujoco.MjModel, body: int) -> str:
    """Name of a body; an unnamed one is named by index, such as body_7."""
    return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body) or f"body_{body}"


def geom_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Unique names of all geoms: body/geom; geoms of the world lack the "world/" prefix.

    An unnamed geom is named after its mesh, or else after its type.
    """
    counts: Counter[str] = Counter()
    names = []
    for geom in range(model.ngeom):
        name = _own_name(model, geom)
        body = int(model.geom_bodyid[geom])
        if body != _WORLD:
            name = f"{body_name(model, body)}/{name}"
        while counts[name]:
            counts[name] += 1
            name = f"{name}_{counts[name]}"
        counts[name] = 1
        names.append(name)
    return tuple(names)


def _own_name(model: mujoco.MjModel, geom: int) -> str:
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom)
    kind = int(model.geom_type[geom])
    if not name and kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = int(model.geom_dataid[geom])
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_MESH, mesh)
    return name or _TYPES[mujoco.mjtGeom(kind)]


# Files referenced by a MuJoCo model and read by MuJoCo itself, recorded as sources.


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


# Body of a robot whose model includes its own world.


def without_world(scene: Scene, path: Path) -> Scene:
    """Scene of a model without the world's own geoms, usually a floor, if bodies have any geoms.

    Args:
        scene: scene of the model.
        path: path of the model file.

    Raises:
        SceneError: MuJoCo cannot read the file.
    """
    model, _, _ = load_model(path)
    owners = dict(zip(geom_names(model), model.geom_bodyid.tolist(), strict=True))
    of_world = [name for name in scene.instance_names if owners.get(name) == _WORLD]
    if len(of_world) < len(scene.instance_names):
        for name in of_world:
            scene = scene.removed(name)
    return scene
