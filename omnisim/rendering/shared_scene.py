"""Scene and its dynamic objects on a back end, editable, and shared by any number of sensors."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Literal, Self, cast, get_args

from numpy.typing import ArrayLike

from omnisim.core.errors import GraphicsError, SceneError, did_you_mean
from omnisim.core.extras import require_opengl
from omnisim.core.short_repr import counted, short_repr
from omnisim.core.world import ObjectPoses, WorldState
from omnisim.rendering.contract import SceneBackend, SceneRays
from omnisim.scene import Scene, load_scene
from omnisim.scene.labels import BODY

if TYPE_CHECKING:
    from omnisim.rendering.opengl.cube_backend import CubeBackend
    from omnisim.rendering.opengl.gl.context import Context


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


# Scene and its dynamic objects on a back end, shared by any number of sensors.


class Closeable(ABC):
    """Base of context managers that free GPU memory when they are closed."""

    @abstractmethod
    def close(self) -> None:
        """Free the GPU memory; a second call does nothing."""

    def __enter__(self) -> Self:
        """Enter a `with` block."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close at the end of the block."""
        self.close()


BackendName = Literal["cube", "rays"]


def open_backend(
    name: str, scene: Scene, objects: Mapping[str, Scene], device: int | str | None
) -> SceneBackend:
    """Open a back end by name.

    Args:
        name: a `BackendName`.
        scene: static scene.
        objects: bodies and dynamic objects by name.
        device: number of the GPU, or cuda:N; None takes the first.

    Raises:
        GraphicsError: an unknown back end, one that does not open, or one without devices.
        OmnisimError: packages of the back end are not installed.
    """
    if name == "cube":
        require_opengl("back end 'cube'")
        from omnisim.rendering.opengl.cube_backend import CubeBackend

        return CubeBackend(scene, objects, device, _open_rays)
    if name != "rays":
        raise GraphicsError(f"backend {name!r}: {did_you_mean(name, get_args(BackendName))}")
    if device is not None:
        raise GraphicsError(f"device {device}: back end 'rays' needs no GPU: expected none")
    from omnisim.rendering.rays.ray_backend import RayBackend  # seldom needed

    return RayBackend(scene, objects)


def _open_rays(scene: Scene, objects: Sequence[Scene]) -> SceneRays:
    """Open rays for what a back end does not draw; their modules are imported by then."""
    from omnisim.rendering.rays.scene_rays import CastScene

    return CastScene(scene, objects)


class SharedScene(Closeable, EditableScene):
    """Scene and dynamic objects on a back end, shared by a stage's renderers.

    Args:
        scene, body, vehicles, dynamic_objects, device, backend: see `omnisim.Stage`.

    Attributes:
        edits: number of edits so far.
        vehicles: bodies by name.
        objects: bodies and dynamic objects by name, in the order of `poses_in`.
        backend_name: name of the back end.
        backend: the back end's scene.
    """

    fixed = BODY  # carrier of a sensor on no vehicle; no dynamic object has this name

    def __init__(
        self,
        scene: Scene | str | Path,
        body: Scene | None = None,
        *,
        vehicles: Mapping[str, Scene] | None = None,
        dynamic_objects: Mapping[str, Scene] | None = None,
        device: int | str | None = None,
        backend: BackendName = "cube",
    ):
        self._scene = scene if isinstance(scene, Scene) else load_scene(scene)
        if body is not None and vehicles is not None:
            raise SceneError("body: expected either the body of one vehicle or vehicles, got both")
        self.vehicles = dict(vehicles or {}) if body is None else {BODY: body}
        self.objects = dict(self.vehicles)
        moving = [(moving.name, moving.shape) for moving in self.scene.objects]
        for name, shape in (*moving, *(dynamic_objects or {}).items()):
            if name in self.objects or name == self.fixed:
                raise SceneError(f"dynamic object {name!r}: expected each name once")
            self.objects[name] = shape
        self.edits = 0
        self.backend_name = backend
        self.backend = open_backend(backend, self._scene, self.objects, device)

    def __repr__(self) -> str:
        vehicles = counted(len(self.vehicles), "vehicle")
        objects = counted(len(self.objects) - len(self.vehicles), "dynamic object")
        closed = "" if self.backend.is_open else "closed"
        return short_repr(self, repr(self.scene.name), vehicles, objects, closed)

    @property
    def _moving(self) -> Collection[str]:
        return self.objects

    @property
    def scene(self) -> Scene:
        """Static scene; can be replaced by one with the same lights and background."""
        return self._scene

    @scene.setter
    def scene(self, scene: Scene) -> None:
        if not isinstance(scene, Scene):
            raise SceneError(f"scene: expected a Scene, got {type(scene).__name__}")
        before = self._scene
        for key in ("lighting", "background", "objects"):
            if getattr(scene, key) != getattr(before, key):
                raise SceneError(
                    f"scene: expected the {key} that the stage was opened with, got different: "
                    "open a new stage"
                )
        with self.current():
            self.backend.update(scene)
        self._scene = scene
        self.edits += 1

    def poses_in(self, state: WorldState) -> ObjectPoses:
        """Poses (4, 4) of the objects in a world state, for the passes.

        The scene's own objects follow their motion at the state's time, unless the state has them.

        Raises:
            SceneError: an object without a pose.
        """
        poses = dict(state.world_from_object)
        for moving in self.scene.objects:
            if moving.name not in poses:
                poses[moving.name] = moving.motion.pose_at(state.time_s)
        missing = [name for name in self.objects if name not in poses]
        if missing:
            actual = ", ".join(poses) or "none"
            raise SceneError(f"state: expected a pose of {', '.join(missing)}, got {actual}")
        return ObjectPoses((poses[name] for name in self.objects), state.time_s)

    def carrier(self, name: str | None) -> str:
        """Object that carries a sensor, by its name; without one, the first vehicle."""
        return name or next(iter(self.vehicles), self.fixed)

    @property
    def graphics(self) -> CubeBackend:
        """The OpenGL back end.

        Raises:
            GraphicsError: the stage has another back end.
        """
        if self.backend_name == "cube":
            return cast("CubeBackend", self.backend)
        raise GraphicsError("this stage's back end draws nothing by OpenGL: expected 'cube'")

    @property
    def context(self) -> Context:
        """The OpenGL context."""
        return self.graphics.context

    @contextmanager
    def current(self) -> Iterator[None]:
        """Make its back end current for a `with` block.

        Raises:
            GraphicsError: the stage is closed, or belongs to the process before a fork.
        """
        with self.backend.current():
            yield

    def collect(self) -> None:
        """Free the GPU memory of closed renderers, unless the stage is closed."""
        with suppress(GraphicsError), self.current():
            pass

    def close(self) -> None:
        """Free the back end's memory: the OpenGL context with everything in it."""
        self.backend.close()
