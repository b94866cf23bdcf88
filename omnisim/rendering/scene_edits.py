"""In-place edits of a scene, visible in the next frame; other parts are not uploaded again."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection
from pathlib import Path

from numpy.typing import ArrayLike

from omnisim.core.errors import SceneError
from omnisim.scene import Scene, load_scene


class EditableScene(ABC):
    """Base of stages and renderers, with an editable scene.

    An edit costs what it changes, plus a check of each instance; unchanged parts are not uploaded
    again. Added, moved or recolored instances are drawn one by one, with light computed per texel.
    A new renderer of the same scene bakes their light and rounds their vertices differently, so
    that its images may differ by one 8-bit step, and by texels at silhouettes.
    """

    @property
    @abstractmethod
    def _moving(self) -> Collection[str]:
        """Names of the vehicles and dynamic objects."""

    @property
    @abstractmethod
    def scene(self) -> Scene:
        """Static scene; can be replaced by one with the same lights and background."""

    @scene.setter
    @abstractmethod
    def scene(self, scene: Scene) -> None: ...

    def add(
        self, name: str, part: Scene | str | Path, world_from_part: ArrayLike | None = None
    ) -> None:
        """Add all of a scene as one instance, see `Scene.added`; it may be a path or built-in name.

        Raises:
            SceneError: an unreadable scene, a name that is in use, or an invalid pose.
        """
        part = part if isinstance(part, Scene) else load_scene(part, animation="none")
        self.scene = self.scene.added(name, part, world_from_part)

    def remove(self, name: str) -> None:
        """Remove an instance.

        Raises:
            SceneError: no instance of this name.
        """
        self.scene = self.scene.removed(name)

    def move(self, name: str, world_from_instance: ArrayLike) -> None:
        """Move an instance to another pose (4, 4), see `Scene.moved`.

        The move is instantaneous: for flow and motion blur, make it a dynamic object.

        Raises:
            SceneError: no instance of this name, one that moves with each frame's state, or an
                invalid pose.
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
        """Replace an instance's materials by one color or texture, see `Scene.recolored`.

        Raises:
            SceneError: no instance of this name, or an invalid color or texture.
        """
        self.scene = self.scene.recolored(name, base_color, texture)
