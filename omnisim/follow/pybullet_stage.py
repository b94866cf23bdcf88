"""Stage of a PyBullet world: its bodies and links, with the visual shapes that it tells."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.arrays import Floats
from omnisim.core.errors import OmnisimError, SceneError
from omnisim.core.extras import require_extra
from omnisim.core.files.sources import SourceReader
from omnisim.core.poses import pose_from_rotation, rotation_type
from omnisim.core.srgb import linear_from_srgb
from omnisim.core.world import Motion, WorldState
from omnisim.follow.body_shapes import Shape, shape_scene
from omnisim.follow.body_stage import BodyStage
from omnisim.rendering.shared_scene import BackendName
from omnisim.scene import primitives
from omnisim.scene.files.load import read_scene
from omnisim.scene.formats.imported_scene import Omissions, unique_name
from omnisim.scene.formats.sdf.geometry import MeshLibrary
from omnisim.scene.model import Light, Lighting, LightKind, Scene, StartPose
from omnisim.scene.textures import TextureStore

_BASE = -1  # index of the base among a body's links
_PLANE_M = 500.0  # half the side of an infinite plane
_NEAR_M = 1e-3
# Light of getCameraImage where it is given none. Source: TinyRenderer, which multiplies sRGB colors
# by 0.6, and by up to 0.98 in the sun: linear ones by 0.32, and 0.96.
_SUN = Light(
    LightKind.DIRECTIONAL, (1.0, 1.0, 1.0), 0.64, casts_shadow=False,
    direction=np.array((50.0, -30.0, -100.0)) / np.linalg.norm((50.0, -30.0, -100.0)),
)  # fmt: skip
_EMPTY = Scene(
    "pybullet", (), (), (), Lighting((0.32, 0.32, 0.32), (_SUN,), is_matte=True),
    (1.0, 1.0, 1.0), StartPose((0.0, 0.0, 0.0)),
)  # fmt: skip


class PyBulletStage(BodyStage):
    """Stage whose objects are the links of a PyBullet world, as PyBullet draws them.

    Links are named `body/link`, of bodies of one name the later ones `body_2/link`; a link's frame
    is that of the URDF, not its center of mass. PyBullet tells no program of meshes and height
    fields made of arrays, of textures set by `changeVisualShape`, and of the directions of MJCF's
    capsules: bodies with these are drawn from `files`.

    Args:
        client: number of a client that has loaded its bodies, or a `BulletClient`; or several,
            which are worlds with the same bodies loaded in the same order.
        surroundings: what else stands still, and the lights; None: the light of `getCameraImage`.
        files: files, or scenes as of `shape_scene`, by PyBullet's ID of the body that they show.
        device, backend: as for `omnisim.Stage`.

    Attributes:
        links: PyBullet's body ID and link index, −1 for a base, in the order of `names`.

    Raises:
        OmnisimError: PyBullet is not installed, or the client is not connected.
        SceneError: nothing to draw, or an unreadable file.
    """

    def __init__(
        self,
        client: Any = 0,
        *,
        surroundings: Scene | str | Path | None = None,
        files: Mapping[int, Scene | str | Path] | None = None,
        device: int | str | None = None,
        backend: BackendName = "cube",
    ):
        require_extra("pybullet", "omnisim.follow.PyBulletStage")
        self._bullet = importlib.import_module("pybullet")
        clients = client if isinstance(client, Sequence) else [client]
        self._clients, given = [self._number(one) for one in clients], files or {}
        self._client = self._clients[0]
        names, robot_of = self._list_links()
        if unknown := [body for body in given if body not in robot_of]:
            raise SceneError(f"files: expected IDs of {[*robot_of]}, got {unknown[0]}")
        told = _VisualShapes(self._bullet, self._client)
        poses = self._read(self._client)
        robots: dict[str, Scene | str | Path] = {}
        for name, (body, link), pose in zip(names, self.links, poses, strict=True):
            if body not in given:
                if shapes := told.of_link(body, link, pose):
                    robots[name] = shape_scene(name, shapes)
            elif link == _BASE:
                file = given[body]
                is_one_body = isinstance(file, Scene) and not file.links
                robots[name if is_one_body else robot_of[body]] = file
        if not robots:
            reasons = "".join(f"; {notice}" for notice in told.notices)
            raise SceneError(f"client {self._client}: expected bodies to draw, got none{reasons}")
        if surroundings is None:
            world = _EMPTY
        else:
            world = surroundings if isinstance(surroundings, Scene) else read_scene(surroundings)
        super().__init__(
            replace(world, notices=(*world.notices, *told.notices)) if told.notices else world,
            robots, names=names, quaternions="xyzw", device=device, backend=backend,
        )  # fmt: skip
        self._rest.clear()  # the order of quaternions is known

    def name_of(self, body: int, link: int = _BASE) -> str:
        """Name of a link by PyBullet's numbers, for `open(…, vehicle=name)`.

        Raises:
            SceneError: no such link when the stage was opened.
        """
        if (body, link) not in self.links:
            raise SceneError(f"body {body}, link {link}: unknown when the stage was opened")
        return self.names[self.links.index((body, link))]

    def now(self, time_s: float = 0.0) -> WorldState:
        """State of the world, or of the first one; PyBullet does not tell its time.

        Raises:
            OmnisimError: a body was removed, or has a pose that is not finite.
        """
        return self.state(self._read(self._client), time_s=time_s)

    def worlds_now(self, time_s: float = 0.0) -> list[WorldState]:
        """States of the worlds of all clients.

        Raises:
            OmnisimError: as for `now`.
        """
        worlds = [self._read(client) for client in self._clients]
        return self.states(np.array(worlds), time_s=time_s)

    def motion_now(self, time_s: float = 0.0) -> Motion:
        """Motion of the world, or of the first one, by its current velocities.

        Raises:
            OmnisimError: as for `now`.
        """
        read = self._read(self._client, with_velocities=True)
        poses, mass_m, linear, angular = np.split(read, (7, 10, 13), axis=1)
        linear = linear + np.cross(angular, poses[:, :3] - mass_m)
        return self.motion(poses, linear=linear, angular=angular, time_s=time_s)

    def _number(self, client: Any) -> int:
        number = getattr(client, "_client", client)
        if not self._bullet.getConnectionInfo(number)["isConnected"]:
            raise OmnisimError(f"client {number!r}: expected a connected client of PyBullet")
        return int(number)

    def _list_links(self) -> tuple[list[str], dict[int, str]]:
        """Names of the links, and of the robots by body ID; fills what reading poses takes."""
        bullet, at = self._bullet, {"physicsClientId": self._client}
        names: list[str] = []
        links: list[tuple[int, int]] = []
        robot_of: dict[int, str] = {}
        self._joints: dict[int, range] = {}
        self._mass_from_base: dict[int, Any] = {}
        for number in range(bullet.getNumBodies(**at)):
            body = bullet.getBodyUniqueId(number, **at)
            self._joints[body] = range(bullet.getNumJoints(body, **at))
            texts = [*bullet.getBodyInfo(body, **at)]
            texts += [bullet.getJointInfo(body, joint, **at)[12] for joint in self._joints[body]]
            base, own, *inner = (text.decode("utf-8", "replace") for text in texts)
            robot_of[body] = unique_name(own or f"body{body}", set(robot_of.values()), first=2)
            used = set[str]()
            names += [
                f"{robot_of[body]}/{unique_name(link, used, first=2)}" for link in (base, *inner)
            ]
            links += [(body, _BASE), *((body, joint) for joint in self._joints[body])]
            base_from_mass = bullet.getDynamicsInfo(body, _BASE, **at)[3:5]
            self._mass_from_base[body] = bullet.invertTransform(*base_from_mass)
        self.links = tuple(links)
        return names, robot_of

    def _read(self, client: int, with_velocities: bool = False) -> Floats:
        """Pose of each link (7,), xyzw; then its center of mass and velocities, linear, angular."""
        bullet, at, rows = self._bullet, {"physicsClientId": client}, []
        try:
            for body, joints in self._joints.items():
                mass = bullet.getBasePositionAndOrientation(body, **at)
                base = bullet.multiplyTransforms(*mass, *self._mass_from_base[body])
                row = (*base[0], *base[1])
                if with_velocities:
                    linear, angular = bullet.getBaseVelocity(body, **at)
                    row = (*row, *mass[0], *linear, *angular)
                rows.append(row)
                if joints:  # without forward kinematics, they are as before the last step
                    states = bullet.getLinkStates(body, joints, with_velocities, True, **at)
                    if with_velocities:
                        rows += [(*one[4], *one[5], *one[0], *one[6], *one[7]) for one in states]
                    else:
                        rows += [(*one[4], *one[5]) for one in states]
        except bullet.error:
            raise OmnisimError(
                f"client {client}: body {body} was removed: open another stage"
            ) from None
        self._warn_of_added(bullet.getNumBodies(**at) - len(self._joints))
        return np.array(rows)


class _VisualShapes:
    """Visual shapes that a client tells; one notice for each kind that it does not tell."""

    def __init__(self, bullet: Any, client: int) -> None:
        self._bullet, self._at, self._omissions = bullet, {"physicsClientId": client}, Omissions()
        self._files = MeshLibrary(TextureStore(), SourceReader())
        self._told: dict[int, Sequence[Any]] = {}

    @property
    def notices(self) -> list[str]:
        """One line for each kind of shapes that is not drawn."""
        return self._omissions.notices

    def of_link(self, body: int, link: int, world_from_link: Floats) -> list[Shape]:
        """Visual shapes of a link, in its frame; its pose is (7,), xyzw."""
        if body not in self._told:
            flags = self._bullet.VISUAL_SHAPE_DATA_TEXTURE_UNIQUE_IDS
            self._told[body] = self._bullet.getVisualShapeData(body, flags, **self._at)
        visible = [told for told in self._told[body] if told[1] == link and told[7][3] > 0.0]
        return [shape for told in visible for shape in self._read(told, world_from_link)]

    def _read(self, told: Sequence[Any], world_from_link: Floats) -> Iterator[Shape]:
        bullet = self._bullet
        body, link, kind, sizes, file, place, turn, rgba, texture = told
        pose = pose_from_rotation(rotation_type().from_quat(turn).as_matrix(), place)
        color = np.append(linear_from_srgb(np.clip(rgba[:3], 0.0, 1.0)), min(rgba[3], 1.0))
        match kind:
            case bullet.GEOM_MESH if file:
                yield from self._mesh(file, sizes, pose, color, texture >= 0)
            case bullet.GEOM_SPHERE | bullet.GEOM_CYLINDER | bullet.GEOM_CAPSULE if not any(sizes):
                pass  # a contact point of Laikago's feet
            case bullet.GEOM_BOX:
                yield Shape(primitives.box(0.5 * np.array(sizes)), pose, color, name="box")
            case bullet.GEOM_SPHERE:
                yield Shape(primitives.ellipsoid((sizes[0],) * 3), pose, color, name="sphere")
            case bullet.GEOM_CYLINDER:
                surface = primitives.cylinder(sizes[1], 0.5 * sizes[0])
                yield Shape(surface, pose, color, name="cylinder")
            case bullet.GEOM_CAPSULE if self._is_inside(told, world_from_link):
                surface = primitives.capsule(sizes[1], 0.5 * sizes[0])
                yield Shape(surface, pose, color, name="capsule")
            case bullet.GEOM_PLANE:
                planes = bullet.getCollisionShapeData(body, link, **self._at)
                for normal in [plane[3] for plane in planes if plane[2] == kind][:1]:
                    turned, _ = rotation_type().align_vectors([normal], [(0.0, 0.0, 1.0)])
                    pose = pose @ pose_from_rotation(turned.as_matrix(), np.zeros(3))
                yield Shape(primitives.rectangle(_PLANE_M, _PLANE_M), pose, color, name="plane")
            case _:
                self._omissions.count(
                    "not drawn: PyBullet does not tell meshes and height fields made of arrays, "
                    f"and capsules of MJCF: PyBulletStage(files={{{body}: …}}) draws this body by "
                    "a file, or by a shape_scene",
                    "shape",
                )

    def _mesh(
        self, file: bytes, scale: ArrayLike, pose: Floats, color: Floats, has_texture: bool
    ) -> Iterator[Shape]:
        """Shapes of a mesh file; PyBullet takes textures of its materials, and no colors."""
        path = Path(file.decode("utf-8", "replace"))
        read = self._files.load(path)
        if isinstance(read, str):
            self._omissions.count(f"{path.name}: not drawn: {read}", "shape")
            return
        for instance in read.instances:
            mesh = read.meshes[instance.mesh]
            link_from_mesh = np.diag((*np.asarray(scale), 1.0)) @ instance.world_from_mesh
            turn, normals = link_from_mesh[:3, :3], mesh.normals
            if normals is not None:
                normals = normals @ np.linalg.inv(turn)
                normals = normals / np.maximum(np.linalg.norm(normals, axis=1), 1e-30)[:, None]
            triangles = mesh.triangles if np.linalg.det(turn) > 0.0 else mesh.triangles[:, ::-1]
            surface = mesh.positions @ turn.T + link_from_mesh[:3, 3], triangles, normals
            uv, texture = mesh.texture_coordinates, read.materials[mesh.material].texture
            if not has_texture or uv is None or texture is None:
                yield Shape(surface, pose, color, double_sided=True, name=path.stem)
            else:
                yield Shape(surface, pose, color, uv, texture.pixels, True, path.stem)

    def _is_inside(self, told: Sequence[Any], world_from_link: Floats) -> bool:
        """False for a capsule beyond what collides: `fromto` of MJCF is told without its pose."""
        body, link, _, (length, radius, _), _, place, turn, *_ = told
        if np.any(place) or tuple(turn) != (0.0, 0.0, 0.0, 1.0):
            return True
        axis = rotation_type().from_quat(world_from_link[3:]).as_matrix()[:, 2]
        reach, center = 0.5 * length * np.abs(axis) + radius - _NEAR_M, world_from_link[:3]
        low, high = self._bullet.getAABB(body, link, **self._at)
        return bool((center - reach > low).all() and (center + reach < high).all())
