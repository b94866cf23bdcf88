"""Stages: a scene on a back end, which opens the renderers of sensors."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from numpy.typing import ArrayLike

from omnisim.rendering.camera.omnicamera import CameraLike, OmniCamera
from omnisim.rendering.renderer import Renderer
from omnisim.rendering.sensor_renderer import Mounting, Sensor, SensorRenderer
from omnisim.rendering.shared_scene import BackendName, SharedScene
from omnisim.scene import Scene

if TYPE_CHECKING:
    from typing_extensions import TypeVar

    # Objects without a renderer of their own are cameras.
    Opened = TypeVar("Opened", bound=SensorRenderer[Any, Any], default=Renderer)


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

    def open(
        self,
        sensor: Sensor[Opened] | CameraLike = None,
        base_from_sensor: ArrayLike | None = None,
        *,
        hidden: Collection[str] = (),
        vehicle: str | None = None,
        seed: int | str = 0,
        unlit: bool = False,
    ) -> Opened:
        """Open a sensor's renderer, which loads and compiles everything once.

        Args:
            sensor: a camera (`OmniCamera`, or an argument of `OmniCamera.of`; None: the paper's); a
                `LaserScanner`, `SpinningLidar`, `DepthCamera` or `RangeSensor`; a sensor of your
                own; or one of a vehicle's `sensors`, with its own mount and hidden parts.
            base_from_sensor: (4, 4) mount on the vehicle, x forward; None: at the base. A camera's
                own
                `base_from_rig` follows it.
            hidden: names of body instances that it does not see, such as its own housing.
            vehicle: name of the vehicle that carries it; None: the first.
            seed: noise seed of cameras and depth cameras; other sensors have their own.
            unlit: show plain base colors, without lights; for cameras.

        Raises:
            GraphicsError: the stage is closed, or sizes beyond the GPU's limits.
            SceneError: a hidden name that is not in the body.
            OmnisimError: an unreadable sensor or calibration file, or an invalid pose.
        """
        mounting = Mounting(base_from_sensor, hidden, vehicle, seed, unlit)
        given: Any = sensor
        if isinstance(given, Path) or not hasattr(given, "open"):
            return cast("Opened", Renderer(self, OmniCamera.of(given), mounting))
        return cast("Opened", given.open(self, mounting))


def open_sensor(
    scene: Scene | str | Path,
    sensor: Sensor[Opened] | CameraLike = None,
    base_from_sensor: ArrayLike | None = None,
    *,
    body: Scene | None = None,
    device: int | str | None = None,
    backend: BackendName = "cube",
    hidden: Collection[str] = (),
    seed: int | str = 0,
    unlit: bool = False,
) -> Opened:
    """Open the only sensor of a scene, on a stage that closes with the renderer.

    Args:
        scene, body, device, backend: as for `Stage`.
        sensor, base_from_sensor, hidden, seed, unlit: as for `Stage.open`.

    Raises:
        OmnisimError: as `Stage` and `Stage.open`.
    """
    stage = Stage(scene, body, device=device, backend=backend)
    try:
        renderer = stage.open(sensor, base_from_sensor, hidden=hidden, seed=seed, unlit=unlit)
    except BaseException:
        stage.close()
        raise
    renderer.owns_stage = True
    return renderer
