"""A camera's images compared with its twin's: positions of corners, edges and gray levels."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import MeasurementError
from omnisim.measurement.comparison.board_light import (
    matching_pattern,
    patch_levels,
    patch_samples_px,
    visible_patches,
)
from omnisim.measurement.comparison.even_blocks import (
    NoiseLevel,
    even_blocks,
    noise_by_level,
)
from omnisim.measurement.comparison.printed_pattern import PrintedPattern, possible_patterns
from omnisim.measurement.comparison.twin_board import render_twin
from omnisim.measurement.edge_rise import edge_rise_px
from omnisim.measurement.geometry.board_detection import find_board
from omnisim.measurement.geometry.board_view import BoardView
from omnisim.measurement.geometry.boards import Board
from omnisim.measurement.geometry.placed_board import BoardSurface, locate_board
from omnisim.rendering.camera.omnicamera import OmniCamera

Floats = NDArray[np.float64]
RINGS = 5
MAX_OFFSET_PX = 1.0  # beyond it, another edge was found: the corner counts as lost


@dataclass(frozen=True, eq=False)
class ImageComparison:
    """Image of a board compared with the twin's rendered image.

    Attributes:
        name: image file.
        image, twin: (height, width) gray levels.
        corners_px: (n, 2) corners in the image.
        offsets_px: (n, 2) corners found in the twin, minus those in the image; NaN: not found.
        rises_px: (edges, 2) 10-90 % rise of each edge in the image and in the twin; NaN: not seen.
        edge_centers_px: (edges, 2) middle of each edge in the image.
        levels: (patches, 2) gray levels of squares or other patches of one color in the image and
            in the twin.
        blocks: (blocks, 2, 2) gray level and noise of even blocks in the image and in the twin.
    """

    name: str
    image: NDArray[np.uint8]
    twin: NDArray[np.uint8]
    corners_px: Floats
    offsets_px: Floats
    rises_px: Floats
    edge_centers_px: Floats
    levels: Floats
    blocks: Floats


@dataclass(frozen=True, eq=False)
class Ring:
    """Errors of the twin in a ring of the image.

    Attributes:
        radius_px: outer radius about the principal point.
        corners: number of corners.
        lost: number of corners that are too far off, or not found, in the twin; `bias_px` and
            `rms_px` exclude them.
        bias_px: (2,) mean or median offset of the corners along the radius and across the radius;
            NaN: all are lost.
        rms_px: root mean square of the corners' offsets.
        rise_px, twin_rise_px: median 10-90 % rise of edges in the images and in the twin; NaN: too
            few edges.
    """

    radius_px: float
    corners: int
    lost: int
    bias_px: Floats
    rms_px: float
    rise_px: float
    twin_rise_px: float


@dataclass(frozen=True, eq=False)
class Comparison:
    """Images compared with the twin's, and the errors of the twin in each ring.

    Attributes:
        images: each image with its twin.
        rings: rings of the image with equally many corners, from the middle outward.
        level_errors: (patches,) gray levels of the twin minus those of the images.
        noise: noise of images and twin by gray level.
    """

    images: tuple[ImageComparison, ...]
    rings: tuple[Ring, ...]
    level_errors: Floats
    noise: tuple[NoiseLevel, ...]

    @property
    def bias_px(self) -> float:
        """Largest absolute offset of a ring's corners, along or across the radius.

        Infinite if all corners of a ring are lost.
        """
        biases = [float(np.abs(ring.bias_px).max()) for ring in self.rings]
        return max(bias if math.isfinite(bias) else math.inf for bias in biases)

    @property
    def lost(self) -> int:
        """Number of corners that are too far off, or not found, in the twin."""
        return sum(ring.lost for ring in self.rings)


def compare_image(
    sensor: OmniCamera,
    board: Board,
    view: BoardView,
    image: NDArray[np.uint8],
    board_m: Floats | None = None,
    mirrored: bool = False,
) -> ImageComparison:
    """Render a board in the pose that it has in an image, and compare both images.

    Args:
        sensor: twin of the camera.
        board: calibration board.
        view: the board in the image.
        image: (height, width) gray image.
        board_m: (corners, 3) measured positions of the board's corners; None: flat.
        mirrored: the camera looks into a mirror.

    Raises:
        MeasurementError: the image and the sensor differ in size, or the board is outside the
            twin's field of view or not found in the twin's image.
    """
    camera = sensor.model
    if (camera.width_px, camera.height_px) != image.shape[::-1]:
        raise MeasurementError(
            f"{view.name}: {image.shape[1]} × {image.shape[0]} px, but the sensor has "
            f"{camera.width_px} × {camera.height_px}"
        )
    patterns = possible_patterns(board)
    surface = None
    if board_m is not None:
        corners_m = np.unique(patterns[0].edges_m.reshape(-1, 2), axis=0)
        surface = BoardSurface.measured(board_m, corners_m)
    placed = locate_board(camera, view, surface)
    pattern = matching_pattern(image, patterns, placed, view)
    patches = visible_patches(pattern, view)
    samples = patch_samples_px(patches, placed)
    is_shown = np.asarray(np.isfinite(samples).all(axis=(1, 2)))
    patches, samples = patches.select(is_shown), samples[is_shown]
    twin = render_twin(sensor, placed, pattern, patches, image)
    try:
        found = find_board(twin, board, view.name, mirrored)
    except MeasurementError as reason:
        raise MeasurementError(f"{view.name}: in the twin's image: {reason}") from None
    starts, ends = _edges(view, pattern)
    rises = [
        [edge_rise_px(one, start, end, pattern.clear) for one in (image, twin)]
        for start, end in zip(starts, ends, strict=True)
    ]
    levels = [patch_levels(one, samples) for one in (image, twin)]
    return ImageComparison(
        view.name,
        image,
        twin,
        view.pixels_px,
        _offsets_px(view, found),
        np.array(rises).reshape(-1, 2),
        0.5 * (starts + ends),
        np.stack(levels, axis=1),
        even_blocks(image, twin, _board_field(view, image)),
    )


def _board_field(view: BoardView, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Mask (height, width) of the convex hull of a board's corners; 255: inside."""
    import cv2

    field = np.zeros(image.shape, dtype=np.uint8)
    hull = cv2.convexHull(np.rint(view.pixels_px).astype(np.int32))
    cv2.fillConvexPoly(field, hull, (255,))
    return field


def _offsets_px(view: BoardView, found: BoardView) -> Floats:
    """Offsets (n, 2) of a view's corners as found in the twin; NaN: not found."""
    if len(found.pixels_px) == len(view.pixels_px):
        turned = found.pixels_px[::-1] - view.pixels_px  # a board may look the same upside down
        offsets: Floats = found.pixels_px - view.pixels_px
        if np.abs(turned).sum() < np.abs(offsets).sum():
            return turned
    pixel_of_point = dict(zip(_keys(found.points_m), found.pixels_px, strict=True))
    missing = np.full(2, np.nan)
    pixels = [pixel_of_point.get(key, missing) for key in _keys(view.points_m)]
    return np.array(pixels) - view.pixels_px


def _keys(points_m: Floats) -> list[tuple[float, ...]]:
    """Keys of points (n, 2) on a board."""
    return [tuple(point) for point in np.round(points_m, 9).tolist()]


def compare_images(
    sensor: OmniCamera,
    images: list[ImageComparison],
    max_offset_px: float = MAX_OFFSET_PX,
    average: Callable[[Floats], np.floating[Any]] = np.mean,
    min_edges: int = 1,
) -> Comparison:
    """Errors of a twin over the field.

    Args:
        sensor: twin of the camera.
        images: images beside their twins, at least one.
        max_offset_px: offset beyond which a corner counts as lost.
        average: average of a ring's offsets.
        min_edges: edges of a ring without which its rise is unknown.
    """
    center = np.array(sensor.model.principal_point_px)
    corners = np.concatenate([one.corners_px for one in images])
    offsets = np.concatenate([one.offsets_px for one in images])
    rises = np.concatenate([one.rises_px for one in images])
    edges = np.concatenate([one.edge_centers_px for one in images])
    radii = np.linalg.norm(corners - center, axis=1)
    edge_radii = np.linalg.norm(edges - center, axis=1)
    limits = np.quantile(radii, np.linspace(0.0, 1.0, RINGS + 1))
    limits[0], limits[-1] = 0.0, math.inf
    outward = (corners - center) / np.maximum(radii, 1e-9)[:, None]
    along = (offsets * outward).sum(axis=1)
    across = offsets[:, 1] * outward[:, 0] - offsets[:, 0] * outward[:, 1]
    rings = []
    for low, high in pairwise(limits):
        in_ring = (radii >= low) & (radii < high)
        inside = in_ring & (np.linalg.norm(offsets, axis=1) <= max_offset_px)
        bias, rms = np.full(2, np.nan), math.nan
        if inside.any():
            bias = np.array([average(along[inside]), average(across[inside])])
            rms = float(np.sqrt(np.mean(np.square(offsets[inside]).sum(axis=1))))
        of_edges = (edge_radii >= low) & (edge_radii < high) & np.isfinite(rises).all(axis=1)
        seen = rises[of_edges]
        median = np.median(seen, axis=0) if len(seen) >= min_edges else np.full(2, np.nan)
        rings.append(
            Ring(
                float(radii[in_ring].max()),
                int(in_ring.sum()),
                int(in_ring.sum() - inside.sum()),
                bias,
                rms,
                float(median[0]),
                float(median[1]),
            )
        )
    levels = np.concatenate([one.levels for one in images])
    noise = noise_by_level([one.blocks for one in images])
    return Comparison(tuple(images), tuple(rings), levels[:, 1] - levels[:, 0], noise)


def _edges(view: BoardView, pattern: PrintedPattern) -> tuple[Floats, Floats]:
    """Start and end points, (edges, 2) each, of the edges between detected corners."""
    pixel_of_point = dict(zip(_keys(view.points_m), view.pixels_px, strict=True))
    ends = [
        [pixel_of_point[start], pixel_of_point[end]]
        for start, end in (_keys(edge) for edge in pattern.edges_m)
        if start in pixel_of_point and end in pixel_of_point
    ]
    pixels = np.array(ends).reshape(-1, 2, 2)
    return pixels[:, 0], pixels[:, 1]
