"""Live page in a notebook's cell."""

from __future__ import annotations

import html
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING

from omnisim.apps.live.camera_document import CameraDocument, SceneInLight
from omnisim.apps.live.live_source import LiveSettings
from omnisim.cameras import CentralCamera
from omnisim.core.short_repr import short_repr
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.robots.vehicle import Vehicle
from omnisim.scene import Scene, load_scene, read_scene

if TYPE_CHECKING:
    from omnisim.apps.live.live import BackgroundPage

SIZE_PX, HEIGHT_PX = 400, 760


class LiveView(AbstractContextManager["LiveView"]):
    """Page shown in a notebook's cell until it is closed.

    Attributes:
        url: URL for a browser.
    """

    def __init__(self, page: BackgroundPage, height_px: int):
        self._page, self._height_px = page, height_px
        self.url = page.url

    def __repr__(self) -> str:
        return short_repr(self, self.url)

    def _repr_html_(self) -> str:
        """HTML frame with the page, for the display of notebooks."""
        url = html.escape(self.url)
        style = f"width: 100%; height: {self._height_px}px; border: 0"
        return f'<iframe src="{url}" style="{style}" allow="clipboard-write; gamepad"></iframe>'

    def close(self) -> None:
        """Stop serving and free the GPU memory; a second call does nothing."""
        self._page.close()

    def __exit__(self, *reason: object) -> None:
        """Close at the end of the block."""
        self.close()


def live(
    scene: Scene | str | Path = "soccer",
    camera: OmniCamera | CentralCamera | str | Path | None = None,
    *,
    robot: Vehicle | str | Path | None = None,
    size_px: int = SIZE_PX,
    height_px: int = HEIGHT_PX,
    port: int = 0,
    device: int | None = None,
) -> LiveView:
    """Serve the live page of a scene, and show it in a notebook's cell.

    Args:
        scene: scene, its path, or a built-in name.
        camera: sensor, camera model, or path of a sensor or calibration file; None: the robot's, or
            the paper's camera.
        robot: robot that carries the camera, its file, or a built-in name; None: free flight.
        size_px: length of the image's shorter side.
        height_px: height of the cell.
        port: port on this machine's own address; 0: any free port.
        device: index of the GPU; None: the first.

    Raises:
        OmnisimError: the scene, camera or robot is invalid, there is no OpenGL, or the port is
            taken.
    """
    from omnisim.apps.live.live import BackgroundPage, LivePage

    loaded = scene if isinstance(scene, Scene) else load_scene(scene)
    vehicle = robot if isinstance(robot, Vehicle) or robot is None else Vehicle.load(robot)
    if vehicle is not None and camera is None:
        document = CameraDocument.of_camera(vehicle.camera().sensor)
    elif isinstance(camera, str | Path) and Path(camera).suffix.lower() == ".toml":
        document = CameraDocument.of_sensor_file(Path(camera))
    elif camera is None:
        document = CameraDocument()
    else:
        document = CameraDocument.of_camera(OmniCamera.of(camera))
    document = document.with_value("size_px", size_px)
    read = (
        None
        if isinstance(scene, Scene)
        else SceneInLight(str(scene), lambda path, _: read_scene(path))
    )
    settings = LiveSettings(
        loaded, document, vehicle, scene_arguments=(loaded.name,), device=device, light=read
    )
    return LiveView(BackgroundPage(LivePage(settings, port=port)), height_px)
