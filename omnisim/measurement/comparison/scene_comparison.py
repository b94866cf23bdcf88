"""A camera's images of a scene compared with its twin's, from the same poses."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.cameras.camera import CentralCamera
from omnisim.core.arrays import Bytes, Floats
from omnisim.core.errors import MeasurementError
from omnisim.measurement.comparison.comparison import (
    RINGS,
    Comparison,
    ImageComparison,
    compare_images,
    edge_rise_px,
    even_blocks,
)
from omnisim.measurement.geometry.board_detection import LUMA, read_gray
from omnisim.measurement.sharpness.slanted_edge import UnusableEdge, find_edges, fit_edge
from omnisim.rendering.camera.degradations import Encoding
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.scene.model import Scene

MIN_CORNERS = 10 * RINGS
_MIN_EDGES = 3  # of a ring: single edges of a scene may be no steps
_MIN_FOUND = 0.2  # share of the corners; of unrelated images, fewer are found by chance


def compare_scene(
    sensor: OmniCamera, scene: Scene, photos: Iterable[tuple[Path, Floats]], *, unlit: bool = False
) -> Iterator[ImageComparison]:
    """Render a scene, at 0 s, from each image's pose, and compare both; yields one image at a time.

    The poses (4, 4) are world_from_base of the camera's vehicle. Unlit: plain base colors.

    Raises:
        MeasurementError: an image that cannot be read, or differs from the sensor in size.
        OmnisimError: the scene cannot be rendered.
    """
    field = seen_field(sensor.model)
    with open_sensor(scene, sensor, unlit=unlit) as renderer:
        for number, (path, world_from_base) in enumerate(photos):
            image = read_gray(path)
            check_size(path, image, sensor)
            frame = renderer.render(world_from_base, frame_number=number)
            twin = np.rint(frame.rgba[..., :3] @ LUMA).astype(np.uint8)
            yield compare_scene_image(path.name, image, twin, field)


def check_size(path: Path, image: Bytes, sensor: OmniCamera) -> None:
    """Check that an image (height, width) has the size of a sensor's.

    Raises:
        MeasurementError: it has another size.
    """
    wanted = sensor.model.width_px, sensor.model.height_px
    if image.shape[::-1] != wanted:
        raise MeasurementError(
            f"{path}: {image.shape[1]} × {image.shape[0]} px: expected {wanted[0]} × {wanted[1]} "
            "px as in the sensor file"
        )


def compare_scene_image(name: str, image: Bytes, twin: Bytes, field: Bytes) -> ImageComparison:
    """Compare a gray image (height, width) with the twin's, within a mask of `seen_field`."""
    corners, offsets = track_corners(image, twin, field)
    light = image / 255.0
    clipped = np.zeros(image.shape, dtype=np.bool_)  # white and black paper count, too
    rises, centers = [], []
    for edge in find_edges(light):
        center = 0.5 * (edge.start_px + edge.end_px)
        column, row = np.rint(center).astype(int).tolist()
        if not field[row, column]:
            continue
        try:
            fit_edge(light, clipped, edge)
        except UnusableEdge:
            continue
        centers.append(center)
        rises.append([edge_rise_px(gray, edge.start_px, edge.end_px) for gray in (image, twin)])
    blocks = even_blocks(image, twin, field)
    return ImageComparison(
        name, image, twin, corners, offsets, np.array(rises).reshape(-1, 2),
        np.array(centers).reshape(-1, 2), blocks[..., 0], blocks,
    )  # fmt: skip


def compare_scene_images(sensor: OmniCamera, images: list[ImageComparison]) -> Comparison:
    """Errors of a twin over the field, from images of a scene; biases are medians.

    Raises:
        MeasurementError: too few corners, or most are not found in the twin's images.
    """
    count = sum(len(image.corners_px) for image in images)
    if count < MIN_CORNERS:
        raise MeasurementError(
            f"{count} corners in the images: expected at least {MIN_CORNERS}: take sharp images of "
            "a scene with more detail"
        )
    found = sum(int(np.isfinite(image.offsets_px).all(axis=1).sum()) for image in images)
    if found < max(_MIN_FOUND * count, RINGS):
        raise MeasurementError(
            f"{found} of {count} corners are found in the twin's images: expected most of them: "
            "check the poses, their frame (--trajectory-frame), the scene and the sensor file"
        )
    return compare_images(sensor, images, MAX_OFFSET_PX, np.median, _MIN_EDGES)


def brighter_ev(sensor: OmniCamera, images: list[ImageComparison]) -> float:
    """Median light of the images' even blocks over that of the twin's, EV; NaN: no even blocks."""
    levels = np.concatenate([image.levels for image in images])
    if not len(levels):
        return math.nan
    encoding = sensor.degradation.encoding or Encoding()
    light = encoding.linearized(levels / 255.0)
    return float(np.median(np.log2(light[:, 0] / light[:, 1])))


# Corners of a scene in a camera's image, tracked into the twin's image by OpenCV.
#
# Sources: Shi & Tomasi, "Good features to track" (CVPR 1994), for the corners; Lucas & Kanade
# (1981), in Bouguet's pyramid, for their offsets; Kalal et al., "Forward-backward error" (ICPR
# 2010), for the rejection of wrong ones.


Gray = Bytes
MAX_OFFSET_PX = 12.0  # of a corner; the pyramid's reach
_MAX_CORNERS = 500  # per image
_QUALITY, _DISTANCE_PX = 0.02, 8.0  # of the corners: share of the best one, and spacing
_WINDOW_PX, _LEVELS = 15, 2
_MAX_RETURN_PX = 0.1  # from a corner to where it is tracked back to
_MIN_CORRELATION = 0.8  # of the windows around a corner in both images
_SMOOTH_PX = 8.0  # standard deviation of the local mean and contrast
_MIN_CONTRAST = 3.0  # gray levels


def seen_field(camera: CentralCamera) -> Gray:
    """Mask (height, width) of pixels with a ray whose neighborhood has rays, too; 255: True."""
    import cv2

    rows, columns = np.mgrid[: camera.height_px, : camera.width_px]
    pixels = np.stack((columns, rows), axis=-1).reshape(-1, 2).astype(np.float64)
    valid = camera.ray_from_pixel(pixels).valid.reshape(camera.height_px, camera.width_px)
    kernel = np.ones((_WINDOW_PX + 2, _WINDOW_PX + 2), dtype=np.uint8)
    mask: Any = cv2.erode(valid.astype(np.uint8), kernel, borderValue=0)
    return np.asarray(255 * mask, dtype=np.uint8)


def track_corners(image: Gray, twin: Gray, field: Gray) -> tuple[Floats, Floats]:
    """Corners (n, 2) in an image, and their offsets (n, 2) in the twin's; NaN: not found.

    Brightness and contrast may differ: both images (height, width) are normalized around each pixel
    first. Corners are searched within `field` (height, width).
    """
    import cv2

    found: Any = cv2.goodFeaturesToTrack(image, _MAX_CORNERS, _QUALITY, _DISTANCE_PX, mask=field)
    if found is None:
        return np.zeros((0, 2)), np.zeros((0, 2))
    one, other = _normalized(image), _normalized(twin)
    options: dict[str, Any] = {
        "winSize": (_WINDOW_PX, _WINDOW_PX),
        "maxLevel": _LEVELS,
        "criteria": (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 50, 1e-3),
    }
    unknown: Any = None
    there, is_there, _ = cv2.calcOpticalFlowPyrLK(one, other, found, unknown, **options)
    back, is_back, _ = cv2.calcOpticalFlowPyrLK(other, one, there, unknown, **options)
    offsets = (there - found).reshape(-1, 2).astype(np.float64)
    returned = np.linalg.norm((back - found).reshape(-1, 2), axis=1)
    is_found = (is_there.ravel() == 1) & (is_back.ravel() == 1) & (returned <= _MAX_RETURN_PX)
    is_found &= np.linalg.norm(offsets, axis=1) <= MAX_OFFSET_PX
    corners = found.reshape(-1, 2).astype(np.float64)
    for index in np.flatnonzero(is_found).tolist():
        first, second = _window(one, corners[index]), _window(other, (corners + offsets)[index])
        correlation = float(np.corrcoef(first, second)[0, 1])
        is_found[index] = correlation >= _MIN_CORRELATION  # False for NaN
    return corners, np.where(is_found[:, None], offsets, np.nan)


def _window(image: Gray, center_px: Floats) -> Floats:
    """Pixels (n,) of the window around a position in an image."""
    import cv2

    center = float(center_px[0]), float(center_px[1])
    window: Any = cv2.getRectSubPix(image, (_WINDOW_PX, _WINDOW_PX), center)
    return np.asarray(window, dtype=np.float64).ravel()


def _normalized(image: Gray) -> Gray:
    """Image with its local mean at 128 and its local standard deviation at 40 levels."""
    import cv2

    levels = image.astype(np.float32)
    mean: Any = cv2.GaussianBlur(levels, (0, 0), _SMOOTH_PX)
    variance: Any = cv2.GaussianBlur(np.square(levels - mean), (0, 0), _SMOOTH_PX)
    contrast = np.sqrt(variance) + _MIN_CONTRAST
    return np.clip(128.5 + 40.0 * (levels - mean) / contrast, 0.0, 255.0).astype(np.uint8)
