"""Stages: a scene and its dynamic objects on the GPU, for any number of sensors."""

from __future__ import annotations

import threading
import weakref
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Generic, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.errors import GraphicsError, SceneError
from omnisim.gpu.context import (
    check_process,
    open_context,
    release_context,
    release_unclosed_context,
    release_unclosed_contexts,
)
from omnisim.gpu.scene.scene_buffers import SceneBuffers
from omnisim.gpu.scene.surface_program import SurfacePrograms
from omnisim.poses import check_pose
from omnisim.scene import Scene, load_scene
from omnisim.scene.labels import BODY
from omnisim.short_repr import counted, short_repr


class Closing(ABC):
    """Base of context managers that free GPU memory when they are closed."""

    @abstractmethod
    def close(self) -> None:
        """Free the GPU memory; a second time does nothing."""

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


class Stage(Closing):
    """Holds the OpenGL context, one copy of the scene and its body, and the programs that draw.

    Make the sensors' renderers from it, and close it after them; a renderer whose stage is closed
    says so. A stage that is dropped and not closed warns, as files do, and is released. Sensors
    take turns: a stage and its renderers belong to one thread.

    Args:
        scene: static scene in the world frame, with its lights and background; or the path or
            built-in name of one.
        body: of the vehicle, in its base frame (x forward, y left, z up, origin on the ground);
            its lights and background are ignored.
        dynamic_objects: by name, each in a frame of its own; their lights and backgrounds are
            ignored, too.
        device: EGL's number of the GPU, as `omnisim info` lists them; None takes the first.

    Attributes:
        scene, body, dynamic_objects: as given.
        context, buffers, surface_programs: for the passes.

    Raises:
        GraphicsError: no OpenGL, too old an OpenGL, or a scene past its limits.
        SceneError: a dynamic object of the body's name.
    """

    def __init__(
        self,
        scene: Scene | str | Path,
        body: Scene | None = None,
        *,
        dynamic_objects: Mapping[str, Scene] | None = None,
        device: int | None = None,
    ):
        self.scene = scene if isinstance(scene, Scene) else load_scene(scene)
        self.body = body
        self.dynamic_objects = dict(dynamic_objects or {})
        if BODY in self.dynamic_objects:
            raise SceneError(f"dynamic_objects: {BODY!r} is reserved for the vehicle")
        self.context = open_context(device)
        self._finalizer = weakref.finalize(
            self, release_unclosed_context, self.context, threading.current_thread()
        )
        self._finalizer.atexit = False  # the end of the process frees it
        try:
            with self.context:
                self.buffers = SceneBuffers(self.context, self.scene, tuple(self.objects.values()))
                self.surface_programs = SurfacePrograms(self.buffers, self.scene.lighting)
        except BaseException:
            self.close()
            raise

    def __repr__(self) -> str:
        objects = counted(len(self.dynamic_objects), "dynamic object")
        body = "" if self.body is None else f"body {self.body.name!r}"
        return short_repr(
            self, repr(self.scene.name), body, objects, "" if self._finalizer.alive else "closed"
        )

    @property
    def objects(self) -> dict[str, Scene]:
        """Body and dynamic objects by name, in the order of `object_poses_at`."""
        return ({} if self.body is None else {BODY: self.body}) | self.dynamic_objects

    def object_poses_at(
        self,
        world_from_base: NDArray[np.float64] | None,
        object_poses: Mapping[str, ArrayLike] | None = None,
    ) -> tuple[NDArray[np.float64], ...]:
        """Poses (4, 4) for the passes: the body's, then the dynamic objects'.

        Raises:
            SceneError: a dynamic object without a pose, or a pose without an object.
            OmnisimError: a matrix that is not a pose.
        """
        given = dict(object_poses or {})
        if given.keys() != self.dynamic_objects.keys():
            expected, got = (
                ", ".join(sorted(names)) or "none" for names in (self.dynamic_objects, given)
            )
            raise SceneError(f"object_poses: expected poses of {expected}, got {got}")
        others = tuple(check_pose(given[name]) for name in self.dynamic_objects)
        if self.body is None or world_from_base is None:
            return others
        return (world_from_base, *others)

    @contextmanager
    def current(self) -> Iterator[None]:
        """Make its context current for a `with` block, as another stage's may be.

        Raises:
            GraphicsError: the stage is closed, or another process's, from before a fork.
        """
        check_process()
        if not self._finalizer.alive:
            raise GraphicsError("this stage is closed: open a new one")
        release_unclosed_contexts()
        with self.context:
            self.context.gc()  # renderers that were dropped and not closed
            yield

    def collect(self) -> None:
        """Free the GPU memory of closed renderers, where the stage itself is not closed."""
        with suppress(GraphicsError), self.current():
            pass

    def close(self) -> None:
        """Release the OpenGL context with everything in it."""
        if self._finalizer.detach() is not None:
            release_context(self.context)


Passes = TypeVar("Passes")


class SensorRenderer(Closing, Generic[Passes]):
    """Passes of one sensor on a stage, its own or a shared one, until it is closed.

    Args:
        scene: becomes a stage of its own, also by its path or built-in name; or a stage that
            somebody else closes.
        body: for a stage of its own.
        hidden: names of the body's instances that this sensor does not see.
        device: for a stage of its own.
        make_passes: called once, with the stage's context current.

    Raises:
        GraphicsError: from opening a stage, or a stage and what only it can choose.
    """

    def __init__(
        self,
        scene: Scene | Stage | str | Path,
        body: Scene | None,
        hidden: Collection[str],
        device: int | None,
        make_passes: Callable[[Stage], Passes],
    ):
        self.hidden = frozenset(hidden)
        self._owns_stage = not isinstance(scene, Stage)
        if not isinstance(scene, Stage):
            self._stage = Stage(scene, body, device=device)
        elif body is None and device is None:
            self._stage = scene
        else:
            raise GraphicsError("a stage has its body and its device: give them to the stage")
        try:
            with self._stage.current():
                self._passes: Passes | None = make_passes(self._stage)
        except BaseException:
            if self._owns_stage:
                self._stage.close()
            raise

    def __repr__(self) -> str:
        closed = "closed" if self._passes is None else ""
        return short_repr(self, repr(self.scene.name), self._sensor_summary(), closed)

    @abstractmethod
    def _sensor_summary(self) -> str:
        """Sensor in a few words."""

    @property
    def scene(self) -> Scene:
        """Static scene."""
        return self._stage.scene

    @property
    def body(self) -> Scene | None:
        """Body of the vehicle, which moves with it."""
        return self._stage.body

    @contextmanager
    def _current(self) -> Iterator[Passes]:
        """Make the stage's context current for a `with` block that uses the passes."""
        if self._passes is None:
            raise GraphicsError("this renderer is closed: open a new one")
        with self._stage.current():
            yield self._passes

    def close(self) -> None:
        """Free the passes, and close the stage if it is its own; a second time does nothing."""
        if self._passes is None:
            return
        self._passes = None
        if self._owns_stage:
            self._stage.close()
        else:
            self._stage.collect()

    def _body_metadata(self) -> dict[str, Any]:
        if self.body is None:
            return {}
        return {"body": self.body.name, "hidden": sorted(self.hidden)}
