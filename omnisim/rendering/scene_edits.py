"""Edits of a scene that is on the GPU: the next frame shows them, and nothing is loaded again."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection
from pathlib import Path

from numpy.typing import ArrayLike

from omnisim.core.errors import SceneError
from omnisim.scene import Scene, load_scene


class EditableScene(ABC):
    """Base of stages and renderers, whose scene may become another one.

    An edit costs what it changes, and a look at each instance; whatever stays is not uploaded
    again. Instances that were added, moved or recolored are drawn one by one, with light computed
    in each texel: a new renderer of the same scene bakes it, and rounds the places of their corners
    otherwise, so that its images may differ by a step of 255, and by texels at silhouettes.
    """

    @property
    @abstractmethod
    def _moving(self) -> Collection[str]:
        """Names of the vehicles and dynamic objects."""

    @property
    @abstractmethod
    def scene(self) -> Scene:
        """Static scene; another one with the same lights and background may take its place."""

    @scene.setter
    @abstractmethod
    def scene(self, scene: Scene) -> None: ...

    def add(
        self, name: str, part: Scene | str | Path, world_from_part: ArrayLike | None = None
    ) -> None:
        """Add all of a scene as one instance, see `Scene.added`; it may be a path or built-in name.

        Raises:
            SceneError: a scene that cannot be read, a name that is taken, or a matrix that is not a
                pose.
        """
        part = part if isinstance(part, Scene) else load_scene(part, animation="none")
        self.scene = self.scene.added(name, part, world_from_part)

    def remove(self, name: str) -> None:
        """Remove an instance.

        Raises:
            SceneError: there is none of this name.
        """
        self.scene = self.scene.removed(name)

    def move(self, name: str, world_from_instance: ArrayLike) -> None:
        """Put an instance at another pose (4, 4), see `Scene.moved`.

        It is elsewhere at once: for flow and motion blur make it a dynamic object.

        Raises:
            SceneError: there is none of this name, or it moves with the state of each frame; or a
                matrix that is not a pose.
        """
        if name in self._moving and name not in self.scene.instance_names:
            raise SceneError(
                f"instance {name!r}: moves with the state of each frame: expected its pose in "
                f"omnisim.WorldState({{{name!r}: pose, …}})"
            )
        self.scene = self.scene.moved(name, world_from_instance)

    def recolor(
        self, name: str, base_color: ArrayLike = (1.0, 1.0, 1.0), texture: ArrayLike | None = None
    ) -> None:
        """Give an instance one color or texture instead of what it had, see `Scene.recolored`.

        Raises:
            SceneError: there is none of this name, or a color or texture that is none.
        """
        self.scene = self.scene.recolored(name, base_color, texture)
