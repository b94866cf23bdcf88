"""Contract of rendering, without OpenGL: what a back end is asked for, and what it returns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import OpticsError
from omnisim.rendering.camera.degradations.effect import MAX_EV


class Readback(NamedTuple):
    """Rendered image; first row at the top."""

    rgba: NDArray[np.uint8]  # (height, width, 4): sRGB, alpha 255 where the camera sees something
    linear: NDArray[np.float32] | None  # (height, width, 3), where asked for


class ScenePoses(NamedTuple):
    """Poses of the camera and of all that moves, at one time.

    Attributes:
        world_from_rig: (4, 4) of the camera's rig.
        world_from_objects: (4, 4) each, in the order of the stage's objects.
    """

    world_from_rig: NDArray[np.float64]
    world_from_objects: Sequence[NDArray[np.float64]] = ()


class SubFrame(NamedTuple):
    """Part of the time in which an image is exposed.

    Attributes:
        poses: in this part.
        row_weights: (height,) share of each row's exposure; None: all of it.
    """

    poses: ScenePoses
    row_weights: NDArray[np.float32] | None


class Exposed(NamedTuple):
    """Exposure of one image.

    Attributes:
        factors: of red, green and blue light.
        frame_number: noise differs from frame to frame.
    """

    factors: tuple[float, float, float]
    frame_number: int


class SubFrames(NamedTuple):
    """Sub-frames of an image, and how they are exposed.

    Attributes:
        parts: at least one.
        expose: from the mean luminance to the exposure.
        is_metered: `expose` is given the luminance.
        linear: linear colors are asked for, too.
    """

    parts: Sequence[SubFrame]
    expose: Callable[[float | None], Exposed]
    is_metered: bool
    linear: bool


@dataclass(frozen=True, eq=False)
class FrameRequest:
    """Request of one image; see also `omnisim.rendering.renderer.Renderer.render`.

    Attributes:
        poses: in the middle of the frame.
        motion: poses by seconds after the middle of the frame; None: at rest.
        linear: linear colors are asked for, too.
        frame_number: noise differs from frame to frame.
        exposure_ev: of auto-exposure; None: metered.

    Raises:
        OpticsError: an impossible exposure, also of a camera that has none.
    """

    poses: ScenePoses
    motion: Callable[[float], ScenePoses] | None
    linear: bool
    frame_number: int
    exposure_ev: float | None

    def __post_init__(self) -> None:
        ev = self.exposure_ev
        if ev is not None and not abs(ev) <= MAX_EV:  # NaN is not, either
            raise OpticsError(f"exposure_ev: expected −{MAX_EV:g} to {MAX_EV:g} stops, got {ev:g}")
