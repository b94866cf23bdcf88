"""Scenes that extend others: what is added, with names that are distinct."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from omnisim.errors import SceneError
from omnisim.scene.model import DynamicObject, Landmark, NamedStart, Scene, ScenePath

Named = Sequence[NamedStart | ScenePath | Landmark | DynamicObject]


def extend(base: Scene, additions: Scene, source: str) -> Scene:
    """Scene with the starts, paths and landmarks of two, and all else of the second.

    Args:
        base: the first.
        additions: the second.
        source: names the second in messages.

    Raises:
        SceneError: a name that both have.
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
    """Scene with further dynamic objects.

    Raises:
        SceneError: a name that the scene has.
    """
    if not objects:
        return scene
    _check_distinct(scene.objects, objects, f"{source}: objects")
    return dataclasses.replace(scene, objects=(*scene.objects, *objects))


def _check_distinct(first: Named, second: Named, where: str) -> None:
    names = {each.name for each in first}
    for each in second:
        if each.name in names:
            raise SceneError(f"{where}: name = {each.name!r}: the scene that it extends has one")
