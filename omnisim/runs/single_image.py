"""Single images with their camera, for landmark detection."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import summary
from omnisim.core.errors import OpticsError, OutputError
from omnisim.core.short_repr import short_repr
from omnisim.perception.unwarping.panorama import CameraMount
from omnisim.rendering.camera.captured_image import read_captured_image
from omnisim.rendering.camera.omnicamera import OmniCamera


@dataclass(frozen=True, eq=False)
class SingleImage:
    """Image of a camera, as a run of one step.

    Attributes:
        mount: camera on its vehicle.
        pixels: (height, width, 3), sRGB.
    """

    mount: CameraMount
    pixels: NDArray[np.uint8]
    steps: ClassVar[int] = 1

    def __repr__(self) -> str:
        return short_repr(self, summary(self.mount.camera))

    @property
    def notices(self) -> list[str]:
        """Notices: an assumed viewpoint of a non-central camera."""
        return [] if self.mount.caveat is None else [self.mount.caveat]

    def image(self, step: int) -> NDArray[np.uint8]:
        """Image (height, width, 3) at step 0, the only step, sRGB."""
        return self.pixels


def read_single_image(
    path: Path, height_m: float | None = None, sensor: OmniCamera | None = None
) -> SingleImage:
    """Read an image whose metadata names its camera.

    The metadata gives the camera's mount on its vehicle; the vehicle's pose is ignored.

    Args:
        path: path of the image.
        height_m: height of the effective viewpoint above the ground, or None: the mount's z.
        sensor: camera of the image, on the vehicle, or None: the one in the image's metadata.

    Raises:
        OutputError: not an image, an image of floats, or an image without its camera.
        OpticsError: an invalid height.
    """
    captured = read_captured_image(path, sensor)
    if captured.pixels.dtype != np.uint8:
        raise OutputError(f"{path}: has linear floats: expected an image of 8 bits, .png")
    viewpoint_height_m = height_m
    if height_m is None:
        height_m = captured.height_m if sensor is None else float(sensor.base_from_optical[2, 3])
    if height_m is None or not (math.isfinite(height_m) and height_m > 0.0):
        raise OpticsError(
            f"{path}: camera {height_m} m above the ground: expected more than 0: pass "
            "--height METERS"
        )
    base_from_optical = np.eye(4)
    base_from_optical[:3, :3] = captured.base_from_optical
    if sensor is not None:
        base_from_optical[:3, 3] = sensor.base_from_optical[:3, 3]
    elif captured.world_from_base is not None and captured.world_from_optical is not None:
        arm = captured.world_from_optical[:3, 3] - captured.world_from_base[:3, 3]
        base_from_optical[:3, 3] = captured.world_from_base[:3, :3].T @ arm
    base_from_optical[2, 3] = height_m
    mount = CameraMount(captured.camera, base_from_optical, captured.covered).assuming_viewpoint()
    if viewpoint_height_m is not None:
        mount.base_from_optical[2, 3] = viewpoint_height_m
    return SingleImage(mount, captured.pixels)
