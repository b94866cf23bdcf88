"""Stages open sensors: a scene on a back end, and the renderers of the sensors in it."""

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

    # What is no sensor with a renderer of its own is a camera.
    Opened = TypeVar("Opened", bound=SensorRenderer[Any, Any], default=Renderer)


class Stage(SharedScene):
    """Holds a scene and its dynamic objects on a back end, on the GPU or for rays; opens sensors.

    Closing it frees its renderers' memory, too; a renderer whose stage is closed says so. A stage
    that is dropped and not closed warns, as files do, and is released. Sensors take turns: a stage
    and its renderers belong to one thread.

    Args:
        scene: static scene in the world frame, with its lights and background; or the path or
            built-in name of one.
        body: of the only vehicle, named `BODY`, in its base frame (x forward, y left, z up, origin
            on the ground); its lights and background are ignored.
        vehicles: bodies of several vehicles by name, instead.
        dynamic_objects: by name, each in a frame of its own; their lights and backgrounds are
            ignored, too.
        device: EGL's number of the GPU, as `omnisim info` lists them; None takes the first.
        backend: "cube", virtual cameras by OpenGL; or "rays", cast by Embree, without any GPU.

    Raises:
        GraphicsError: no OpenGL, too old an OpenGL, or a scene past its limits; or an option that
            the back end does not have.
        OmnisimError: the back end's packages are not installed.
        SceneError: a dynamic object of another's or a vehicle's name, or a body beside vehicles.
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
            sensor: a camera, that is an `OmniCamera` or what `OmniCamera.of` makes one of, by
                default the paper's; or a `LaserScanner`, `SpinningLidar`, `DepthCamera`,
                `RangeSensor`, or a sensor of your own; or one of a vehicle's `sensors`, with its
                own mount and what it hides.
            base_from_sensor: (4, 4) its mount on the vehicle, x forward; by default at the base. A
                camera's own `base_from_rig` comes after it.
            hidden: names of the body's instances that it does not see, such as its own housing.
            vehicle: name of the vehicle that carries it, of several; by default the first.
            seed: of the noise of cameras and depth cameras; other sensors have their own.
            unlit: show plain base colors, without lights; for cameras.

        Raises:
            GraphicsError: the stage is closed, or sizes past the GPU's limits.
            SceneError: a hidden name that the body does not have.
            OmnisimError: a sensor or calibration file that cannot be read, or an invalid pose.
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
    device: int | None = None,
    backend: BackendName = "cube",
    hidden: Collection[str] = (),
    seed: int | str = 0,
    unlit: bool = False,
) -> Opened:
    """Open the only sensor of a scene, on a stage that is closed with the renderer.

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
