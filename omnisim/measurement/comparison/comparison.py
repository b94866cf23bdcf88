"""A camera's images compared with its twin's: positions of corners, edges and gray levels."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.signal import convolve2d

from omnisim.core.arrays import Bytes, Floats, Indices
from omnisim.core.errors import MeasurementError
from omnisim.measurement.comparison.twin_board import (
    PrintedPattern,
    matching_pattern,
    patch_levels,
    patch_samples_px,
    possible_patterns,
    render_twin,
    visible_patches,
)
from omnisim.measurement.geometry.board_detection import find_board
from omnisim.measurement.geometry.boards import Board, BoardView
from omnisim.measurement.geometry.placed_board import BoardSurface, locate_board
from omnisim.rendering.camera.omnicamera import OmniCamera

RINGS = 5
MAX_OFFSET_PX = 1.0  # beyond it, another edge was found: the corner counts as lost


@dataclass(frozen=True, eq=False)
class ImageComparison:
    """Image of a board compared with the twin's rendered image; not found or seen: NaN."""

    name: str  # image file
    image: Bytes  # (height, width) gray levels
    twin: Bytes  # (height, width) gray levels
    corners_px: Floats  # (n, 2) corners in the image
    offsets_px: Floats  # (n, 2) corners in the twin minus those in the image
    rises_px: Floats  # (edges, 2) 10-90 % rise of each edge in the image and in the twin
    edge_centers_px: Floats  # (edges, 2) middle of each edge in the image
    levels: Floats  # (patches, 2) gray levels of patches of one color in the image and in the twin
    # (blocks, 2, 2) gray level and noise of even blocks in the image and in the twin
    blocks: Floats


@dataclass(frozen=True, eq=False)
class Ring:
    """Errors of the twin in a ring of the image; NaN: all corners are lost, or too few edges."""

    radius_px: float  # outer radius about the principal point
    corners: int  # number of corners
    lost: int  # corners too far off, or not found, in the twin; bias and rms exclude them
    bias_px: Floats  # (2,) mean or median offset of the corners along and across the radius
    rms_px: float  # root mean square of the corners' offsets
    rise_px: float  # median 10-90 % rise of edges in the images
    twin_rise_px: float  # the same in the twin


@dataclass(frozen=True, eq=False)
class Comparison:
    """Images compared with the twin's, and the errors of the twin in each ring."""

    images: tuple[ImageComparison, ...]  # each image with its twin
    rings: tuple[Ring, ...]  # rings of the image with equally many corners, from the middle outward
    level_errors: Floats  # (patches,) gray levels of the twin minus those of the images
    noise: tuple[NoiseLevel, ...]  # noise of images and twin by gray level

    @property
    def bias_px(self) -> float:
        """Largest absolute offset of a ring's corners, along or across; infinite: all are lost."""
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
    image: Bytes,
    board_m: Floats | None = None,
    mirrored: bool = False,
) -> ImageComparison:
    """Render a board in the pose that it has in a gray image, and compare both images.

    The board's corners are at `board_m` (corners, 3), as measured; None: flat.

    Raises:
        MeasurementError: the image and the sensor differ in size, or the board is outside the
            twin's field of view or not found in the twin's image.
    """
    import cv2

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
        [edge_rise_px(pixels, start, end, pattern.clear) for pixels in (image, twin)]
        for start, end in zip(starts, ends, strict=True)
    ]
    levels = np.stack([patch_levels(pixels, samples) for pixels in (image, twin)], axis=1)
    field = np.zeros(image.shape, dtype=np.uint8)  # 255 among the corners
    hull = cv2.convexHull(np.rint(view.pixels_px).astype(np.int32))
    cv2.fillConvexPoly(field, hull, (255,))
    return ImageComparison(
        view.name, image, twin, view.pixels_px, _offsets_px(view, found),
        np.array(rises).reshape(-1, 2), 0.5 * (starts + ends), levels,
        even_blocks(image, twin, field),
    )  # fmt: skip


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
    """Errors of a twin over the field, from at least one image beside its twin.

    A corner farther off than `max_offset_px` is lost; the rise of a ring with fewer edges is
    unknown.
    """
    center = np.array(sensor.model.principal_point_px)
    corners = np.concatenate([image.corners_px for image in images])
    offsets = np.concatenate([image.offsets_px for image in images])
    rises = np.concatenate([image.rises_px for image in images])
    edges = np.concatenate([image.edge_centers_px for image in images])
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
        count = int(in_ring.sum())
        lost = count - int(inside.sum())
        radius_px = float(radii[in_ring].max())
        rings.append(Ring(radius_px, count, lost, bias, rms, *median.tolist()))
    levels = np.concatenate([image.levels for image in images])
    noise = noise_by_level([image.blocks for image in images])
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


# Gray levels and noise of small blocks of one color, in a camera's image and in the twin's.
#
# Source: Immerkær, "Fast noise variance estimation" (1996): its mask is 0 on planes and along rows
# and columns.


_T = TypeVar("_T", bound=np.generic)
BLOCK_PX = 8
BIN_LEVELS = 16
MIN_BLOCKS = 20  # of a bin, in the images and in the twin's
_UNEVEN = 3.0  # gray levels between quarters of a block, beyond those of its noise
_CLIPPED = 4.0  # gray levels from black or white
_MASK = np.array([[1.0, -2.0, 1.0], [-2.0, 4.0, -2.0], [1.0, -2.0, 1.0]])


class NoiseLevel(NamedTuple):
    """Noise at one gray level."""

    level: float  # middle of the bin of gray levels
    blocks: int  # number of blocks in the images
    # noise, twin_noise: median standard deviation in the images and in the twin's, gray levels
    noise: float
    twin_noise: float


def even_blocks(image: Bytes, twin: Bytes, field: Bytes) -> Floats:
    """Mean level and noise of blocks that are even in both images: (blocks, 2, 2).

    The second axis is image and twin (height, width), the third mean and standard deviation. Blocks
    are within `field` (height, width); 0: not used.
    """
    whole = _blocks(field > 0).all(axis=(2, 3))
    parts, is_even = [], whole
    for gray in (image, twin):
        levels = gray.astype(np.float64)
        blocks = _blocks(levels)
        mean = blocks.mean(axis=(2, 3))
        response = np.abs(convolve2d(levels, _MASK, mode="same", boundary="symm"))
        inner = _blocks(response)[..., 1:-1, 1:-1]  # of the block's own pixels only
        noise = math.sqrt(0.5 * math.pi) / 6.0 * inner.mean(axis=(2, 3))
        half = BLOCK_PX // 2
        quarters = blocks.reshape(*mean.shape, 2, half, 2, half).mean(axis=(3, 5))
        spread = quarters.max(axis=(2, 3)) - quarters.min(axis=(2, 3))
        is_even = is_even & (spread <= _UNEVEN + noise)
        is_even = is_even & (mean >= _CLIPPED) & (mean <= 255.0 - _CLIPPED)
        parts.append(np.stack((mean, noise), axis=-1))
    return np.stack(parts, axis=2)[is_even]


def noise_by_level(blocks: Sequence[Floats]) -> tuple[NoiseLevel, ...]:
    """Noise in bins of gray levels that have enough of the blocks (n, 2, 2) of each image."""
    both = np.concatenate([np.zeros((0, 2, 2)), *blocks])
    bins = np.floor(both[..., 0] / BIN_LEVELS).astype(np.int64)
    rows = []
    for index in range(math.ceil(256 / BIN_LEVELS)):
        noises = [both[bins[:, side] == index, side, 1] for side in (0, 1)]
        if min(map(len, noises)) >= MIN_BLOCKS:
            middle = BIN_LEVELS * (index + 0.5)
            medians = [float(np.median(noise)) for noise in noises]
            rows.append(NoiseLevel(middle, len(noises[0]), *medians))
    return tuple(rows)


def _blocks(values: NDArray[_T]) -> NDArray[_T]:
    """Blocks (rows, columns, BLOCK_PX, BLOCK_PX) of an image, without the rest at its edges."""
    rows, columns = (size // BLOCK_PX for size in values.shape)
    cut = values[: rows * BLOCK_PX, : columns * BLOCK_PX]
    return cut.reshape(rows, BLOCK_PX, columns, BLOCK_PX).swapaxes(1, 2)


# Poses of image files: by the names in a file of poses, or one after another.


def pose_indices(
    files: Sequence[Path], names: Sequence[str] | None, count: int, source: Path
) -> Indices:
    """Index of the pose of each image (files,), from the names of the poses' images.

    Names are compared without their folders and suffixes. Without names, there must be as many
    poses (`count`, in the file `source`) as images, in the order of the images' names.

    Raises:
        MeasurementError: an image without a pose, a name twice, or another number of poses.
    """
    if names is None:
        if count != len(files):
            raise MeasurementError(
                f"{source}: {count} poses for {len(files)} images: expected one pose per image in "
                "the order of their names, or the images' names in the first column"
            )
        return np.arange(count)
    stems = [PurePosixPath(name.replace("\\", "/")).stem for name in names]
    repeated = [stem for stem, number in Counter(stems).items() if number > 1]
    index_of_stem = {stem: index for index, stem in enumerate(stems)}
    missing = [file for file in files if file.stem not in index_of_stem]
    if missing:
        more = f", nor of {len(missing) - 1} more images" if len(missing) > 1 else ""
        raise MeasurementError(f"{source}: no pose of {missing[0].name}{more}")
    for file in files:
        if file.stem in repeated:
            raise MeasurementError(f"{source}: several poses of {file.stem}: expected one")
    return np.array([index_of_stem[file.stem] for file in files])


# Rise of brightness across a straight edge.
#
# Source: ISO 12233:2023, edge spread function: pixels binned by their distance from the edge.


BIN_PX = 0.25
MIN_LENGTH_PX = 6.0
MIN_CONTRAST = 20.0  # of 255
_REACH_PX = 8.0


def edge_rise_px(image: Bytes, start_px: Floats, end_px: Floats, clear: float = 0.4) -> float:
    """Distance over which an edge rises from 10 % to 90 %, px; NaN: too short, faint or blurred.

    Uses the middle half of the edge between two corners (2,) of the board; a share `clear` of its
    length, to both sides, is without other edges.
    """
    along = end_px - start_px
    length = float(np.linalg.norm(along))
    if length < MIN_LENGTH_PX:
        return math.nan
    along = along / length
    across = np.array([-along[1], along[0]])
    middle, half = 0.5 * (start_px + end_px), 0.25 * length
    reach = min(_REACH_PX, clear * length)
    corner = np.abs(along) * half + np.abs(across) * reach
    low = np.floor(middle - corner).astype(np.int64).clip(0)
    high = np.ceil(middle + corner).astype(np.int64) + 1
    part = image[low[1] : high[1], low[0] : high[0]].astype(np.float64)
    if part.size < 12:
        return math.nan
    v, u = np.indices(part.shape)
    offsets = np.stack((u + low[0], v + low[1]), axis=-1) - middle
    inside = (np.abs(offsets @ along) <= half) & (np.abs(offsets @ across) <= reach)
    distances, levels = (offsets @ across)[inside], part[inside]
    sides = levels[distances < -0.5 * reach], levels[distances > 0.5 * reach]
    if min(map(len, sides)) < 3:
        return math.nan
    black, white = (float(np.median(side)) for side in sides)
    if abs(white - black) < MIN_CONTRAST:
        return math.nan
    share = (levels - black) / (white - black)
    bins = np.floor((distances + reach) / BIN_PX).astype(np.int64)
    count = np.bincount(bins)
    filled = count > 0
    positions = np.bincount(bins, distances)[filled] / count[filled]
    profile = np.maximum.accumulate(np.bincount(bins, share)[filled] / count[filled])
    if profile[0] > 0.1 or profile[-1] < 0.9:
        return math.nan
    low, high = (float(np.interp(part, profile, positions)) for part in (0.1, 0.9))
    return high - low
