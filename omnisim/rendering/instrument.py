"""Instruments: sensors that are open on a stage."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from typing import Any, Generic, TypeVar

from numpy.typing import ArrayLike

from omnisim.core.arrays import Floats
from omnisim.core.errors import GraphicsError, SceneError
from omnisim.core.pending import Pending
from omnisim.core.short_repr import short_repr
from omnisim.core.version import __version__
from omnisim.core.world import ObjectPart, WorldState
from omnisim.rendering.contract import Passes
from omnisim.rendering.sensor import Moment, Mount, Reading, SensorSettings
from omnisim.rendering.shared_scene import Closeable, EditableScene, SharedScene
from omnisim.scene import Scene

SensorT_co = TypeVar("SensorT_co", bound=SensorSettings, covariant=True)
PassesT_co = TypeVar("PassesT_co", bound=Passes, covariant=True)
ReadingT_co = TypeVar("ReadingT_co", bound=Reading, covariant=True)


class Instrument(Closeable, EditableScene, Generic[SensorT_co, PassesT_co, ReadingT_co]):
    """Sensor that is open on a stage, with its passes there, until it is closed.

    `omnisim.Stage.open` and `omnisim.open_sensor` create them. Use it as a context manager, or call
    `close`, because it holds GPU memory.

    Args:
        stage: stage of the instrument, to be closed after it.
        sensor: settings of the sensor.
        mount: its mount on a vehicle of the stage.

    Attributes:
        sensor: settings of the sensor.
        mount: its mount.
        hidden: names of its vehicle's instances that this sensor does not see.
        vehicle: name of its vehicle, which may have no body.
        owns_stage: closing the instrument closes the stage.

    Raises:
        GraphicsError: the stage is closed, or sizes beyond its limits.
        SceneError: a hidden name that is not in the body.
    """

    def __init__(self, stage: SharedScene, sensor: SensorT_co, mount: Mount[object]):
        self._stage, self.sensor, self.mount, self.owns_stage = stage, sensor, mount, False
        self.hidden = frozenset(mount.hides)
        self.vehicle = stage.carrier(mount.vehicle)
        parts = self._hidden_parts()
        with stage.current():
            self._passes: PassesT_co | None = self._open_passes(parts)
        self._edits = stage.edits

    def __repr__(self) -> str:
        closed = "closed" if self._passes is None else ""
        return short_repr(self, repr(self.scene.name), self.sensor.summary(), closed)

    @abstractmethod
    def _open_passes(self, hidden: frozenset[ObjectPart]) -> PassesT_co:
        """Open the passes, once, with the stage's context current."""

    @abstractmethod
    def begin(self, moment: Moment) -> Pending[ReadingT_co]:
        """Begin to measure, see `measure`; images are drawn until the result is requested."""

    def measure(self, moment: Moment | WorldState | ArrayLike, number: int = 0) -> ReadingT_co:
        """Measure the world at a moment.

        Args:
            moment: moment of the moving world; or a state of it at rest, or the vehicle's (4, 4)
                pose if nothing else moves.
            number: index of the measurement, which seeds the noise, unless the moment has it.

        Raises:
            OmnisimError: an invalid pose, an object without a pose, an invalid index, damaged files
                of the previous measurement, or the instrument or its stage is closed.
        """
        if not isinstance(moment, Moment):
            moment = Moment.at_rest(moment, number)
        return self.begin(moment).result()

    @property
    def _moving(self) -> Collection[str]:
        return self._stage.objects

    @property
    def scene(self) -> Scene:
        """Static scene; can be replaced by one with the same lights and background."""
        return self._stage.scene

    @scene.setter
    def scene(self, scene: Scene) -> None:
        self._stage.scene = scene

    @property
    def body(self) -> Scene | None:
        """Body of its vehicle; None: invisible."""
        return self._stage.objects.get(self.vehicle)

    def _hidden_parts(self) -> frozenset[ObjectPart]:
        """Hidden instances of the carrier's body, or of any other object that moves."""
        objects = list(self._stage.objects.items())
        of_body = () if self.body is None else self.body.instance_names
        parts: set[ObjectPart] = set()
        for name in sorted(self.hidden):
            owners = [
                index
                for index, (owner, shape) in enumerate(objects)
                if (owner == self.vehicle or name not in of_body) and name in shape.instance_names
            ]
            if not owners:
                known = sorted(set(of_body)) or [
                    part for _, shape in objects for part in shape.instance_names
                ]
                available = f"it has {', '.join(known)}" if known else "there is no body"
                raise SceneError(f"hidden: {name!r}: no part of the body: {available}")
            parts |= {(index, name) for index in owners}
        return frozenset(parts)

    def _state(
        self,
        given: WorldState | ArrayLike,
        before: WorldState | None = None,
        time_s: float | None = None,
    ) -> WorldState:
        """World state, or the state in which the vehicle has the pose (4, 4).

        Args:
            given: state or pose.
            before: state with all other poses, used if only the vehicle's pose is given.
            time_s: time of the state if only a pose is given; None: as before.

        Raises:
            OmnisimError: an invalid pose.
            SceneError: a state without a pose of the vehicle.
        """
        if not isinstance(given, WorldState):
            moved = (before or WorldState({})).moved({self.vehicle: given})
            return moved if time_s is None else WorldState(moved.world_from_object, time_s)
        if self.vehicle not in given.world_from_object:
            actual = ", ".join(given.world_from_object) or "none"
            raise SceneError(f"state: expected a pose of {self.vehicle}, got {actual}")
        return given

    def _world_from_sensor(self, state: WorldState) -> Floats:
        return state.world_from_object[self.vehicle] @ self.mount.base_from_sensor

    @contextmanager
    def _current(self) -> Iterator[PassesT_co]:
        """Make the stage's context current for a `with` block that uses the passes."""
        if self._passes is None:
            raise GraphicsError("this renderer is closed: open a new one")
        with self._stage.current():
            if self._edits != self._stage.edits:
                self._passes.refresh()
                self._edits = self._stage.edits
            yield self._passes

    def close(self) -> None:
        """Free the passes, and close the stage if it is owned; a second call does nothing."""
        if self._passes is None:
            return
        self._passes = None
        if self.owns_stage:
            self._stage.close()
        else:
            self._stage.collect()

    def _metadata(self, **measurement: Any) -> dict[str, Any]:
        """Version, scene and body, then the entries of a measurement."""
        metadata: dict[str, Any] = {"omnisim": __version__, "scene": self.scene.name}
        if self.body is not None:
            metadata |= {"body": self.body.name, "hidden": sorted(self.hidden)}
        return metadata | measurement
