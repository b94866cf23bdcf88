"""Stage whose objects are the bodies of another simulator, and take their poses from its arrays."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.core.arrays import Floats
from omnisim.core.errors import NoticeWarning, OmnisimError, SceneError, did_you_mean
from omnisim.core.poses import MAX_M, inverse, pose_from_rotation, rotation_type
from omnisim.core.short_repr import counted
from omnisim.core.world import Motion, WorldState
from omnisim.ground_truth import InstanceLabel, Labels
from omnisim.ground_truth.frame import Frame
from omnisim.rendering.shared_scene import BackendName
from omnisim.rendering.stage import Stage
from omnisim.scene.files.load import read_scene
from omnisim.scene.formats.imported_scene import unique_name, world_from_axes
from omnisim.scene.labels import BODY
from omnisim.scene.light.lighting import DEFAULT_BACKGROUND, DEFAULT_LIGHTING
from omnisim.scene.model import Link, Scene

QuaternionOrder = Literal["wxyz", "xyzw"]
NO_BODY = -1
# Simulators of float32 let quaternions drift; one that was never set is zero.
MAX_LENGTH_ERROR = 0.01
SAME_POSE = 1e-3  # entries of rotations, for the check of the quaternions' order
LISTED = 6  # names in a notice


class BodyStage(Stage):
    """Stage whose objects follow the bodies of another simulator.

    Sensors are opened as on any stage; `vehicle` is the body that carries one, None: it is fixed to
    the world. They measure the states that `state` makes of the simulator's arrays.

    Args:
        scene: what stands still, with its lights; the links of a world's file (SDF, MJCF, USD) that
            can move are bodies.
        robots: files or scenes by name. The links of a file are bodies, named `robot/link`; a scene
            without links is one body with the robot's name, see `shape_scene`.
        names: the simulator's bodies in the order of its arrays. A link is matched by its whole
            name, or by as many of its last parts as tell it from the others. Bodies without a link
            are invisible, and carry sensors, too.
        quaternions: order of the components.
        up_axis, meters_per_unit: axes and unit of the simulator's world.
        device, backend: as for `omnisim.Stage`.

    Attributes:
        names: the simulator's bodies.
        notices: one line for each thing that is not drawn, or left alone.

    Raises:
        SceneError: an unreadable file, a name given twice, or nothing that can be drawn.
        OmnisimError: as for `omnisim.Stage`.
    """

    shows_all = True  # a body that no file has is worth a notice
    _added = 0  # bodies that a warning has named

    def __init__(
        self,
        scene: Scene | str | Path,
        robots: Mapping[str, Scene | str | Path] | None = None,
        *,
        names: Sequence[str],
        quaternions: QuaternionOrder = "wxyz",
        up_axis: str = "z",
        meters_per_unit: float = 1.0,
        device: int | str | None = None,
        backend: BackendName = "cube",
    ):
        self.names = tuple(names)
        self.fixed = unique_name(BODY, set(self.names), 2)  # robots may have a body of this name
        if twice := sorted({name for name in self.names if self.names.count(name) > 1}):
            raise SceneError(f"names: {twice[0]!r}: expected each body once")
        if quaternions not in ("wxyz", "xyzw"):
            raise OmnisimError(f"quaternions = {quaternions!r}: expected 'wxyz' or 'xyzw'")
        world = scene if isinstance(scene, Scene) else read_scene(scene)
        parts = {"": world} | {
            robot: part if isinstance(part, Scene) else read_scene(part)
            for robot, part in (robots or {}).items()
        }
        links: dict[str, Link] = {}
        for robot, part in parts.items():
            if robot and not part.links:
                links[robot] = Link("", np.eye(4), "")
            prefix = f"{robot}/" if robot else ""
            links |= {f"{prefix}{link.name}": link for link in part.links}
        body_of = match_names(list(links), self.names)
        # bodies of instances that another body carries, by its name and theirs
        self._owners: dict[tuple[str | None, str], str] = {}
        still, objects, lost = split_links(world, "", body_of, self._owners)
        for robot, part in parts.items():
            if robot and part.links:
                fixed, shapes, undrawn = split_links(part, f"{robot}/", body_of, self._owners)
                objects |= shapes
                lost += undrawn
                still = still.added(robot, fixed) if fixed.instances else still
            elif robot in body_of:
                objects[body_of[robot]] = part
            elif robot:
                lost.append(robot)
        notices = [notice for part in parts.values() for notice in part.notices]
        # bodies whose shapes are given one by one are invisible on purpose without
        expects_all = self.shows_all and any(part.links for part in parts.values())
        notices += _unmatched(lost, body_of, self.names, self.names if expects_all else ())
        self.notices = tuple(dict.fromkeys(notices))
        self._quaternions = quaternions
        self._world_from_host = world_from_axes(up_axis, meters_per_unit)
        self._turn = self._world_from_host[:3, :3] / meters_per_unit
        self._rest = {
            body_of[name]: link.world_from_link
            for name, link in links.items()
            if name in body_of and link.name
        }
        self._worlds: int | None = None
        self._id_tables: dict[str, tuple[Labels, NDArray[np.int32]]] = {}
        super().__init__(still, dynamic_objects=objects, device=device, backend=backend)
        for notice in self.notices:
            warnings.warn(notice, NoticeWarning, stacklevel=2 + (type(self) is not BodyStage))

    def carrier(self, name: str | None) -> str:
        """Body that carries a sensor; without one, the world.

        Raises:
            SceneError: no body of this name.
        """
        if name is None or name in (self.fixed, *self.names):
            return name or self.fixed
        found = match_names([name], self.names)
        if not found:
            raise SceneError(f"vehicle = {name!r}: {did_you_mean(name, self.names, 'bodies:')}")
        return found[name]

    def state(
        self, positions: ArrayLike, quaternions: ArrayLike | None = None, time_s: float = 0.0
    ) -> WorldState:
        """State of the world in which the bodies have given poses.

        Arrays may be of NumPy, or of any library that shares them by DLPack; those in a device's
        memory are copied.

        Args:
            positions: (bodies, 3) in the simulator's unit; or with the quaternions (bodies, 7).
            quaternions: (bodies, 4) of about unit length; None: they follow the positions.
            time_s: time of the state.

        Raises:
            OmnisimError: arrays of another shape, or numbers that are no pose; names the body.
        """
        poses = self._poses(positions, quaternions, 2)
        return self._states(poses[None], time_s)[0]

    def states(
        self, positions: ArrayLike, quaternions: ArrayLike | None = None, time_s: ArrayLike = 0.0
    ) -> list[WorldState]:
        """States of many worlds, for `render_batch`; arrays as for `state`, with (worlds, bodies).

        `time_s` is one time for all worlds, or (worlds,).

        Raises:
            OmnisimError: as for `state`; or another number of worlds than before.
        """
        poses = self._poses(positions, quaternions, 3)
        if len(poses) != (self._worlds or len(poses)):
            raise OmnisimError(
                f"positions: expected {self._worlds} worlds as before, got {len(poses)}: "
                "open another stage for them"
            )
        self._worlds = len(poses)
        return self._states(poses, time_s)

    def motion(
        self,
        positions: ArrayLike,
        quaternions: ArrayLike | None = None,
        *,
        linear: ArrayLike,
        angular: ArrayLike,
        time_s: float = 0.0,
    ) -> Motion:
        """Motion of the bodies around a time, for motion blur, rolling shutters and flow.

        Args:
            positions, quaternions, time_s: as for `state`.
            linear: (bodies, 3) velocities of the bodies' origins in the simulator's world and unit.
            angular: (bodies, 3) turn rates in rad/s about the axes of the simulator's world.

        Raises:
            OmnisimError: as for `state`.
        """
        poses = self._poses(positions, quaternions, 2)
        shape = (len(self.names), 3)
        speeds = _host_array(linear, "linear", shape) @ self._world_from_host[:3, :3].T
        rates = _host_array(angular, "angular", shape) @ self._turn.T

        def at(at_s: float) -> WorldState:
            moved = poses.copy()
            turns = rotation_type().from_rotvec(rates * (at_s - time_s)).as_matrix()
            moved[:, :3, :3] = turns @ poses[:, :3, :3]
            moved[:, :3, 3] += speeds * (at_s - time_s)
            return self._states(moved[None], at_s)[0]

        return at

    def body_ids(self, frame: Frame) -> NDArray[np.int32]:
        """Index (height, width) in `names` of each pixel's body; −1 for the world and the sky.

        Raises:
            OmnisimError: the frame was rendered without the channel instance.
        """
        index = {name: number for number, name in enumerate(self.names)}

        def id_of(instance: InstanceLabel) -> int:
            carrier = instance.object_name
            return index.get(self._owners.get((carrier, instance.name), carrier or ""), NO_BODY)

        return self._ids(frame, "body_ids", id_of)

    def _ids(
        self, frame: Frame, method: str, id_of: Callable[[InstanceLabel], int]
    ) -> NDArray[np.int32]:
        """ID (height, width) of each pixel's instance; −1 for the sky."""
        if "instance" not in frame.channels or frame.labels is None:
            raise OmnisimError(f"{method}: expected a frame with also=('instance',), got without")
        labels, ids = self._id_tables.get(method, (None, None))
        if labels is not frame.labels or ids is None:
            ids = np.array([NO_BODY, *map(id_of, frame.labels.instances)], dtype=np.int32)
            self._id_tables[method] = frame.labels, ids
        return ids[frame.channels["instance"]]

    def _warn_of_added(self, count: int) -> None:
        """Warn of bodies, by their count, that the simulator got after the stage was opened."""
        if count > self._added:
            self._added = count
            warnings.warn(
                f"not drawn: {counted(count, 'body', 'bodies')} added after the stage was opened: "
                "open another stage",
                NoticeWarning,
                stacklevel=4,
            )

    def _states(self, poses: Floats, time_s: ArrayLike) -> list[WorldState]:
        times = np.broadcast_to(time_s, len(poses)) if np.ndim(time_s) == 0 else time_s
        times = _host_array(times, "time_s", (len(poses),))
        if not np.isfinite(times).all():
            raise OmnisimError(f"time_s: expected a finite number of seconds, got {time_s!r}")
        still = {self.fixed: np.eye(4)}
        return [
            WorldState.of_checked({**still, **dict(zip(self.names, of_world, strict=True))}, at_s)
            for of_world, at_s in zip(poses, times.tolist(), strict=True)
        ]

    def _poses(
        self, positions: ArrayLike, quaternions: ArrayLike | None, dimensions: int
    ) -> Floats:
        """Poses (…, bodies, 4, 4) in the world."""
        shape: tuple[int | str, ...] = (len(self.names), 3 if quaternions is not None else 7)
        shape = shape if dimensions == 2 else ("worlds", *shape)
        given = _host_array(positions, "positions", shape)
        if quaternions is None:
            given, turns = given[..., :3], given[..., 3:]
        else:
            turns = _host_array(quaternions, "quaternions", (*given.shape[:-1], 4))
        lengths = np.linalg.norm(turns, axis=-1)
        is_right = (np.abs(given) < MAX_M).all(axis=-1) & (np.abs(lengths - 1.0) < MAX_LENGTH_ERROR)
        if not is_right.all():  # false for NaN as well
            *world, body = np.argwhere(~is_right)[0].tolist()
            at = (*world, body)
            where = f" of world {world[0]}" if world else ""
            raise OmnisimError(
                f"body {self.names[body]!r}{where}: expected a finite position and a unit "
                f"quaternion, got {given[at].tolist()} and {turns[at].tolist()}"
            )
        if self._quaternions == "wxyz":
            turns = turns[..., [1, 2, 3, 0]]
        rotations = rotation_type().from_quat(turns.reshape(-1, 4)).as_matrix()
        rotations = self._turn @ rotations.reshape(*given.shape[:-1], 3, 3)
        if self._rest:
            self._check_order(turns.reshape(-1, *turns.shape[-2:])[0], rotations)
        return pose_from_rotation(rotations, given @ self._world_from_host[:3, :3].T)

    def _check_order(self, xyzw: Floats, rotations: Floats) -> None:
        """Warn, once, if the first poses are those at rest with the other order of quaternions."""
        rest, self._rest = self._rest, {}
        chosen = [self.names.index(name) for name in rest]
        at_rest = np.array([pose[:3, :3] for pose in rest.values()])
        given = rotations.reshape(-1, *rotations.shape[-3:])[0][chosen]
        # what was read as x, y, z, w in the other order
        other = xyzw[:, [1, 2, 3, 0]] if self._quaternions == "xyzw" else xyzw[:, [3, 0, 1, 2]]
        swapped = self._turn @ rotation_type().from_quat(other[chosen]).as_matrix()
        if np.abs(swapped - at_rest).max() < SAME_POSE <= np.abs(given - at_rest).max():
            order = "wxyz" if self._quaternions == "xyzw" else "xyzw"
            warnings.warn(
                f"quaternions = {self._quaternions!r}: as {order!r} the first poses would be those "
                "at rest of the files: check the order",
                NoticeWarning,
                stacklevel=4,
            )


def _host_array(values: Any, name: str, shape: tuple[int | str, ...]) -> Floats:
    """Array in this process's memory, of a shape in which text stands for any number.

    Raises:
        OmnisimError: another shape, or no array.
    """
    for step in ("detach", "cpu", "numpy"):  # torch, also on a device; Warp has the last alone
        if not isinstance(values, np.ndarray) and hasattr(values, step):
            values = getattr(values, step)()
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise OmnisimError(f"{name}: expected numbers, got {type(values).__name__}") from None
    wanted = "(" + ", ".join(map(str, shape)) + ")"
    sizes = zip(shape, array.shape, strict=False)
    if array.ndim != len(shape) or any(isinstance(a, int) and a != b for a, b in sizes):
        raise OmnisimError(f"{name}: expected an array {wanted}, got {array.shape}")
    return array


# Scenes whose links move.


def split_links(
    scene: Scene,
    prefix: str,
    body_of: Mapping[str, str],
    owners: dict[tuple[str | None, str], str],
) -> tuple[Scene, dict[str, Scene], list[str]]:
    """Split a scene into what stands still, and the shapes of bodies in their own frames.

    Links that are fixed to each other are one shape, in the frame of the first one that is a body.

    Args:
        scene: scene with links.
        prefix: text before its links' names in `body_of`.
        body_of: name of the body by that of the link.
        owners: gets the body of each instance whose link another body carries, by the name of that
            body and of the instance.

    Returns:
        The scene without its moving links; shapes by the body's name; links that no body moves.
    """
    links = {link.name: link for link in scene.links}
    roots: dict[str, str] = {"": ""}
    for name in links:
        root, passed = name, {name}
        while root and (onto := links[root].fixed_to) not in passed and (not onto or onto in links):
            root = onto
            passed.add(root)
        roots[name] = root
    carriers: dict[str, Link] = {}
    for name, root in sorted(roots.items(), key=lambda item: item[0] != item[1]):
        if prefix + name in body_of:
            carriers.setdefault(root, links[name])
    link_of = {name: link.name for link in scene.links for name in link.instances}
    groups: dict[str, list[int]] = {"": []}
    for index, instance in enumerate(scene.instances):
        link = link_of.get(instance.name, instance.name)
        while link and link not in links:
            link = link.rpartition("/")[0]
        groups.setdefault(roots[link], []).append(index)
        if roots[link] in carriers and (own := body_of.get(prefix + link)) is not None:
            owners[body_of[prefix + carriers[roots[link]].name], instance.name] = own
    still = replace(part_of(scene, groups.pop(""), np.eye(4)), links=())
    shapes, lost = {}, []
    for root, chosen in groups.items():
        if root not in carriers:
            lost.append(prefix + root)
            continue
        carrier = carriers[root]
        shape = part_of(scene, chosen, inverse(carrier.world_from_link))
        body = body_of[prefix + carrier.name]
        shapes[body] = replace(
            shape, name=body, lighting=DEFAULT_LIGHTING, background=DEFAULT_BACKGROUND,
            links=(), objects=(),
        )  # fmt: skip
    return still, shapes, lost


def part_of(scene: Scene, chosen: Sequence[int], frame_from_world: Floats) -> Scene:
    """Scene of some instances, by index, in another frame; with the meshes that they need."""
    instances = [scene.instances[index] for index in chosen]
    numbers = {mesh: new for new, mesh in enumerate(dict.fromkeys(one.mesh for one in instances))}
    moved = tuple(
        replace(
            one,
            mesh=numbers[one.mesh],
            world_from_mesh=frame_from_world @ one.world_from_mesh,
            world_from_node=frame_from_world @ one.world_from_node,
        )
        for one in instances
    )
    meshes = tuple(scene.meshes[mesh] for mesh in numbers)
    return replace(scene, meshes=meshes, instances=moved)


# Names of links, of files, and of bodies, of a simulator.


def _parts(name: str) -> tuple[str, ...]:
    return tuple(part for part in name.replace("::", "/").replace(":", "/").split("/") if part)


def match_names(links: Sequence[str], bodies: Sequence[str]) -> dict[str, str]:
    """Body of each link that has one, by the whole name or its last parts, if only one has them."""
    free, found = {name: _parts(name) for name in bodies}, {}
    for link in links:
        if link in free:
            found[link] = link
            del free[link]
    for link in links:
        wanted = _parts(link)
        for count in range(len(wanted), 0, -1):
            if link in found:
                break
            tail = wanted[-count:]
            near = [name for name, parts in free.items() if _ends_alike(parts, tail)]
            rivals = [one for one in links if one not in found and _parts(one)[-count:] == tail]
            if len(near) == 1 and rivals == [link]:
                found[link] = near[0]
                del free[near[0]]
    return found


def _ends_alike(parts: tuple[str, ...], tail: tuple[str, ...]) -> bool:
    return parts[-len(tail) :] == tail or (len(parts) < len(tail) and tail[-len(parts) :] == parts)


def _unmatched(
    lost: Sequence[str], body_of: Mapping[str, str], names: Sequence[str], expected: Sequence[str]
) -> list[str]:
    """Notices for links that no body moves, and for expected bodies that no file has."""
    notices = []
    if lost:
        shown = ", ".join(f"{link!r} ({did_you_mean(link, names, 'bodies:')})" for link in lost[:2])
        more = f" and {len(lost) - 2} more" if len(lost) > 2 else ""
        notices.append(f"not drawn: no body moves {counted(len(lost), 'link')}: {shown}{more}")
    known = set(body_of.values())
    bare = [name for name in expected if name not in known]
    if bare:
        shown = ", ".join(bare[:LISTED]) + (", …" if len(bare) > LISTED else "")
        notices.append(f"invisible: {counted(len(bare), 'body', 'bodies')} in no file: {shown}")
    return notices
