"""Result of a format's reader: parts of a scene, cameras, axes and unit, and what is left out."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.cameras import CentralCamera
from omnisim.cameras.camera import without_prefix
from omnisim.core.arrays import Floats, Floats32, bounds_of
from omnisim.core.errors import OmnisimError, SceneError
from omnisim.core.poses import (
    pose_from_rotation,
    proper_rotation,
    roll_pitch_yaw_from_rotation,
)
from omnisim.core.short_repr import counted
from omnisim.core.srgb import linear_from_srgb
from omnisim.scene import parts
from omnisim.scene.motion.object_motion import ObjectMotion

# Color of surfaces without one: a light gray, 80 % in sRGB.
PLAIN_GRAY = float(linear_from_srgb(0.8))
# Larger coordinates overflow float32 once they are multiplied.
MAX_COORDINATE = 1e15


class ImportedObject(NamedTuple):
    """Instances of a file that move together."""

    name: str  # name, unique within the file
    motion: ObjectMotion  # motion in the world frame
    instances: tuple[int, ...]  # indices of the instances, which are posed as at 0 s


class ImportedScene(NamedTuple):
    """Contents of a mesh file."""

    # meshes, materials: as in `Scene`
    meshes: tuple[parts.Mesh, ...]
    materials: tuple[parts.Material, ...]
    # instances in the file's axes and unit: `world_from_mesh` is still file_from_mesh, and
    # `world_from_node` is file_from_node
    instances: tuple[parts.Instance, ...]
    notices: list[str]  # one line for each feature that is not rendered
    lights: tuple[parts.Light, ...] = ()  # lights in the world frame
    # lighting in place of `lights`, for files with brightness levels of their own; None: no such
    # levels
    lighting: parts.Lighting | None = None
    # linear RGB of rays without a hit; None: not in the file
    background: tuple[float, float, float] | None = None
    # linear RGB luminance of uniform light from all directions, cd/m²; None: no such light
    dome: tuple[float, float, float] | None = None
    # (rows, 2 rows, 3) luminance of the dome by direction, in world axes; None: uniform
    environment: Floats32 | None = None
    start: parts.StartPose | None = None  # start pose from the file's camera; None: no camera
    cameras: tuple[parts.CameraPose, ...] = ()  # camera poses in the world frame
    labels: tuple[parts.LabelRule, ...] = ()  # class rules from the file
    objects: tuple[ImportedObject, ...] = ()  # groups of instances that move over time
    links: tuple[parts.Link, ...] = ()  # posed in the file's axes and unit


def material_notices(read: ImportedScene) -> list[str]:
    """Notices for materials that do not show on their meshes as intended, one line each.

    They have a texture without texture coordinates or below black vertex colors, or are invisible.
    """
    used_meshes = [read.meshes[index] for index in sorted({i.mesh for i in read.instances})]
    textured = [mesh for mesh in used_meshes if read.materials[mesh.material].texture is not None]
    black = sum(mesh.colors is not None and not mesh.colors[:, :3].any() for mesh in textured)
    unseen = {
        material.name: None
        for material in (read.materials[mesh.material] for mesh in used_meshes)
        if material.alpha_mode is parts.AlphaMode.BLEND and material.base_color[3] == 0.0
    }
    notices = [f"material {name!r} is invisible: its opacity is 0" for name in unseen]
    if black:
        notices.append(f"vertex colors make textures black ({counted(black, 'mesh', 'meshes')})")
    bare = Counter(mesh.material for mesh in used_meshes if mesh.texture_coordinates is None)
    return notices + [
        f"texture of {read.materials[index].name!r} is not drawn on "
        f"{counted(count, 'mesh', 'meshes')} without texture coordinates"
        for index, count in bare.items()
        if read.materials[index].texture is not None
    ]


def make_mesh(
    name: str,
    material: int,
    positions: ArrayLike,
    triangles: ArrayLike,
    normals: ArrayLike | None = None,
    texture_coordinates: ArrayLike | None = None,
    colors: ArrayLike | None = None,
    second_texture_coordinates: ArrayLike | None = None,
    dropped: Omissions | None = None,
) -> tuple[parts.Mesh, Floats]:
    """Mesh centered on its bounding box, and the center (3,) of that box.

    Centering in float64 keeps micrometer precision in float32, even for a town in map coordinates.
    Normals or texture coordinates that are not finite, or whose count differs from that of the
    positions, are dropped, and counted. The mesh is then shaded flat, or in its plain color.

    Arrays are those of `Mesh`, with at least one triangle.

    Raises:
        SceneError: a vertex index is out of range, or a position is not finite or too large.
    """
    points = np.asarray(positions, dtype=np.float64).reshape(-1, 3)
    corners = np.asarray(triangles, dtype=np.int64).reshape(-1, 3)
    if corners.min() < 0 or corners.max() >= len(points):
        worst = corners.min() if corners.min() < 0 else corners.max()
        raise SceneError(f"mesh {name!r}: expected vertices below {len(points)}, got {worst}")
    bad = ~(np.abs(points) < MAX_COORDINATE).all(axis=1)  # true for NaN as well
    if bad.any():
        raise SceneError(
            f"mesh {name!r}: vertex {int(np.argmax(bad))}: expected finite numbers below "
            f"{MAX_COORDINATE:g}, got {points[np.argmax(bad)].tolist()} "
            f"({int(bad.sum())} of {len(points)} vertices)"
        )
    center = 0.5 * bounds_of(points).sum(axis=0)

    def per_vertex(values: ArrayLike | None, width: int, what: str) -> Floats32 | None:
        if values is None:
            return None
        with np.errstate(all="ignore"):
            array = np.ascontiguousarray(values, dtype=np.float32)
        if array.shape == (len(points), width) and np.isfinite(array).all():
            return array
        if dropped is not None:
            dropped.count(f"{what} not drawn: not finite, or not one for each vertex", "mesh")
        return None

    mesh = parts.Mesh(
        name=name,
        positions=np.ascontiguousarray(points - center, dtype=np.float32),
        triangles=np.ascontiguousarray(corners, dtype=np.uint32),
        material=material,
        normals=per_vertex(normals, 3, "normals"),
        texture_coordinates=per_vertex(texture_coordinates, 2, "texture coordinates"),
        colors=per_vertex(colors, 4, "vertex colors"),
        second_texture_coordinates=per_vertex(
            second_texture_coordinates, 2, "second texture coordinates"
        ),
    )
    return mesh, center


def place(read: ImportedScene, world_from_file: Floats) -> tuple[parts.Instance, ...]:
    """Instances of a file, placed in the world; node frames get the world's axes and unit.

    Raises:
        SceneError: poses or colors that float32 cannot represent.
    """
    file_from_world = np.linalg.inv(world_from_file)
    placed = []
    for instance in read.instances:
        world_from_mesh = world_from_file @ instance.world_from_mesh
        if not np.abs(world_from_mesh).max() < MAX_COORDINATE:  # false for NaN as well
            raise SceneError(f"node {instance.name!r}: expected a pose below {MAX_COORDINATE:g}")
        world_from_node = world_from_file @ instance.world_from_node @ file_from_world
        placed.append(
            parts.Instance(instance.name, instance.mesh, world_from_mesh, world_from_node)
        )
    for material in read.materials:
        if not np.isfinite((*material.base_color, material.alpha_cutoff)).all():
            raise SceneError(f"material {material.name!r}: expected finite colors")
    return tuple(placed)


def place_links(read: ImportedScene, world_from_file: Floats) -> tuple[parts.Link, ...]:
    """Links of a file, posed in the world."""
    turn = proper_rotation(world_from_file[:3, :3])
    return tuple(
        replace(
            link,
            world_from_link=pose_from_rotation(
                turn @ proper_rotation(link.world_from_link[:3, :3]),
                (world_from_file @ link.world_from_link)[:3, 3],
            ),
        )
        for link in read.links
    )


def colors_rgba(colors: NDArray[np.generic], scale: float) -> Floats32:
    """Colors (n, 3 or 4) as RGBA float32, divided by `scale`."""
    values = np.asarray(colors, dtype=np.float32) / np.float32(scale)
    if values.shape[1] == 3:
        values = np.concatenate((values, np.ones((len(values), 1), dtype=np.float32)), axis=1)
    return np.ascontiguousarray(values[:, :4])


def translate(matrix: Floats, offset: Floats) -> Floats:
    """Pose (4, 4) times a translation by `offset` (3,)."""
    result = np.array(matrix, dtype=np.float64)
    result[:3, 3] += result[:3, :3] @ offset
    return result


# Up axis and unit of mesh files.

_WORLD_FROM_UP_AXIS = {
    "x": np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]]),  # COLLADA: right −y, up x, inward z
    "y": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "z": np.eye(3),
}
# For formats that do not fix it: the assumption of Blender's importers. All others: z.
_UP_AXIS_OF_FORMAT = {".glb": "y", ".gltf": "y", ".obj": "y"}
_METERS_OF_FORMAT = {".3mf": 0.001}  # 3MF's default unit; all others: 1


class FileAxes(NamedTuple):
    """Up axis and unit that override those of a file; None: no override."""

    up_axis: str | None = None
    meters_per_unit: float | None = None


def world_from_file(suffix: str, data: bytes, axes: FileAxes) -> Floats:
    """Transform (4, 4) from a file's axes and unit to the world frame.

    `axes` override the file's values, which override those of its format.
    """
    axis = _UP_AXIS_OF_FORMAT.get(suffix, "z")
    unit = _METERS_OF_FORMAT.get(suffix, 1.0)
    if suffix == ".dae":  # COLLADA's <asset>, which trimesh does not apply
        axis_match = re.search(rb"<up_axis>\s*([XYZ])_UP\s*</up_axis>", data)
        axis = axis_match[1].decode().lower() if axis_match else "y"
        stated = re.search(rb"<unit\b[^>]*\bmeter\s*=\s*[\"']([^\"']*)[\"']", data)
        if stated is not None:
            text = stated[1].decode("utf-8", "replace")
            try:
                unit = float(text)
            except ValueError:
                unit = math.nan
            if not (math.isfinite(unit) and unit > 0.0):
                raise SceneError(f"<unit meter>: expected a number > 0, got {text!r}")
    return world_from_axes(
        axes.up_axis or axis, unit if axes.meters_per_unit is None else axes.meters_per_unit
    )


def world_from_axes(up_axis: str, meters_per_unit: float) -> Floats:
    """Transform (4, 4) to the world frame from a frame with the given up axis and unit.

    Raises:
        SceneError: an axis other than x, y and z, or an invalid unit.
    """
    if up_axis not in _WORLD_FROM_UP_AXIS:
        raise SceneError(f"up axis: expected x, y or z, got {up_axis!r}")
    if not 0.0 < meters_per_unit < math.inf:
        raise SceneError(f"meters_per_unit: expected a number > 0, got {meters_per_unit!r}")
    matrix = np.eye(4)
    matrix[:3, :3] = _WORLD_FROM_UP_AXIS[up_axis] * meters_per_unit
    return matrix


# Unsupported or approximated parts of a file, as notices.


def unique_name(name: str, used_names: set[str], first: int = 0) -> str:
    """Name, with a number from `first` on if it is in `used_names`, to which it is added."""
    unique, number = name, first
    while unique in used_names:
        unique, number = f"{name}_{number}", number + 1
    used_names.add(unique)
    return unique


class Omissions:
    """Omitted or approximated parts, in order of occurrence."""

    def __init__(self) -> None:
        self._plain: dict[str, None] = {}
        self._counts: Counter[tuple[str, str]] = Counter()

    def add(self, text: str) -> None:
        """Add a line without a count."""
        self._plain[text] = None

    def count(self, effect: str, noun: str = "prim") -> None:
        """Count one more part with the effect; the noun of the counted parts is in the singular."""
        self._counts[effect, noun] += 1

    @property
    def notices(self) -> list[str]:
        """Notices, one line per effect."""
        uses = [
            f"{text} ({counted(n, noun, 'meshes' if noun == 'mesh' else '')})"
            for (text, noun), n in self._counts.items()
        ]
        return [*self._plain, *uses]


# Cameras of scene files as viewpoints, with their lenses where omnisim has the model.

HEIGHT_PX = 480  # of lenses whose files state no resolution


class Cameras:
    """Cameras of a file, with a notice for each lens that omnisim has no model for."""

    def __init__(self) -> None:
        self.notices: list[str] = []
        self._poses: dict[str, parts.CameraPose] = {}

    @property
    def poses(self) -> tuple[parts.CameraPose, ...]:
        """Poses with distinct names, in the order of the file."""
        return tuple(self._poses.values())

    def add(self, name: str, world_from_camera: Floats, lens: CentralCamera | str) -> None:
        """Add a camera that looks along −z, with y up; its scale is ignored.

        Args:
            name: name, to which a number is appended if it exists.
            world_from_camera: (4, 4) pose; left out if its axes are degenerate.
            lens: lens, or the reason why there is none.
        """
        if not np.abs(world_from_camera).max() < MAX_COORDINATE:  # false for NaN as well
            return
        ahead, up = -world_from_camera[:3, 2], world_from_camera[:3, 1]
        left = np.cross(up, ahead)
        lengths = np.linalg.norm(ahead), np.linalg.norm(left)
        if not min(lengths) > 0.0:
            return
        ahead, left = ahead / lengths[0], left / lengths[1]
        rotation = np.stack((ahead, left, np.cross(ahead, left)), axis=1)
        roll, pitch, yaw = (
            round(angle, 6) + 0.0  # avoids -0.0
            for angle in np.degrees(roll_pitch_yaw_from_rotation(rotation)).tolist()
        )
        x, y, z = world_from_camera[:3, 3].tolist()
        free = unique_name(name, set(self._poses), first=1)
        known = None if isinstance(lens, str) else lens
        self._poses[free] = parts.CameraPose(free, (x, y, z), yaw, pitch, roll, known)
        if isinstance(lens, str):
            self.notices.append(
                f"camera {free!r}: its pose is a viewpoint, but its lens is not used: {lens}"
            )


def read_lens(make: Callable[[], CentralCamera | str]) -> CentralCamera | str:
    """Lens, or the reason why its values are invalid."""
    try:
        return make()
    except (OmnisimError, ArithmeticError, ValueError) as reason:
        return " ".join(without_prefix(reason).split())


def pinhole(
    size: tuple[float, float], focal_length: float, offset: tuple[float, float] = (0.0, 0.0)
) -> CentralCamera:
    """Pinhole lens `HEIGHT_PX` high.

    Image plane and focal length are in one unit; `offset` is that of the plane's middle from the
    axis, right and up.
    """
    from omnisim.cameras import PerspectiveCamera  # few files have cameras

    per_unit = HEIGHT_PX / size[1]
    width = max(round(size[0] * per_unit), 1)
    middle = (0.5 * (width - 1), 0.5 * (HEIGHT_PX - 1))
    axis = (middle[0] - offset[0] * per_unit, middle[1] + offset[1] * per_unit)
    return PerspectiveCamera(width, HEIGHT_PX, focal_length * per_unit, axis)
