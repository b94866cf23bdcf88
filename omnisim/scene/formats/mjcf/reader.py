"""Importer for MuJoCo models, from files and from memory."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterable
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import mujoco
import numpy as np

from omnisim.cameras import PerspectiveCamera, UnifiedCamera
from omnisim.core.arrays import Floats
from omnisim.core.coordinate_frames import BASE_FROM_OPTICAL_LOOKING_AHEAD
from omnisim.core.errors import SceneError, did_you_mean
from omnisim.core.files.sources import SourceReader
from omnisim.core.poses import pose_from_rotation, rotation_from_quaternion
from omnisim.core.short_repr import counted
from omnisim.scene.formats import features
from omnisim.scene.formats.features import part_notices, xml_parts
from omnisim.scene.formats.imported_scene import (
    Cameras,
    ImportedScene,
    make_mesh,
    read_lens,
    translate,
    unique_name,
)
from omnisim.scene.formats.mjcf.materials import read_lighting, transformed
from omnisim.scene.formats.mjcf.meshes import Geom, Meshes, Parts, visible_deformables
from omnisim.scene.light.lighting import DEFAULT_BACKGROUND
from omnisim.scene.model import Scene
from omnisim.scene.parts import Instance, Link, StartPose

# Geom groups shown by MuJoCo's own viewer; the others usually are collision shapes.
VISIBLE_GROUPS = (0, 1, 2)


def read_mjcf(path: Path, world_from_file: Floats, reader: SourceReader) -> ImportedScene:
    """Read a model file in its first keyframe, or else in its initial configuration.

    Raises:
        SceneError: MuJoCo cannot read the file.
    """
    model, data, warnings = load_model(path)
    parts = chain(*(xml_parts(root, "mjcf") for root in note_model_files(path, reader)))
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
    # otherwise they go to the console and to a log file
    before, warnings = mujoco.get_mju_user_warning(), list[str]()
    mujoco.set_mju_user_warning(warnings.append)
    try:
        try:
            model = mujoco.MjModel.from_xml_path(str(path))
        except (ValueError, mujoco.FatalError) as reason:
            raise SceneError(f"cannot be read by MuJoCo: {_one_line(str(reason))}") from None
        data = mujoco.MjData(model)
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, data, 0)
        compute_poses(model, data)
    finally:
        mujoco.set_mju_user_warning(before)
    return model, data, warnings


def compute_poses(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Compute all poses from the joints, like the first part of mj_forward."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)  # for lights and cameras in tracking modes
    mujoco.mj_camlight(model, data)
    mujoco.mj_flex(model, data)


class ModelReader:
    """Importer of a model in the state of its data, with computed poses, and of visible groups.

    Raises:
        SceneError: an unknown name in `hidden`, the instance names of hidden geoms.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        groups: Collection[int],
        hidden: Collection[str] = (),
    ):
        self._model, self._data, self._groups = model, data, groups
        self.meshes, self.names = Meshes(model), geom_names(model)
        for name in hidden:
            if name not in self.names:
                raise SceneError(f"hidden: {name!r}: {did_you_mean(name, self.names, 'geoms:')}")
        self.geoms = [
            geom
            for geom in range(model.ngeom)
            if int(model.geom_group[geom]) in groups
            and self.meshes.rgba(geom)[3] > 0.0
            and self.names[geom] not in hidden
        ]

    def read(self) -> ImportedScene:
        """Import all visible elements; skins and flexible bodies are the last instances."""
        soft = self._deformables()
        instances = [*self._instances(), *soft]
        lighting, lights = read_lighting(self._model, self._data)
        boxes = np.flatnonzero(self._model.tex_type == int(mujoco.mjtTexture.mjTEXTURE_SKYBOX))
        sky = ["the sky box is drawn in its mean color"] if len(boxes) else []
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
        textures = self.meshes.materials.textures
        return ImportedScene(
            tuple(self.meshes.entries),
            tuple(self.meshes.materials.entries),
            tuple(instances),
            [*notices, *self.meshes.materials.notices, *lights, *sky],
            lighting=lighting,
            background=textures.mean_color(int(boxes[0])) if len(boxes) else DEFAULT_BACKGROUND,
            links=self._links([one.name for one in soft]),
        )

    def _links(self, soft: Iterable[str]) -> tuple[Link, ...]:
        """Bodies with their geoms; the world has the skins and flexible bodies, too."""
        model, data, names = self._model, self._data, body_names(self._model)
        trees = model.body_rootid
        is_mocap = (model.body_weldid == _WORLD) & (model.body_mocapid[trees] >= 0)
        roots = np.where(is_mocap, trees, model.body_weldid)
        parts: list[set[str]] = [set() for _ in names]
        parts[_WORLD].update(soft)
        for name, body in zip(self.names, model.geom_bodyid, strict=True):
            parts[body].add(name)
        return tuple(
            Link(
                name,
                pose_from_rotation(data.xmat[body].reshape(3, 3), data.xpos[body]),
                names[roots[body]] if roots[body] != _WORLD else "",
                frozenset(parts[body]),
            )
            for body, name in enumerate(names)
        )

    def _instances(self) -> list[Instance]:
        """Instances of the geoms, in the world."""
        instances = []
        for geom in self.geoms:
            rotation = self._data.geom_xmat[geom].reshape(3, 3)
            pose = pose_from_rotation(rotation, self._data.geom_xpos[geom])
            parts = self.meshes.of_geom(geom, self.names[geom])
            instances += _place(self.names[geom], parts, pose)
        return instances

    def _deformables(self) -> list[Instance]:
        """Instances of the skins and flexible bodies, in the world."""
        instances = []
        for deformable in visible_deformables(self._model, self._data, self._groups):
            part = self.meshes.add(
                deformable.name, deformable.mapped, deformable.material, deformable.rgba
            )
            instances += _place(deformable.name, (part,), np.eye(4))
        return instances


def _place(name: str, parts: Parts, pose: Floats) -> list[Instance]:
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

_WORLD = 0


def body_name(model: mujoco.MjModel, body: int) -> str:
    """Name of a body; an unnamed one is named by index, such as body_7."""
    return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body) or f"body_{body}"


def body_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Unique names of all bodies, the world's first."""
    used: set[str] = set()
    return tuple(unique_name(body_name(model, body), used, 2) for body in range(model.nbody))


def geom_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Unique names of all geoms: body/geom; geoms of the world lack the "world/" prefix.

    An unnamed geom is named after its mesh, or else after its type.
    """
    counts: Counter[str] = Counter()
    names = []
    for geom in range(model.ngeom):
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom)
        kind, body = int(model.geom_type[geom]), int(model.geom_bodyid[geom])
        if not name and kind == Geom.mjGEOM_MESH:
            mesh = int(model.geom_dataid[geom])
            name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_MESH, mesh)
        name = name or Geom(kind).name[len("mjGEOM_") :].lower()
        if body != _WORLD:
            name = f"{body_name(model, body)}/{name}"
        while counts[name]:
            counts[name] += 1
            name = f"{name}_{counts[name]}"
        counts[name] = 1
        names.append(name)
    return tuple(names)


# Files referenced by a MuJoCo model and read by MuJoCo itself, recorded as sources.

_FOLDERS = ("assetdir", "meshdir", "texturedir")


def note_model_files(path: Path, reader: SourceReader) -> list[Element]:
    """Record the files of a model: included files, meshes, textures and height fields.

    Returns the roots of its XML files.
    """
    roots = []
    names, folders = {""}, {""}
    waiting, seen = [path], set()
    while waiting:
        file = waiting.pop()
        if file in seen:
            continue
        seen.add(file)
        reader.note(file)
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
                reader.note(candidate)
    return roots


# Body of a robot whose model includes its own world.


def without_world(scene: Scene, path: Path) -> Scene:
    """Scene of a model without the world's own geoms, usually a floor, if bodies have any geoms."""
    model, _, _ = load_model(path)
    owners = dict(zip(geom_names(model), model.geom_bodyid.tolist(), strict=True))
    of_world = [name for name in scene.instance_names if owners.get(name) == _WORLD]
    if len(of_world) < len(scene.instance_names):
        for name in of_world:
            scene = scene.removed(name)
    return scene


# Cameras: lens, mount, and the viewpoint of a frame's first image.

_DEFAULT_SIZE_PX = (640, 480)  # for cameras without a resolution


def lens_of(
    model: mujoco.MjModel, camera: str | int, size_px: tuple[int, int] | None = None
) -> PerspectiveCamera | UnifiedCamera:
    """Pinhole lens of a camera by its name or index; omnisim's images then match MuJoCo's.

    Without `size_px` (width, height) it has the camera's resolution, or else 640 × 480.

    Raises:
        SceneError: an unknown or an orthographic camera.
        OpticsError: a size below 1.
    """
    index = camera
    if isinstance(index, str):
        index = find_mount(model, "camera", index).number
    if int(model.cam_projection[index]) != mujoco.mjtProjection.mjPROJ_PERSPECTIVE:
        raise SceneError(f"camera = {camera!r}: expected a perspective camera, got an orthographic")
    stated = (int(model.cam_resolution[index][0]), int(model.cam_resolution[index][1]))
    width, height = size_px or (stated if min(stated) > 1 else _DEFAULT_SIZE_PX)
    middle = (0.5 * (width - 1), 0.5 * (height - 1))
    sensor_x, sensor_y = (float(size) for size in model.cam_sensorsize[index])
    if min(sensor_x, sensor_y) <= 0.0:
        half_rad = math.radians(0.5 * float(model.cam_fovy[index]))
        return PerspectiveCamera(width, height, 0.5 * height / math.tan(half_rad), middle)
    focal_x, focal_y, off_x, off_y = (float(value) for value in model.cam_intrinsic[index])
    per_x, per_y = width / sensor_x, height / sensor_y  # pixels per unit of sensor size
    axis = (middle[0] - off_x * per_x, middle[1] - off_y * per_y)  # sign as in MuJoCo's images
    if math.isclose(focal_x * per_x, focal_y * per_y, rel_tol=1e-6):
        return PerspectiveCamera(width, height, focal_x * per_x, axis)
    return UnifiedCamera(width, height, (focal_x * per_x, focal_y * per_y), axis, xi=0.0)


# Sites and cameras of a MuJoCo model, which carry sensors, and their poses.

# MuJoCo's cameras look along −z with y up, as in OpenGL.
_OPTICAL_FROM_OPENGL = np.diag([1.0, -1.0, -1.0])
_OPENGL_FROM_BASE = (BASE_FROM_OPTICAL_LOOKING_AHEAD @ _OPTICAL_FROM_OPENGL).T


class ModelMount(NamedTuple):
    """Site or camera of a model, x forward, z up."""

    number: int  # index in the model
    body: int  # index of its body
    body_from_mount: Floats  # (4, 4)
    is_tracking: bool  # a camera that turns to a body or follows one: `tracked_pose`


def find_mount(model: mujoco.MjModel, kind: str, name: str) -> ModelMount:
    """Site or camera, by its kind and name.

    Raises:
        SceneError: an unknown element.
    """
    objects, bodies, positions, turns = {
        "site": (mujoco.mjtObj.mjOBJ_SITE, model.site_bodyid, model.site_pos, model.site_quat),
        "camera": (mujoco.mjtObj.mjOBJ_CAMERA, model.cam_bodyid, model.cam_pos, model.cam_quat),
    }[kind]
    known = [mujoco.mj_id2name(model, objects, index) or "" for index in range(len(bodies))]
    if name not in known:
        raise SceneError(f"{kind} = {name!r}: {did_you_mean(name, known, 'the model has')}")
    number, is_camera = known.index(name), kind == "camera"
    (rotation,) = rotation_from_quaternion([np.roll(turns[number], -1)])
    if is_camera:
        rotation = rotation @ _OPENGL_FROM_BASE
    is_tracking = is_camera and int(model.cam_mode[number]) != mujoco.mjtCamLight.mjCAMLIGHT_FIXED
    pose = pose_from_rotation(rotation, positions[number])
    return ModelMount(number, int(bodies[number]), pose, is_tracking)


def tracked_pose(position: Floats, axes: Floats) -> Floats:
    """Pose (4, 4) of a camera, x forward, z up, from its position and axes in MuJoCo's data."""
    return pose_from_rotation(axes.reshape(3, 3) @ _OPENGL_FROM_BASE, position)


# Start pose for a MuJoCo model: its first fixed camera, or an overview of its center.

# In front of a model that faces +x, and above its center.
_OFFSET_PER_EXTENT = np.array([0.6, 0.0, 0.3])


@np.errstate(over="ignore", invalid="ignore")  # for models of infinite extent
def find_viewpoint(
    model: mujoco.MjModel, data: mujoco.MjData, world_from_file: Floats
) -> StartPose:
    """Start pose for a model, in the world."""
    offset = float(model.stat.extent) * _OFFSET_PER_EXTENT
    position, ahead = model.stat.center + offset, -offset
    fixed = np.flatnonzero(model.cam_bodyid == _WORLD)
    if len(fixed):
        axes, position = data.cam_xmat[fixed[0]].reshape(3, 3), data.cam_xpos[fixed[0]]
        is_level = abs(axes[2, 2]) < 0.99  # otherwise its image top points ahead
        ahead = -axes[:, 2] if is_level else axes[:, 1]
    rotation = world_from_file[:3, :3]
    x, y, z = (rotation @ position + world_from_file[:3, 3]).tolist()
    forward = rotation @ ahead
    return StartPose((x, y, z), math.degrees(math.atan2(forward[1], forward[0])))


# Skins and flexible bodies in motion.


def deformed(
    static: Scene, model: mujoco.MjModel, data: mujoco.MjData, groups: Collection[int]
) -> Scene:
    """Static scene of a model with its skins and flexible bodies in their current state.

    They remain the last instances, in the order of `ModelReader.read`.
    """
    soft = visible_deformables(model, data, groups)
    if not soft:
        return static
    meshes, instances = list(static.meshes), list(static.instances)
    for index, body in enumerate(soft, len(instances) - len(soft)):
        number, mapped = instances[index].mesh, body.mapped
        material, uv = meshes[number].material, mapped.texture_coordinates
        mesh, center = make_mesh(body.name, material, *mapped.surface, uv)
        meshes[number] = mesh
        instances[index] = Instance(body.name, number, translate(np.eye(4), center), np.eye(4))
    return replace(static, meshes=tuple(meshes), instances=tuple(instances))
