"""Stage that follows a simulation of Newton; needs the extra `newton`."""

from __future__ import annotations

import importlib
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats
from omnisim.core.errors import OmnisimError
from omnisim.core.extras import require_extra
from omnisim.core.poses import pose_from_rotation, rotation_type
from omnisim.core.short_repr import counted
from omnisim.core.srgb import linear_from_srgb
from omnisim.core.world import Motion, WorldState
from omnisim.follow.body_shapes import Shape, shape_scene
from omnisim.follow.body_stage import BodyStage
from omnisim.rendering.shared_scene import BackendName
from omnisim.scene import primitives
from omnisim.scene.formats.imported_scene import unique_name, world_from_axes
from omnisim.scene.primitives import PrimitiveSurface

_GLOBAL = -1  # world of what all worlds share; body of what stands still
_PLANE_M = 500.0  # half the side of an infinite plane, as in Newton's viewer


class NewtonStage(BodyStage):
    """Stage whose objects are the bodies of a Newton model.

    Visible shapes are read once, with colors and textures: those of world 0, and those that belong
    to no world, which all worlds show. Lights are omnisim's daylight.

    Args:
        model: `newton.Model`; all of its worlds have the same bodies and shapes.
        state: `newton.State` that `now` reads if it is given none; None: a new one of the model.
        device, backend: as for `omnisim.Stage`.

    Attributes:
        names: labels of the bodies of world 0, then of those that belong to no world.
        notices: one line for each thing that is not drawn.

    Raises:
        OmnisimError: Newton is not installed, worlds that differ, or as for `BodyStage`.
    """

    shows_all = False  # bodies without visible shapes are usual

    def __init__(
        self,
        model: Any,
        state: Any = None,
        *,
        device: int | str | None = None,
        backend: BackendName = "cube",
    ):
        require_extra("newton", "NewtonStage")
        newton = importlib.import_module("newton")
        if not model.body_count:
            raise OmnisimError("model: expected bodies, got none")
        self._state = model.state() if state is None else state
        self._bodies = _bodies_of_worlds(model)
        self._centers = model.body_com.numpy()[self._bodies[0]]
        used: set[str] = set()
        names = [unique_name(model.body_label[body], used, 2) for body in self._bodies[0]]
        _check_worlds(model, self._bodies)
        axis = "xyz"[int(model.up_axis)]
        shapes: dict[int, list[Shape]] = {body: [] for body in (_GLOBAL, *self._bodies[0])}
        omitted = 0
        for index in np.flatnonzero(model.shape_world.numpy() <= 0):
            if int(model.shape_flags.numpy()[index]) & int(newton.ShapeFlags.VISIBLE):
                shape = _shape(newton, model, int(index))
                if shape is None:
                    omitted += 1
                else:
                    shapes[int(model.shape_body.numpy()[index])].append(shape)
        world_from_host = world_from_axes(axis, 1.0)
        still = shape_scene("", [
            replace(shape, body_from_shape=world_from_host @ shape.body_from_shape)
            for shape in shapes.pop(_GLOBAL)
        ])  # fmt: skip
        counts = ((omitted, "shape"), (model.particle_count, "particle"), (model.tri_count, "face"))
        lost = [counted(count, noun) for count, noun in counts if count]
        notices = (f"not drawn: {', '.join(lost)}",) if lost else ()
        robots = {
            name: shape_scene(name, shapes[body])
            for name, body in zip(names, self._bodies[0], strict=True)
            if shapes[body]
        }
        super().__init__(
            replace(still, name="newton", notices=notices), robots, names=names,
            quaternions="xyzw", up_axis=axis, device=device, backend=backend,
        )  # fmt: skip

    def now(self, state: Any = None, time_s: float = 0.0) -> WorldState:
        """State of the only world, copied.

        Args:
            state: `newton.State`; None: that of the stage. Loops that swap two pass the newer one.
            time_s: time of the state, which Newton leaves to the loop.

        Raises:
            OmnisimError: several worlds, or as for `state`.
        """
        return self.state(self._one(self._poses_of(state)), time_s=time_s)

    def worlds_now(self, state: Any = None, time_s: float = 0.0) -> list[WorldState]:
        """States of all worlds, copied; arguments as for `now`.

        Raises:
            OmnisimError: as for `states`.
        """
        return self.states(self._poses_of(state), time_s=time_s)

    def motion_now(self, state: Any = None, time_s: float = 0.0) -> Motion:
        """Motion of the bodies around a state of the only world; arguments as for `now`.

        Raises:
            OmnisimError: several worlds, or as for `motion`.
        """
        poses = self._one(self._poses_of(state))
        speeds = (self._state if state is None else state).body_qd.numpy()[self._bodies[0]]
        linear, angular = speeds[:, :3], speeds[:, 3:]  # linear: that of the center of mass
        arms = -rotation_type().from_quat(poses[:, 3:]).apply(self._centers)
        return self.motion(
            poses, linear=linear + np.cross(angular, arms), angular=angular, time_s=time_s
        )

    def _poses_of(self, state: Any) -> Floats:
        """Positions and quaternions (worlds, bodies, 7)."""
        poses: Floats = (self._state if state is None else state).body_q.numpy()
        return poses[self._bodies]

    def _one(self, poses: Floats) -> Floats:
        if len(poses) > 1:
            raise OmnisimError(f"state: expected one world, got {len(poses)}: see worlds_now")
        return poses[0]


def _bodies_of_worlds(model: Any) -> NDArray[np.int64]:
    """Indices (worlds, bodies) of each world's bodies; shared ones are the last of each.

    Raises:
        OmnisimError: worlds of other numbers of bodies.
    """
    world_of = model.body_world.numpy()
    shared = np.flatnonzero(world_of == _GLOBAL)
    worlds = [np.flatnonzero(world_of == world) for world in range(max(model.world_count, 1))]
    for world, bodies in enumerate(worlds):
        if len(bodies) != len(worlds[0]):
            raise _unlike(world, f"{len(worlds[0])} bodies", str(len(bodies)))
    return np.array([np.concatenate((bodies, shared)) for bodies in worlds])


def _check_worlds(model: Any, bodies_of_worlds: NDArray[np.int64]) -> None:
    """Reject worlds whose shapes differ from those of world 0.

    Raises:
        OmnisimError: other shapes, or at other places; names the world.
    """
    place = np.full(model.body_count + 1, _GLOBAL)  # of a body in its world; the last: no body
    for bodies in bodies_of_worlds:
        place[bodies] = np.arange(len(bodies))
    columns = (model.shape_type, model.shape_scale, model.shape_transform)
    arrays = [column.numpy().reshape(model.shape_count, -1) for column in columns]
    table = np.column_stack((*arrays, place[model.shape_body.numpy()]))
    sources = [hash(source) for source in model.shape_source]
    world_of, first = model.shape_world.numpy(), None
    for world in range(len(bodies_of_worlds)):
        own = np.flatnonzero(world_of == world)
        found = [(*table[index].tolist(), sources[index]) for index in own]
        first = found if first is None else first
        if found != first:
            raise _unlike(world, "the shapes and places", "others")


def _unlike(world: int, expected: str, got: str) -> OmnisimError:
    return OmnisimError(f"model: world {world}: expected {expected} as in world 0, got {got}")


def _shape(newton: Any, model: Any, index: int) -> Shape | None:
    """Visual shape; None: a kind without a surface."""
    kind, scale = int(model.shape_type.numpy()[index]), model.shape_scale.numpy()[index]
    source, types = model.shape_source[index], newton.GeoType
    if kind in (types.NONE, types.GAUSSIAN):
        return None
    x, y, z, *turn = model.shape_transform.numpy()[index].tolist()
    pose = pose_from_rotation(rotation_type().from_quat(turn).as_matrix(), np.array((x, y, z)))
    color = linear_from_srgb(model.shape_color.numpy()[index])
    opacity = 1.0 if model.shape_opacity is None else float(model.shape_opacity.numpy()[index])
    is_mesh, uv, texture = kind in (types.MESH, types.CONVEX_MESH), None, None
    if is_mesh and source.texture is not None and source.uvs is not None:
        texture = newton.utils.normalize_texture(
            newton.utils.load_texture(source.texture), require_channels=True
        )
        affine = np.asarray(source.texture_transform)
        uv = (source.uvs @ affine[:, :2].T + affine[:, 2]) * (1.0, -1.0) + (0.0, 1.0)
    return Shape(
        _surface(newton, kind, scale.astype(np.float64), source), pose,
        np.clip((*color, opacity), 0.0, 1.0), uv if texture is not None else None, texture,
        double_sided=is_mesh or kind in (types.PLANE, types.HFIELD),
        name=model.shape_label[index].rpartition("/")[2] or f"shape_{index}",
    )  # fmt: skip


def _surface(newton: Any, kind: int, scale: Floats, source: Any) -> PrimitiveSurface:
    types, (radius, half) = newton.GeoType, scale[:2].tolist()
    if kind == types.PLANE:
        return primitives.rectangle(*(0.5 * side if side > 0.0 else _PLANE_M for side in scale[:2]))
    if kind == types.HFIELD:
        heights = source.min_z + source.data * (source.max_z - source.min_z)
        source = newton.Mesh.create_heightfield(
            heights.T, 2.0 * source.hx, 2.0 * source.hy, ground_z=source.min_z,
            compute_inertia=False,
        )  # fmt: skip
    if kind == types.SPHERE:
        return primitives.ellipsoid((radius,) * 3)
    if kind == types.ELLIPSOID:
        return primitives.ellipsoid(scale)
    if kind == types.BOX:
        return primitives.box(scale)
    if kind == types.CAPSULE:
        return primitives.capsule(radius, half)
    if kind == types.CONE:
        return primitives.cone(radius, half)
    if kind == types.CYLINDER and not scale[2]:
        return primitives.cylinder(radius, half)
    if kind == types.CYLINDER:  # a barrel
        source = newton.Mesh.create_cylinder(
            radius, half, up_axis=newton.Axis.Z, barrel_radius=scale[2], compute_inertia=False
        )
    if kind in (types.HFIELD, types.CYLINDER):
        scale = np.ones(3)
    triangles = np.asarray(source.indices).reshape(-1, 3)
    triangles = triangles[:, ::-1] if scale.prod() < 0.0 else triangles
    normals = None if source.normals is None else source.normals / scale
    if normals is not None:
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = normals / np.where(lengths > 0.0, lengths, 1.0)
    return PrimitiveSurface(source.vertices * scale, triangles, normals)
