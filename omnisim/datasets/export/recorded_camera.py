"""Cameras of a recorded run: images and ground truth at each step."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, NonCentralCamera
from omnisim.cameras.camera import pixel_grid
from omnisim.core.errors import RunError
from omnisim.core.files.image_files import read_image
from omnisim.ground_truth.label_names import Labels
from omnisim.ground_truth.stored_channels import StoredChannels
from omnisim.perception.unwarping.panorama import CameraMount
from omnisim.rendering.camera.omnicamera import CALIBRATION
from omnisim.runs.run_folder import RunFolder
from omnisim.sensors.calibration_file import read_mount
from omnisim.sensors.depth_camera.depth_camera import STEPS_PER_M

IMAGE = ".png"


@dataclass(frozen=True, eq=False)
class RecordedCamera:
    """Camera of a run.

    Attributes:
        run: folder of the run.
        name: name of the camera.
        mount: model, pose on the base, and mask of pixels that show the scene.
        indices: (n,) number of the camera's image at each frame; None: the frame's own number.
    """

    run: RunFolder
    name: str
    mount: CameraMount
    indices: NDArray[np.intp] | None = field(default=None, kw_only=True)

    @classmethod
    def read(cls, run: RunFolder, name: str) -> RecordedCamera:
        """Read the calibration of a camera.

        Raises:
            RunError: the calibration cannot be read.
        """
        return cls(run, name, read_mount(run.path / name / CALIBRATION))

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the images."""
        return self.mount.camera.width_px, self.mount.camera.height_px

    @property
    def has_one_viewpoint(self) -> bool:
        """False for non-central optics."""
        return not isinstance(self.mount.camera, NonCentralCamera)

    @property
    def central(self) -> CentralCamera:
        """Central model of the camera.

        Raises:
            RunError: the camera is non-central.
        """
        if not self.has_one_viewpoint:
            raise RunError(
                f"{self.run.path / self.name}: expected a central camera, got optics: "
                "`omnisim calibration convert` fits one to it"
            )
        return self.mount.camera

    def image_file(self, step: int) -> Path:
        """Image file of a step."""
        index = step if self.indices is None else int(self.indices[step])
        return self.run.file(self.name, index, IMAGE)

    def image(self, step: int) -> NDArray[np.uint8]:
        """Image (height, width, 3) of a step, sRGB.

        Raises:
            OutputError: the file is missing or damaged.
            RunError: the image has another size than the camera's.
        """
        path = self.image_file(step)
        pixels, _ = read_image(path)
        width, height = self.size_px
        if pixels.shape[:2] != (height, width) or pixels.shape[2] < 3 or pixels.dtype != np.uint8:
            raise RunError(
                f"{path}: expected {width} × {height} px of 3 × uint8, got {pixels.shape[1]} × "
                f"{pixels.shape[0]} px of {pixels.shape[2]} × {pixels.dtype}"
            )
        return np.ascontiguousarray(pixels[..., :3])

    def depths_m(self, step: int) -> NDArray[np.float32]:
        """Depths (height, width) of a depth camera along its axis; +inf: none.

        Raises:
            OutputError: the file is missing or damaged.
            RunError: the image has another size than the camera's.
        """
        path = self.image_file(step)
        depths = read_image(path)[0][..., 0]
        width, height = self.size_px
        if depths.shape != (height, width) or depths.dtype != np.uint16:
            raise RunError(f"{path}: expected depths of {width} × {height} px in 16 bits")
        return np.where(depths, depths / STEPS_PER_M, np.inf).astype("f4")

    def has(self, channel: str) -> bool:
        """True if the run has a channel of ground truth."""
        return channel in self.run.manifest.channels

    def channel(self, step: int, name: str) -> NDArray[Any]:
        """Channel (height, width, …) of ground truth at a step.

        Raises:
            OutputError: a file is missing or damaged.
            RunError: the channel has another size than the image.
        """
        path = self.image_file(step)
        values: NDArray[Any] = StoredChannels(path, {}).read([name])[name]
        width, height = self.size_px
        if values.shape[:2] != (height, width):
            raise RunError(f"{path}: channel {name!r}: expected {width} × {height} px")
        return values

    def labels(self, step: int) -> Labels | None:
        """Labels of the classes and instances at a step; None: unknown.

        Raises:
            OutputError: the table is damaged.
        """
        return StoredChannels(self.image_file(step), {}).labels

    @cached_property
    def _rays(self) -> tuple[NDArray[np.float64], NDArray[np.float64] | None, NDArray[np.bool_]]:
        rays = self.mount.camera.ray_from_pixel(pixel_grid(*self.size_px))
        return rays.directions, rays.origins_m, rays.valid

    @property
    def directions(self) -> NDArray[np.float64]:
        """Unit vectors (height, width, 3) along the pixels' rays, optical frame."""
        return self._rays[0]

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Mask (height, width) of the pixels with a ray."""
        return self._rays[2]

    def points_m(self, ranges_m: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Points (n, 3) in the optical frame for pixels with a hit, and a mask of these pixels.

        Args:
            ranges_m: (height, width) length of each pixel's ray; +inf: no hit.
        """
        directions, origins_m, valid = self._rays
        hit = np.isfinite(ranges_m) & valid
        points: NDArray[np.float64] = directions[hit] * ranges_m[hit, None]
        return points if origins_m is None else points + origins_m[hit], hit
