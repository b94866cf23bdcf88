"""omnisim itself, as one of the renderers in the race."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.peer import ImagePeer
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl.opengl_camera import CubeCamera
from omnisim.rendering.stage import Stage


class Omnisim(ImagePeer):
    """Renderer of omnisim on a stage."""

    def __init__(self, stage: Stage, sensor: OmniCamera, name: str, unlit: bool = False):
        self.name = name
        self._renderer = stage.open(sensor, unlit=unlit)
        self._rig_from_base = np.linalg.inv(sensor.base_from_rig)
        with self._renderer._current() as passes:
            assert isinstance(passes, CubeCamera)
            self.texels = passes.cube.plan.texels

    def render(self, world_from_rig: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Image (height, width, 4), RGBA."""
        return self._renderer.render(world_from_rig @ self._rig_from_base).rgba

    def close(self) -> None:
        """Close the renderer; the stage stays open."""
        self._renderer.close()
