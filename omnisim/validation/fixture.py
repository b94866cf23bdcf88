"""Scene, viewpoint and settings of the checks."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from omnisim.cameras import HyperbolicCamera
from omnisim.core.arrays import Floats, Floats32
from omnisim.core.errors import OpticsError
from omnisim.ground_truth.frame import Frame
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.shared_scene import BackendName
from omnisim.rendering.stage import Stage, open_sensor
from omnisim.scene import Scene, load_scene

TEXTURED_SCENE = "courtyard"
BACKENDS: tuple[BackendName, ...] = ("rays", "cube")


@dataclass(frozen=True)
class Fixture:
    """Settings and test scene of a validation."""

    device: int | None = None  # EGL index of the GPU; None: the first
    is_quick: bool = False  # use smaller images and fewer samples

    @cached_property
    def scene(self) -> Scene:
        """Textured scene for comparing images, in even light."""
        return load_scene(TEXTURED_SCENE, sky="none")

    @property
    def viewpoint_m(self) -> tuple[float, float, float]:
        """Viewpoint of the checks in the world frame: the scene's start position."""
        return self.scene.start.position_m

    def render(
        self,
        scene: Scene | Stage,
        camera: OmniCamera,
        world_from_base: Floats,
        *,
        unlit: bool = True,
        backend: BackendName = "cube",
    ) -> Frame:
        """Render one frame with linear values in `Frame.linear`; unlit: base colors, no light."""
        if isinstance(scene, Stage):
            opened = scene.open(camera, unlit=unlit)
        else:
            opened = open_sensor(scene, camera, unlit=unlit, backend=backend, device=self.device)
        with opened as renderer:
            return renderer.render(world_from_base, linear=True)


def mirror_camera(sensor: OmniCamera) -> HyperbolicCamera:
    """Camera model of a sensor with a hyperbolic mirror.

    Raises:
        OpticsError: the sensor has another model.
    """
    if not isinstance(sensor.model, HyperbolicCamera):
        raise OpticsError(f"expected a hyperbolic mirror, got model {sensor.model.model_name!r}")
    return sensor.model


def linear_image(frame: Frame) -> Floats32:
    """Linear RGB (height, width, 3) of a frame rendered with linear values."""
    assert frame.linear is not None
    return frame.linear


def max_abs(values: Floats) -> float:
    """Maximum absolute value; NaN without values, which fails every bound."""
    return float(np.abs(values).max()) if values.size else math.nan


def mean_abs(values: Floats) -> float:
    """Mean absolute value; NaN without values, which fails every bound."""
    return float(np.abs(values).mean()) if values.size else math.nan
