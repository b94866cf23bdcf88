"""Importer for URDF: visuals of a robot, as stated in the file."""

from __future__ import annotations

import io
from collections import Counter
from dataclasses import replace
from pathlib import Path, PurePosixPath

import numpy as np
import scipy  # loads its submodules on first use
from PIL import Image

from omnisim.core.arrays import Floats
from omnisim.core.errors import SceneError
from omnisim.core.poses import pose_from_rotation
from omnisim.core.short_repr import counted
from omnisim.core.srgb import linear_from_srgb
from omnisim.scene import primitives
from omnisim.scene.formats.features import part_notices, xml_parts
from omnisim.scene.formats.imported_scene import (
    PLAIN_GRAY,
    ImportedScene,
    Omissions,
    make_mesh,
    translate,
    unique_name,
)
from omnisim.scene.formats.resources import ResourcePath
from omnisim.scene.formats.sdf.geometry import MeshLibrary
from omnisim.scene.formats.xml.element import XmlElement, parse_xml
from omnisim.scene.parts import AlphaMode, Instance, Link, Material, Mesh, Texture
from omnisim.scene.primitives import PrimitiveSurface
from omnisim.scene.textures import TextureStore, alpha_mode_of

_GEOMETRIES = ("mesh", "box", "cylinder", "sphere", "capsule")
_GRAY = (PLAIN_GRAY, PLAIN_GRAY, PLAIN_GRAY, 1.0)


def read_urdf(
    path: Path,
    data: bytes,
    textures: TextureStore,
    resources: ResourcePath,
    materials: str | None = None,
) -> ImportedScene:
    """Read a robot.

    `materials` says which ones meshes with materials of their own show: those of the "robot", which
    is the default, or of the "mesh".

    Raises:
        SceneError: a damaged file; naming element, attribute, value and the expected value.
    """
    root = parse_xml(data)
    if root.tag != "robot":
        raise SceneError(f"expected <robot>, got <{root.tag}>")
    return _Reader(path, textures, resources, materials).read(XmlElement(root, "robot", path))


class _Reader:
    """Meshes, materials and instances of a file."""

    def __init__(
        self, path: Path, textures: TextureStore, resources: ResourcePath, chosen: str | None
    ) -> None:
        self._chosen, self._hidden = chosen, 0
        self._folder, self._textures, self._resources = path.parent, textures, resources
        self._files, self._omissions = MeshLibrary(textures, resources.reader), Omissions()
        self._missing: Counter[str] = Counter()
        self._meshes: list[Mesh] = []
        self._materials: list[Material] = [Material("", _GRAY, double_sided=True)]
        self._material_of: dict[int, int] = {}  # by id of an element, or of a mesh file's material
        self._mesh_of: dict[tuple[int, int], int] = {}  # by id of a mesh and index of its material
        self._named: dict[str, XmlElement] = {}
        self._instances: list[Instance] = []
        self._names: set[str] = set()

    def read(self, robot: XmlElement) -> ImportedScene:
        """Read all visuals of a robot."""
        for material in robot.children("material"):
            self._named.setdefault(material.name, material)
        poses = link_poses(robot)
        for link in robot.children("link"):
            for visual in link.children("visual"):  # references may precede the definition
                for material in visual.children("material"):
                    if material.find("color") is not None or material.find("texture") is not None:
                        self._named.setdefault(material.name, material)
        for link in robot.children("link"):
            for visual in link.children("visual"):
                self._read_visual(link, visual, poses[link.name] @ visual.origin())
        unread = part_notices("urdf", xml_parts(robot.element, "urdf"))
        notices = [*unread, *self._omissions.notices, *self._files.notices]
        if self._hidden and self._chosen is None:
            notices.append(
                f"the robot's materials replace those of the meshes "
                f'({counted(self._hidden, "visual")}): urdf_materials = "mesh" in a scene file '
                "keeps the meshes' own, as RViz does"
            )
        if self._missing:
            names = ", ".join(sorted(self._missing))
            hint = f"{names}: pass the folder of the packages as --resources"
            count = counted(self._missing.total(), "file")
            if not self._instances:
                raise SceneError(f"has nothing to draw: {count} not found: {hint}")
            notices.append(f"{count} not found, and not drawn: {hint}")
        return ImportedScene(
            tuple(self._meshes), tuple(self._materials), tuple(self._instances), notices,
            links=_links(robot, poses),
        )  # fmt: skip

    def _read_visual(self, link: XmlElement, visual: XmlElement, pose: Floats) -> None:
        geometry = visual.find("geometry")
        shapes = (
            [child for tag in _GEOMETRIES for child in geometry.children(tag)] if geometry else []
        )
        if not shapes:
            self._omissions.count("no known geometry", "visual")
            return
        shape = shapes[0]
        material = self._material(visual)
        is_mesh = shape.tag == "mesh"
        kind = PurePosixPath(shape.attribute("filename")).stem if is_mesh else shape.tag
        name = unique_name(f"{link.name}/{visual.name or kind}", self._names, first=2)
        if is_mesh:
            self._read_mesh(shape, material, pose, name)
            return
        mesh, center = make_mesh(name, material or 0, *_surface(shape))
        self._meshes.append(mesh)
        place = translate(pose, center)
        self._instances.append(Instance(name, len(self._meshes) - 1, place, pose))

    def _read_mesh(self, shape: XmlElement, material: int | None, pose: Floats, name: str) -> None:
        uri = shape.attribute("filename")
        scale = shape.attribute_numbers("scale", (1.0, 1.0, 1.0), 3)
        if not all(scale):
            raise shape.attribute_error("scale", "numbers other than 0")
        path = self._resources.find(uri, self._folder)
        if path is None or not path.is_file():
            self._missing[uri] += 1
            return
        file = self._files.load(path)
        if isinstance(file, str):
            self._omissions.count(f"{path.name}: not drawn: {file}", "visual")
            return
        meshes = [file.meshes[instance.mesh] for instance in file.instances]
        has_own = []  # colors, a texture, or another material than that of plain files
        for mesh in meshes:
            stated = file.materials[mesh.material]
            is_plain = stated.base_color == _GRAY or not stated.name
            has_own.append(mesh.colors is not None or stated.texture is not None or not is_plain)
        self._hidden += material is not None and any(has_own)
        for instance, mesh, is_colored in zip(file.instances, meshes, has_own, strict=True):
            if is_colored and self._chosen == "mesh":
                material = None
            own = material
            if own is None:
                stated = file.materials[mesh.material]
                own = self._material_of.setdefault(id(stated), len(self._materials))
                if own == len(self._materials):
                    self._materials.append(stated)
            if (id(mesh), own) not in self._mesh_of:
                self._mesh_of[id(mesh), own] = len(self._meshes)
                self._meshes.append(replace(mesh, material=own))
            place = pose @ np.diag((*scale, 1.0)) @ instance.world_from_mesh
            self._instances.append(Instance(name, self._mesh_of[id(mesh), own], place, pose))

    def _material(self, visual: XmlElement) -> int | None:
        stated = visual.find("material")
        if stated is None:
            return None
        if stated.find("color") is None and stated.find("texture") is None:
            named = self._named.get(stated.name)
            if named is None:
                return None
            stated = named
        key = id(stated.element)
        if key not in self._material_of:
            self._material_of[key] = len(self._materials)
            color, texture = stated.find("color"), self._texture(stated)
            rgba = (1.0, 1.0, 1.0, 1.0) if texture is not None else _GRAY
            if color is not None:
                given = np.clip(color.attribute_numbers("rgba", None, 4), 0.0, 1.0)
                red, green, blue = np.asarray(linear_from_srgb(given[:3])).tolist()
                rgba = (red, green, blue, float(given[3]))
            mode = AlphaMode.BLEND if rgba[3] < 1.0 else alpha_mode_of(texture)
            self._materials.append(Material(stated.name, rgba, texture, mode, double_sided=True))
        return self._material_of[key]

    def _texture(self, element: XmlElement) -> Texture | None:
        texture = element.find("texture")
        if texture is None or not texture.attribute("filename"):
            return None
        name = texture.attribute("filename")
        path = self._resources.find(name, self._folder)
        try:
            data = self._resources.reader.read(path) if path is not None else None
        except OSError:
            data = None
        if data is None:
            self._missing[name] += 1
            return None
        try:
            image = Image.open(io.BytesIO(data))
        except Exception:  # Pillow's readers raise exceptions of any type
            self._omissions.count(f"texture {name} is not an image that can be read", "material")
            return None
        return self._textures.texture(image, element.name)


def _surface(shape: XmlElement) -> PrimitiveSurface:
    if shape.tag == "box":
        return primitives.box(0.5 * np.array(shape.attribute_sizes("size", 3)))
    (radius,) = shape.attribute_sizes("radius")
    if shape.tag == "sphere":
        return primitives.ellipsoid((radius,) * 3)
    (length,) = shape.attribute_sizes("length")
    make = primitives.cylinder if shape.tag == "cylinder" else primitives.capsule
    return make(radius, 0.5 * length)


# Poses of a robot's links with its joints at rest.


def link_poses(robot: XmlElement) -> dict[str, Floats]:
    """Poses (4, 4) robot_from_link by link name, in tree order from the root.

    A joint rests at 0, or at the middle of its limits if these exclude 0.

    Raises:
        SceneError: unknown or duplicate link names, or links that do not form a tree.
    """
    links = [link.name for link in robot.children("link")]
    for link in robot.children("link"):
        if links.count(link.name) > 1:
            raise link.attribute_error("name", "each link once")
    if not links:
        raise SceneError(f"{robot.place}: expected a <link>, got none")
    parents: dict[str, tuple[str, Floats]] = {}
    for joint in robot.children("joint"):
        parent, child = _end(joint, "parent", links), _end(joint, "child", links)
        if child.attribute("link") in parents:
            raise child.attribute_error("link", "a link without another parent")
        pose = joint.origin() @ _motion(joint)
        parents[child.attribute("link")] = (parent.attribute("link"), pose)
    poses = {link: np.eye(4) for link in links if link not in parents}
    inner: dict[str, list[str]] = {}
    for child_name, (parent_name, _) in parents.items():
        inner.setdefault(parent_name, []).append(child_name)
    waiting = list(poses)
    while waiting:
        parent_name = waiting.pop()
        for child_name in inner.get(parent_name, ()):
            poses[child_name] = poses[parent_name] @ parents[child_name][1]
            waiting.append(child_name)
    if rest := sorted(set(links) - poses.keys()):
        raise SceneError(f"{robot.place}: link[{rest[0]}]: expected a tree of links, got a cycle")
    return poses


def _links(robot: XmlElement, poses: dict[str, Floats]) -> tuple[Link, ...]:
    """Links at rest; those of fixed joints know to which link they are fixed."""
    parents = {}
    for joint in robot.children("joint"):
        if joint.attribute("type") == "fixed":
            parent, child = _end(joint, "parent", list(poses)), _end(joint, "child", list(poses))
            parents[child.attribute("link")] = parent.attribute("link")
    return tuple(Link(name, pose, parents.get(name, name)) for name, pose in poses.items())


def _end(joint: XmlElement, tag: str, links: list[str]) -> XmlElement:
    end = joint.find(tag)
    if end is None:
        raise SceneError(f"{joint.place}: expected a <{tag}>, got none")
    if end.attribute("link") not in links:
        raise end.attribute_error("link", "the name of a <link>")
    return end


def _motion(joint: XmlElement) -> Floats:
    """Pose (4, 4) of a joint's child at rest, relative to the joint's origin."""
    kind, limit = joint.attribute("type"), joint.find("limit")
    if kind not in ("revolute", "prismatic") or limit is None:
        return np.eye(4)
    (low,), (high,) = (
        limit.attribute_numbers("lower", (0.0,), 1),
        limit.attribute_numbers("upper", (0.0,), 1),
    )
    if low <= 0.0 <= high or high < low:
        return np.eye(4)
    axis_element = joint.find("axis")
    axis = np.array((1.0, 0.0, 0.0))
    if axis_element is not None:
        axis = np.array(axis_element.attribute_numbers("xyz", (1.0, 0.0, 0.0), 3))
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        return np.eye(4)
    vector = axis / length * 0.5 * (low + high)
    if kind == "prismatic":
        return pose_from_rotation(np.eye(3), vector)
    rotation = scipy.spatial.transform.Rotation.from_rotvec(vector).as_matrix()
    return pose_from_rotation(rotation, np.zeros(3))
