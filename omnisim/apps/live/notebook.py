"""Live page in a cell of a notebook."""

from __future__ import annotations

import html
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from omnisim.apps.live.camera_document import CameraDocument
from omnisim.apps.live.live_source import LiveSettings
from omnisim.apps.live.scene_in_light import SceneInLight
from omnisim.cameras import CentralCamera
from omnisim.core.short_repr import short_repr
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.robots.vehicle import Vehicle
from omnisim.scene import Scene, load_scene, read_scene

if TYPE_CHECKING:
    from omnisim.apps.live.live import BackgroundPage

SIZE_PX, HEIGHT_PX = 400, 760


class LiveView:
    """Page that a notebook shows as a cell, until it is closed.

    Attributes:
        url: address for a browser.
    """

    def __init__(self, page: BackgroundPage, height_px: int):
        self._page, self._height_px = page, height_px
        self.url = page.url

    def __repr__(self) -> str:
        return short_repr(self, self.url)

    def _repr_html_(self) -> str:
        """Frame with the page, as notebooks show it."""
        url = html.escape(self.url)
        style = f"width: 100%; height: {self._height_px}px; border: 0"
        return f'<iframe src="{url}" style="{style}" allow="clipboard-write; gamepad"></iframe>'

    def close(self) -> None:
        """Stop serving, and free the GPU memory; a second time does nothing."""
        self._page.close()

    def __enter__(self) -> LiveView:
        """Enter a `with` block."""
        return self

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
        scene: or its path or built-in name.
        camera: sensor, camera model, or path of a sensor or calibration file; by default the
            paper's; a robot brings its own.
        robot: that drives and carries the camera, or its file or built-in name; None: free flight.
        size_px: of the image's shorter side.
        height_px: of the cell.
        port: to listen on, on this machine alone; 0 takes a free one.
        device: number of the GPU; None takes the first.

    Raises:
        OmnisimError: a scene, camera or robot that cannot be read, no OpenGL, or a port that is
            taken.
    """
    from omnisim.apps.live.live import BackgroundPage, LivePage

    found = scene if isinstance(scene, Scene) else load_scene(scene)
    vehicle = robot if isinstance(robot, Vehicle) or robot is None else Vehicle.load(robot)
    if vehicle is not None:
        document = CameraDocument.of_camera(vehicle.camera().sensor)
    elif isinstance(camera, str | Path) and Path(camera).suffix.lower() == ".toml":
        document = CameraDocument.of_sensor_file(Path(camera))
    elif camera is None:
        document = CameraDocument()
    else:
        document = CameraDocument.of_camera(OmniCamera.of(camera))
    document = document.with_value("size_px", size_px)
    light = None if isinstance(scene, Scene) else SceneInLight(str(scene), _read_in_light)
    settings = LiveSettings(
        found, document, vehicle, scene_words=(found.name,), device=device, light=light
    )
    return LiveView(BackgroundPage(LivePage(settings, port=port)), height_px)


def _read_in_light(path: Path, tables: Mapping[str, Any]) -> Scene:
    return read_scene(path)
