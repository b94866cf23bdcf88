"""Pictures to detect landmarks in: those of a run, or a single one."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import OpticsError, OutputError
from omnisim.perception.panorama import CameraMount
from omnisim.sensors.omnicamera import OmniCamera
from omnisim.sensors.picture_file import read_picture
from omnisim.simulation.run_data import read_run


@dataclass(frozen=True)
class PictureSource:
    """Pictures of one camera.

    Attributes:
        mount: the camera.
        count: how many pictures.
        picture: the one of a step.
        unfinished: notice about a run that is not whole, or None.
    """

    mount: CameraMount
    count: int
    picture: Callable[[int], NDArray[np.uint8]]
    unfinished: str | None = None


def run_source(folder: Path, scene: str | None = None, camera: str | None = None) -> PictureSource:
    """Pictures of a run.

    Raises:
        OmnisimError: anything that `read_run` refuses.
    """
    run = read_run(folder, scene, camera)
    return PictureSource(run.mount, run.steps, run.picture, run.unfinished)


def picture_source(
    path: Path, height_m: float | None = None, sensor: OmniCamera | None = None
) -> PictureSource:
    """Single picture, whose metadata names its camera.

    Only how the camera sits on its vehicle is taken from it, not where the vehicle was.

    Args:
        path: of the picture.
        height_m: of the effective viewpoint above the ground, or None: its own z.
        sensor: that it was taken with, on the vehicle, or None: the picture says so itself.

    Raises:
        OutputError: no picture, of floats, or without its camera.
        OpticsError: a height that cannot be.
    """
    taken = read_picture(path, sensor)
    if taken.pixels.dtype != np.uint8:
        raise OutputError(f"{path}: has linear floats: expected a picture of 8 bits, .png")
    known = taken.height_m if sensor is None else float(sensor.base_from_optical[2, 3])
    own = known if height_m is None else height_m
    if own is None or not (math.isfinite(own) and own > 0.0):
        raise OpticsError(
            f"{path}: camera {own} m above the ground: expected more than 0: pass --height METRES"
        )
    base_from_optical = np.eye(4)
    base_from_optical[:3, :3] = taken.base_from_optical
    if sensor is not None:
        base_from_optical[:3, 3] = sensor.base_from_optical[:3, 3]
    elif taken.world_from_base is not None and taken.world_from_optical is not None:
        arm = taken.world_from_optical[:3, 3] - taken.world_from_base[:3, 3]
        base_from_optical[:3, 3] = taken.world_from_base[:3, :3].T @ arm
    base_from_optical[2, 3] = own
    mount = CameraMount(taken.camera, base_from_optical, taken.covered)
    return PictureSource(mount, 1, lambda _: taken.pixels)
