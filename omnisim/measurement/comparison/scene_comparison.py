"""A camera's images of a scene compared with its twin's, from the same poses."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import MeasurementError
from omnisim.measurement.comparison.comparison import (
    RINGS,
    Comparison,
    ImageComparison,
    compare_images,
)
from omnisim.measurement.comparison.even_blocks import even_blocks
from omnisim.measurement.comparison.tracked_points import (
    MAX_OFFSET_PX,
    seen_field,
    track_corners,
)
from omnisim.measurement.edge_rise import edge_rise_px
from omnisim.measurement.geometry.board_images import LUMA, read_gray
from omnisim.measurement.sharpness.edge_fit import EdgeLine, UnusableEdge, fit_edge
from omnisim.measurement.sharpness.edge_lines import find_edges
from omnisim.rendering.camera.degradations import Encoding
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.scene.model import Scene

Floats = NDArray[np.float64]
MIN_CORNERS = 10 * RINGS
_MIN_EDGES = 3  # of a ring: single edges of a scene may be no steps
_MIN_FOUND = 0.2  # share of the corners; of unrelated images, fewer are found by chance


def compare_scene(
    sensor: OmniCamera,
    scene: Scene,
    photos: Iterable[tuple[Path, NDArray[np.float64]]],
    *,
    unlit: bool = False,
) -> Iterator[ImageComparison]:
    """Render a scene from the pose of each image, and compare both; yields one image at a time.

    Args:
        sensor: twin of the camera.
        scene: scene in the images, at 0 s of its own time.
        photos: image files, each with the pose (4, 4) world_from_base of the camera's vehicle.
        unlit: render plain base colors, without lights.

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


def check_size(path: Path, image: NDArray[np.uint8], sensor: OmniCamera) -> None:
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


def compare_scene_image(
    name: str, image: NDArray[np.uint8], twin: NDArray[np.uint8], field: NDArray[np.uint8]
) -> ImageComparison:
    """Compare a gray image (height, width) with the twin's.

    Args:
        name: name of the image.
        image: gray image of the camera.
        twin: gray image of the twin.
        field: (height, width) mask of the pixels to compare, see `seen_field`.
    """
    corners, offsets = track_corners(image, twin, field)
    edges = _clean_edges(image, field)
    rises = [
        [edge_rise_px(gray, edge.start_px, edge.end_px) for gray in (image, twin)] for edge in edges
    ]
    centers = [0.5 * (edge.start_px + edge.end_px) for edge in edges]
    blocks = even_blocks(image, twin, field)
    return ImageComparison(
        name,
        image,
        twin,
        corners,
        offsets,
        np.array(rises).reshape(-1, 2),
        np.array(centers).reshape(-1, 2),
        blocks[..., 0],
        blocks,
    )


def _clean_edges(image: NDArray[np.uint8], field: NDArray[np.uint8]) -> list[EdgeLine]:
    """Straight edges between two even areas of an image, within a mask."""
    light = image / 255.0
    clipped = np.zeros(image.shape, dtype=np.bool_)  # white and black paper count, too
    edges = []
    for edge in find_edges(light):
        column, row = np.rint(0.5 * (edge.start_px + edge.end_px)).astype(int).tolist()
        if not field[row, column]:
            continue
        try:
            fit_edge(light, clipped, edge)
        except UnusableEdge:
            continue
        edges.append(edge)
    return edges


def compare_scene_images(sensor: OmniCamera, images: list[ImageComparison]) -> Comparison:
    """Errors of a twin over the field, from images of a scene; biases are medians.

    Raises:
        MeasurementError: too few corners, or most are not found in the twin's images.
    """
    count = sum(len(one.corners_px) for one in images)
    if count < MIN_CORNERS:
        raise MeasurementError(
            f"{count} corners in the images: expected at least {MIN_CORNERS}: take sharp images of "
            "a scene with more detail"
        )
    found = sum(int(np.isfinite(one.offsets_px).all(axis=1).sum()) for one in images)
    if found < max(_MIN_FOUND * count, RINGS):
        raise MeasurementError(
            f"{found} of {count} corners are found in the twin's images: expected most of them: "
            "the poses, their frame (--trajectory-frame), the scene or the sensor file are others"
        )
    return compare_images(sensor, images, MAX_OFFSET_PX, np.median, _MIN_EDGES)


def brighter_ev(sensor: OmniCamera, images: list[ImageComparison]) -> float:
    """Median light of the images' even blocks over that of the twin's, EV; NaN: no even blocks."""
    levels = np.concatenate([one.levels for one in images])
    if not len(levels):
        return math.nan
    encoding = sensor.degradation.encoding or Encoding()
    light = encoding.linearized(levels / 255.0)
    return float(np.median(np.log2(light[:, 0] / light[:, 1])))
