"""Contract of rendering, without OpenGL: what a back end is asked for, and what it returns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


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
