"""MuJoCo models in motion: a static scene, and moving bodies as objects."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import SceneError, did_you_mean, printable
from omnisim.core.poses import inverse, pose_from_rotation
from omnisim.scene.formats.imported_scene import ImportedScene, make_mesh, translate
from omnisim.scene.formats.mjcf.meshes import visible_deformables
from omnisim.scene.formats.mjcf.reader import ModelReader, body_name
from omnisim.scene.light.lighting import DEFAULT_BACKGROUND, DEFAULT_LIGHTING
from omnisim.scene.model import Scene
from omnisim.scene.parts import Instance, StartPose

_WORLD = 0
_ORIGIN = StartPose((0.0, 0.0, 0.0))


class MovingModel(NamedTuple):
    """Model split into static geometry and moving bodies.

    Attributes:
        static: static geometry in the world, with lights and background.
        objects: moving bodies by name, each with everything fixed to it, in the body's frame.
        bodies: (n,) body indices in the model, in the order of `objects`.
        geom_of_instance: geom indices by instance name.
    """

    static: Scene
    objects: dict[str, Scene]
    bodies: NDArray[np.int64]
    geom_of_instance: dict[str, int]

    def poses(self, data: mujoco.MjData) -> NDArray[np.float64]:
        """Poses (n, 4, 4) world_from_object of the bodies."""
        rotations = data.xmat[self.bodies].reshape(-1, 3, 3)
        return pose_from_rotation(rotations, data.xpos[self.bodies])


def deformed(
    static: Scene, model: mujoco.MjModel, data: mujoco.MjData, groups: Collection[int]
) -> Scene:
    """Static scene of a model with its skins and flexible bodies in their current state.

    They remain the last instances, in the order of `split_model`.
    """
    soft = visible_deformables(model, data, groups)
    if not soft:
        return static
    meshes, instances = list(static.meshes), list(static.instances)
    for index, one in enumerate(soft, len(instances) - len(soft)):
        number, (positions, triangles, normals) = instances[index].mesh, one.mapped.surface
        mesh, center = make_mesh(
            one.name, positions, triangles, meshes[number].material, normals,
            one.mapped.texture_coordinates,
        )  # fmt: skip
        meshes[number] = mesh
        instances[index] = Instance(one.name, number, translate(np.eye(4), center), np.eye(4))
    return replace(static, meshes=tuple(meshes), instances=tuple(instances))


def split_model(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    groups: Collection[int],
    hidden: Collection[str],
) -> MovingModel:
    """Split a model into its static geometry and its moving bodies.

    Args:
        model, data: MuJoCo model and its data, with computed poses.
        groups: visible geom groups.
        hidden: instance names of hidden geoms.

    Raises:
        SceneError: an unknown name in `hidden`.
    """
    reader = ModelReader(model, data, groups)
    for name in hidden:
        if name not in reader.names:
            raise SceneError(f"hidden: {name!r}: {did_you_mean(name, reader.names, 'geoms:')}")
    roots = moving_roots(model)
    by_root: dict[int, list[int]] = {_WORLD: []}
    for geom in reader.geoms:
        if reader.names[geom] not in hidden:
            by_root.setdefault(int(roots[model.geom_bodyid[geom]]), []).append(geom)
    still = [*reader.instances(by_root.pop(_WORLD), np.eye(4)), *reader.deformables()]
    moving: dict[str, list[Instance]] = {}
    for root, geoms in by_root.items():
        pose = pose_from_rotation(data.xmat[root].reshape(3, 3), data.xpos[root])
        moving[body_name(model, root)] = reader.instances(geoms, inverse(pose))
    read = reader.content(still)
    return MovingModel(
        _scene("mujoco", read, still),
        {name: _scene(name, read, instances) for name, instances in moving.items()},
        np.array(list(by_root), dtype=np.int64),
        {name: geom for geom, name in enumerate(reader.names)},
    )


def moving_roots(model: mujoco.MjModel) -> NDArray[np.int32]:
    """Body (nbody,) to which each body is rigidly attached; 0: it never moves."""
    trees = model.body_rootid
    is_mocap = (model.body_weldid == _WORLD) & (model.body_mocapid[trees] >= 0)
    return np.where(is_mocap, trees, model.body_weldid)


def _scene(name: str, read: ImportedScene, instances: Iterable[Instance]) -> Scene:
    """Scene of some of the instances, with only the meshes that they use."""
    chosen = tuple(instances)
    index_of = {mesh: index for index, mesh in enumerate(dict.fromkeys(one.mesh for one in chosen))}
    return Scene(
        name=name,
        meshes=tuple(read.meshes[mesh] for mesh in index_of),
        materials=read.materials,
        instances=tuple(
            Instance(one.name, index_of[one.mesh], one.world_from_mesh, one.world_from_node)
            for one in chosen
        ),
        lighting=read.lighting or DEFAULT_LIGHTING,
        background=read.background or DEFAULT_BACKGROUND,
        start=_ORIGIN,
        notices=tuple(map(printable, read.notices)),
    )
