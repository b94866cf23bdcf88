"""Image files with their cameras, and the masks of pixels that show the scene."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import (
    CentralCamera,
    HyperbolicCamera,
    NonCentralCamera,
    camera_from_parameters,
    pixel_grid,
    summary,
)
from omnisim.cameras.mirrors.hyperbolic import inside_rim
from omnisim.cameras.mirrors.mirror_mesh import sectors_and_rings
from omnisim.core.arrays import Bools, Floats
from omnisim.core.errors import OmnisimError, OpticsError, OutputError, SensorFileError
from omnisim.core.files.image_files import read_image
from omnisim.core.poses import check_pose
from omnisim.core.short_repr import short_repr
from omnisim.rendering.camera.omnicamera import OmniCamera


def camera_of_parameters(parameters: Mapping[str, Any]) -> CentralCamera:
    """Camera described by the `parameters()` of any camera, including an optical system.

    Raises:
        OpticsError: names the first faulty key, with the expected and the actual value.
    """
    if not isinstance(parameters, Mapping) or parameters.get("model") != "optics":
        return camera_from_parameters(parameters)
    from omnisim.cameras.optics.system_file import parse_optics  # few cameras need it

    # an image or a run contains its whole camera: references to other files are refused
    surfaces = parameters.get("surfaces")
    tables = list(surfaces) if isinstance(surfaces, list | tuple) else []
    for table in (parameters.get("camera"), *tables):
        for key in ("calibration", "file"):
            if isinstance(table, Mapping) and key in table:
                raise OpticsError(f"camera: {key}: expected its content, got file {table[key]!r}")
    try:
        return parse_optics(parameters, "camera")
    except SensorFileError as faults:
        raise OpticsError(str(faults).partition("\n")[0]) from None


BLOCK_PIXELS = 1 << 20  # pixels per step, to bound the memory of intermediate arrays


def valid_mask(camera: CentralCamera, polygons: int | None) -> Bools:
    """Mask (height, width) of the pixels whose center shows the scene.

    Args:
        polygons: polygons of the mirror mesh; None: exact.

    Raises:
        OpticsError: the polygon count does not make a mesh.
    """
    if polygons is not None and isinstance(camera, NonCentralCamera):
        from omnisim.cameras.optics.mesh_rays import MeshRays  # few cameras need it

        pixels = pixel_grid(camera.width_px, camera.height_px)
        return MeshRays(camera, polygons).ray_from_pixel(pixels).valid
    mask = np.empty((camera.height_px, camera.width_px), dtype=np.bool_)
    step = max(1, BLOCK_PIXELS // camera.width_px)
    for first in range(0, camera.height_px, step):
        rows = mask[first : first + step]
        pixels = pixel_grid(camera.width_px, len(rows)) + (0.0, first)
        if polygons is not None and isinstance(camera, HyperbolicCamera):
            rows[:] = inside_rim(camera, sectors_and_rings(polygons)[0], pixels)
        else:
            rows[:] = camera.ray_from_pixel(pixels).valid
    return mask


@dataclass(frozen=True, eq=False, kw_only=True)
class CapturedImage:
    """Image with its camera and poses."""

    pixels: NDArray[Any]  # (height, width, 3) uint8 sRGB, or float32 linear
    covered: Bools  # (height, width) mask of pixels that show the scene
    camera: CentralCamera  # camera of the image
    base_from_optical: Floats  # (3, 3) rotation from the optical frame to the vehicle's base
    world_from_base: Floats | None  # (4, 4) pose, if the image has it
    world_from_optical: Floats | None
    metadata: dict[str, Any]  # metadata of the image file; empty if there is none

    def __repr__(self) -> str:
        return short_repr(self, summary(self.camera), str(self.pixels.dtype))

    def assuming_viewpoint(self, distance_m: float) -> tuple[CapturedImage, str | None]:
        """The same image, or a central approximation if its camera is an optical system.

        Args:
            distance_m: distance from the viewpoint at which points are exact.

        Returns:
            The image; and a note on the assumption and its errors, or None without an assumption.

        Raises:
            OpticsError: the distance is not positive, or is given for a central camera.
        """
        if not isinstance(self.camera, NonCentralCamera):
            if math.isfinite(distance_m):
                fault = f"expected an optical system, got {summary(self.camera)}"
                raise OpticsError(f"--right-at: {fault}, which is central")
            return self, None
        from omnisim.cameras.optics.centrality import CentralView  # few cameras need it

        view, world = CentralView(self.camera, distance_m), self.world_from_optical
        world_from_view = None if world is None else view.frame_from_view(world)
        central = dataclasses.replace(self, camera=view, world_from_optical=world_from_view)
        return central, view.caveat()

    @property
    def height_m(self) -> float | None:
        """Height of the effective viewpoint above the world's z = 0, if known."""
        return None if self.world_from_optical is None else float(self.world_from_optical[2, 3])


def read_captured_image(path: Path, sensor: OmniCamera | None = None) -> CapturedImage:
    """Read an image with its camera, from its own metadata or from a given sensor.

    Raises:
        OmnisimError: not an image, no camera, or an image size that differs from the camera's.
    """
    stored, metadata = read_image(path)
    colors = stored[..., :3] if stored.shape[2] >= 3 else np.repeat(stored[..., :1], 3, axis=2)
    if colors.dtype == np.uint16:
        colors = np.rint(colors / 257.0).astype(np.uint8)
    elif colors.dtype != np.uint8:
        colors = colors.astype(np.float32)
    pixels = np.array(colors, order="C")
    metadata = metadata or {}
    world_from_base = _pose(metadata, "world_from_base", path)
    world_from_optical = _pose(metadata, "world_from_optical", path)
    if sensor is not None:
        camera, polygons = sensor.model, sensor.mesh_polygons
        base_from_optical = sensor.base_from_optical[:3, :3]
    else:
        way_out = "pass the sensor file that it was taken with, --sensor FILE"
        if not isinstance(metadata.get("camera"), dict):
            raise OutputError(f"{path}: has no camera parameters inside: {way_out}")
        try:
            camera = camera_of_parameters(metadata["camera"])
        except OmnisimError as reason:
            raise OutputError(f"{path}: its metadata: {reason}") from None
        if world_from_base is None or world_from_optical is None:
            missing = "its metadata has no pose of the camera on its vehicle"
            raise OutputError(f"{path}: {missing}: {way_out}")
        base_from_optical = world_from_base[:3, :3].T @ world_from_optical[:3, :3]
        polygons = metadata.get("polygons") if type(metadata.get("polygons")) is int else None
    height, width = pixels.shape[:2]
    if (width, height) != (camera.width_px, camera.height_px):
        size = f"{camera.width_px} × {camera.height_px}"
        raise OutputError(f"{path}: is {width} × {height} px, where its camera's images are {size}")
    try:
        covered = valid_mask(camera, polygons)
    except OmnisimError as reason:
        raise OutputError(f"{path}: its metadata: {reason}") from None
    if stored.shape[2] in (2, 4):
        covered &= stored[..., -1] > 0
    if pixels.dtype != np.uint8:  # infinities and NaN are invalid
        finite = np.isfinite(pixels).all(axis=-1)
        covered &= finite
        pixels[~finite] = 0.0
    return CapturedImage(
        pixels=pixels,
        covered=covered,
        camera=camera,
        base_from_optical=base_from_optical,
        world_from_base=world_from_base,
        world_from_optical=world_from_optical,
        metadata=metadata,
    )


def _pose(metadata: dict[str, Any], key: str, path: Path) -> Floats | None:
    if key not in metadata:
        return None
    try:
        return check_pose(metadata[key])
    except (OmnisimError, TypeError, ValueError):
        raise OutputError(f"{path}: its metadata: {key}: expected a pose, a 4 × 4 matrix") from None
