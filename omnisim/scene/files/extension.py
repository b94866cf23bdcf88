"""Extension of scenes by starts, paths, landmarks and dynamic objects with unique names."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import SceneError
from omnisim.core.poses import inverse
from omnisim.scene.formats.imported_scene import ImportedObject
from omnisim.scene.model import DynamicObject, Instance, Landmark, NamedStart, Scene, ScenePath

Named = Sequence[NamedStart | ScenePath | Landmark | DynamicObject]


def extend(base: Scene, additions: Scene, source: str) -> Scene:
    """Scene that combines the starts, paths and landmarks of two scenes.

    Args:
        base: first scene; only its starts, paths and landmarks are used.
        additions: second scene, which supplies everything else.
        source: name of the second scene in messages.

    Raises:
        SceneError: a name that both scenes have.
    """
    _check_distinct(base.starts, additions.starts, f"{source}: starts")
    _check_distinct(base.paths, additions.paths, f"{source}: paths")
    _check_distinct(base.landmarks, additions.landmarks, f"{source}: landmarks")
    return dataclasses.replace(
        additions,
        starts=(*base.starts, *additions.starts),
        paths=(*base.paths, *additions.paths),
        landmarks=(*base.landmarks, *additions.landmarks),
    )


def with_objects(scene: Scene, objects: tuple[DynamicObject, ...], source: str) -> Scene:
    """Scene with additional dynamic objects.

    Raises:
        SceneError: a name that the scene already has.
    """
    if not objects:
        return scene
    _check_distinct(scene.objects, objects, f"{source}: objects", "the scene")
    return dataclasses.replace(scene, objects=(*scene.objects, *objects))


def with_moving_instances(scene: Scene, objects: Sequence[ImportedObject]) -> Scene:
    """Scene in which a file's moving instances become dynamic objects."""
    if not objects:
        return scene
    moving = {number for one in objects for number in one.instances}
    static_numbers = [number for number in range(len(scene.instances)) if number not in moving]
    new_objects = tuple(
        DynamicObject(
            one.name,
            dataclasses.replace(
                _part(scene, one.instances, inverse(one.motion.pose_at(0.0))),
                name=one.name,
                notices=(), starts=(), paths=(), landmarks=(), cameras=(),
            ),
            one.motion,
        )
        for one in objects
    )  # fmt: skip
    return dataclasses.replace(_part(scene, static_numbers, np.eye(4)), objects=new_objects)


def _part(scene: Scene, numbers: Sequence[int], part_from_world: NDArray[np.float64]) -> Scene:
    """Scene with some of the instances, and only the meshes and materials that they use."""
    instances = [scene.instances[number] for number in numbers]
    mesh_at = {number: at for at, number in enumerate(sorted({one.mesh for one in instances}))}
    meshes = [scene.meshes[number] for number in mesh_at]
    material_at = {number: at for at, number in enumerate(sorted({one.material for one in meshes}))}
    return dataclasses.replace(
        scene,
        meshes=tuple(
            dataclasses.replace(one, material=material_at[one.material]) for one in meshes
        ),
        materials=tuple(scene.materials[number] for number in material_at),
        instances=tuple(
            Instance(
                one.name,
                mesh_at[one.mesh],
                part_from_world @ one.world_from_mesh,
                part_from_world @ one.world_from_node,
            )
            for one in instances
        ),
    )


def _check_distinct(
    first: Named, second: Named, where: str, whose: str = "the scene that it extends"
) -> None:
    names = {each.name for each in first}
    for each in second:
        if each.name in names:
            raise SceneError(f"{where}: name = {each.name!r}: {whose} has one")
