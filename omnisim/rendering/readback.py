"""Contract of rendering, without OpenGL: requests to a back end and their results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import OpticsError
from omnisim.rendering.camera.degradations.effect import MAX_EV
from omnisim.rendering.camera.degradations.image_geometry import Metering

T = TypeVar("T")
U = TypeVar("U")


class Pending(Generic[T]):
    """Result in progress: it was requested, and is computed or drawn meanwhile.

    Args:
        finish: function that waits for the result.
    """

    def __init__(self, finish: Callable[[], T]):
        self._finish: Callable[[], T] | None = finish

    def result(self) -> T:
        """Wait, and return the result; each call returns the same one.

        Raises:
            GraphicsError: the renderer was closed in the meantime, or the GPU failed.
        """
        if self._finish is not None:
            self._result = self._finish()
            self._finish = None
        return self._result

    def then(self, change: Callable[[T], U]) -> Pending[U]:
        """Result of a function of this result."""
        return Pending(lambda: change(self.result()))


class Readback(NamedTuple):
    """Rendered image; top row first."""

    rgba: NDArray[np.uint8]  # (height, width, 4): sRGB, alpha 255 where the camera sees something
    linear: NDArray[np.float32] | None  # (height, width, 3), on request
    luminance: float | None = None  # of the light meter, if there is one


class ScenePoses(NamedTuple):
    """Poses of the camera and of all dynamic objects at one time.

    Attributes:
        world_from_rig: (4, 4) pose of the camera's rig.
        world_from_objects: (4, 4) each, in the order of the stage's objects.
    """

    world_from_rig: NDArray[np.float64]
    world_from_objects: Sequence[NDArray[np.float64]] = ()


class SubFrame(NamedTuple):
    """Part of an image's exposure time.

    Attributes:
        poses: poses in this part.
        row_weights: (height,) share of each row's exposure; None: the whole exposure.
    """

    poses: ScenePoses
    row_weights: NDArray[np.float32] | None


class ImageExposure(NamedTuple):
    """Exposure of one image.

    Attributes:
        factors: factors of red, green and blue light.
        frame_number: seeds the noise, which differs between frames.
    """

    factors: tuple[float, float, float]
    frame_number: int


class SubFrames(NamedTuple):
    """Sub-frames of an image, and its exposure.

    Attributes:
        parts: sub-frames, at least one.
        expose: function from the metered luminance to the exposure.
        meter: light meter that measures the luminance for `expose`; None: not measured.
        linear: also return linear colors.
        frame_number: number of the frame, part of the key of its random numbers.
        is_exposed: the exposure does not depend on the luminance, which is only reported.
    """

    parts: Sequence[SubFrame]
    expose: Callable[[float | None], ImageExposure]
    meter: Metering | None
    linear: bool
    frame_number: int = 0
    is_exposed: bool = False


@dataclass(frozen=True, eq=False)
class FrameRequest:
    """Request of one image; see also `omnisim.rendering.renderer.Renderer.render`.

    Attributes:
        poses: poses in the middle of the frame.
        motion: poses by seconds after the middle of the frame; None: at rest.
        linear: also return linear colors.
        frame_number: seeds the noise, which differs between frames.
        exposure_ev: exposure instead of auto-exposure; None: metered.

    Raises:
        OpticsError: an impossible exposure, or any for a camera without auto-exposure.
    """

    poses: ScenePoses
    motion: Callable[[float], ScenePoses] | None
    linear: bool
    frame_number: int
    exposure_ev: float | None

    def __post_init__(self) -> None:
        ev = self.exposure_ev
        if ev is not None and not abs(ev) <= MAX_EV:  # NaN fails, too
            raise OpticsError(f"exposure_ev: expected −{MAX_EV:g} to {MAX_EV:g} stops, got {ev:g}")
