"""Stages: a scene on a back end, which opens sensors as instruments."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection
from pathlib import Path
from typing import Protocol, TypeAlias, TypeVar, overload, runtime_checkable

from numpy.typing import ArrayLike

from omnisim.core.poses import check_pose
from omnisim.rendering.camera.omnicamera import CameraLike, OmniCamera
from omnisim.rendering.contract import Passes
from omnisim.rendering.instrument import Instrument
from omnisim.rendering.renderer import Renderer
from omnisim.rendering.sensor import Mount, Reading, SensorSettings
from omnisim.rendering.shared_scene import BackendName, SharedScene
from omnisim.scene import Scene

AnyInstrument: TypeAlias = Instrument[SensorSettings, Passes, Reading]
InstrumentT = TypeVar("InstrumentT", bound=AnyInstrument)
InstrumentT_co = TypeVar("InstrumentT_co", bound=AnyInstrument, covariant=True)


@runtime_checkable
class Sensor(Protocol[InstrumentT_co]):
    """Sensor that sees; your own have these two methods, and `SensorSettings` as their base."""

    def summary(self) -> str:
        """Short description of the sensor."""

    def open(self, stage: Stage, mount: Mount[object]) -> InstrumentT_co:
        """Open the sensor on a stage."""


Opens: TypeAlias = Sensor[InstrumentT] | Mount[Sensor[InstrumentT]]


class Stage(SharedScene):
    """Holds a scene and its dynamic objects on a back end, by OpenGL or by rays; opens sensors.

    Closing a stage frees its renderers' memory, too; using such a renderer raises an error. A stage
    that is dropped without `close` warns, as files do, and is released. A stage and its renderers
    belong to one thread.

    Args:
        scene: static scene in the world frame, with its lights and background; or its path or
            built-in name.
        body: body of the only vehicle, named `BODY`, in its base frame (x forward, y left, z up,
            origin on the ground); its lights and background are ignored.
        vehicles: bodies of several vehicles by name, instead of `body`.
        dynamic_objects: scenes by name, each in its own frame; their lights and backgrounds are
            ignored.
        device: number of the GPU, as `omnisim info` lists them, or cuda:N; None: the first.
        backend: "cube": virtual cameras by OpenGL; "rays": Embree on the CPU, without OpenGL.

    Raises:
        GraphicsError: no OpenGL, OpenGL too old, a scene beyond its limits, or an option that the
            back end lacks.
        OmnisimError: packages of the back end are not installed.
        SceneError: a name that two objects share, or a body beside vehicles.
    """

    @overload
    def open(
        self,
        sensor: CameraLike = None,
        base_from_sensor: ArrayLike | None = None,
        *,
        hidden: Collection[str] = (),
        vehicle: str | None = None,
        seed: int | str = 0,
        unlit: bool = False,
    ) -> Renderer: ...

    @overload
    def open(
        self,
        sensor: Opens[InstrumentT],
        base_from_sensor: ArrayLike | None = None,
        *,
        hidden: Collection[str] = (),
        vehicle: str | None = None,
        seed: int | str = 0,
        unlit: bool = False,
    ) -> InstrumentT: ...

    def open(
        self,
        sensor: Opens[InstrumentT] | CameraLike = None,
        base_from_sensor: ArrayLike | None = None,
        *,
        hidden: Collection[str] = (),
        vehicle: str | None = None,
        seed: int | str = 0,
        unlit: bool = False,
    ) -> InstrumentT | Renderer:
        """Open a sensor as its instrument, which loads and compiles everything once.

        Args:
            sensor: a camera (`OmniCamera`, or an argument of `OmniCamera.of`; None: the paper's); a
                `LaserScanner`, `SpinningLidar`, `DepthCamera` or `RangeSensor`; a sensor of your
                own; or one of a vehicle's `sensors`, with its own mount and hidden parts.
            base_from_sensor: (4, 4) mount on the vehicle, x forward; None: at the base. A camera's
                own `base_from_rig` follows it.
            hidden: names of body instances that it does not see, such as its own housing.
            vehicle: name of the vehicle that carries it; None: the first.
            seed: noise seed of cameras and depth cameras; other sensors have their own.
            unlit: show plain base colors, without lights; for cameras.

        Raises:
            GraphicsError: the stage is closed, or sizes beyond the GPU's limits.
            SceneError: a hidden name that is not in the body.
            OmnisimError: an unreadable sensor or calibration file, or an invalid pose.
        """
        own = sensor if isinstance(sensor, Mount) else Mount(sensor)
        given = own.base_from_sensor if base_from_sensor is None else base_from_sensor
        mount = dataclasses.replace(
            own,
            base_from_sensor=check_pose(given),
            hides=(*own.hides, *hidden),
            vehicle=vehicle,
            seed=seed,
            unlit=unlit,
        )
        settings = own.sensor
        if isinstance(settings, Sensor):
            return settings.open(self, mount)
        return self.open_camera(OmniCamera.of(settings), mount)

    def open_camera(self, camera: OmniCamera, mount: Mount[object]) -> Renderer:
        """Open a camera at a mount; `open` also takes descriptions of cameras."""
        return Renderer(self, camera, mount)


@overload
def open_sensor(
    scene: Scene | str | Path,
    sensor: CameraLike = None,
    base_from_sensor: ArrayLike | None = None,
    *,
    body: Scene | None = None,
    device: int | str | None = None,
    backend: BackendName = "cube",
    hidden: Collection[str] = (),
    seed: int | str = 0,
    unlit: bool = False,
) -> Renderer: ...


@overload
def open_sensor(
    scene: Scene | str | Path,
    sensor: Opens[InstrumentT],
    base_from_sensor: ArrayLike | None = None,
    *,
    body: Scene | None = None,
    device: int | str | None = None,
    backend: BackendName = "cube",
    hidden: Collection[str] = (),
    seed: int | str = 0,
    unlit: bool = False,
) -> InstrumentT: ...


def open_sensor(
    scene: Scene | str | Path,
    sensor: Opens[InstrumentT] | CameraLike = None,
    base_from_sensor: ArrayLike | None = None,
    *,
    body: Scene | None = None,
    device: int | str | None = None,
    backend: BackendName = "cube",
    hidden: Collection[str] = (),
    seed: int | str = 0,
    unlit: bool = False,
) -> InstrumentT | Renderer:
    """Open the only sensor of a scene, on a stage that closes with the instrument.

    Args:
        scene, body, device, backend: as for `Stage`.
        sensor, base_from_sensor, hidden, seed, unlit: as for `Stage.open`.

    Raises:
        OmnisimError: as `Stage` and `Stage.open`.
    """
    stage = Stage(scene, body, device=device, backend=backend)
    try:
        opened = stage.open(sensor, base_from_sensor, hidden=hidden, seed=seed, unlit=unlit)
    except BaseException:
        stage.close()
        raise
    opened.owns_stage = True
    return opened
