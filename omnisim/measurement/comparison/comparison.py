"""A camera's images compared with its twin's: positions of corners, edges and gray levels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import MeasurementError
from omnisim.core.srgb import linear_from_srgb
from omnisim.measurement.comparison.twin_board import (
    board_grid_m,
    board_scene,
    even_light,
    locate_board,
    square_levels,
)
from omnisim.measurement.edge_rise import edge_rise_px
from omnisim.measurement.geometry.board_detection import find_board
from omnisim.measurement.geometry.board_view import BoardView
from omnisim.measurement.geometry.boards import Chessboard
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor

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
        offsets_px: (n, 2) corners found in the twin, minus those in the image.
        rises_px: (edges, 2) 10-90 % rise of each edge in the image and in the twin; NaN: not seen.
        edge_centers_px: (edges, 2) middle of each edge in the image.
        levels: (squares, 2) gray levels of the squares in the image and in the twin.
    """

    name: str
    image: NDArray[np.uint8]
    twin: NDArray[np.uint8]
    corners_px: Floats
    offsets_px: Floats
    rises_px: Floats
    edge_centers_px: Floats
    levels: Floats


@dataclass(frozen=True, eq=False)
class Ring:
    """Errors of the twin in a ring of the image.

    Attributes:
        radius_px: outer radius about the principal point.
        corners: number of corners.
        lost: number of corners more than 1 px off in the twin; `bias_px` and `rms_px` exclude them.
        bias_px: (2,) mean offset of the corners along the radius and across the radius.
        rms_px: root mean square of the corners' offsets.
        rise_px, twin_rise_px: median 10-90 % rise of edges in the images and in the twin.
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
        level_errors: (squares,) gray levels of the twin minus those of the images.
    """

    images: tuple[ImageComparison, ...]
    rings: tuple[Ring, ...]
    level_errors: Floats

    @property
    def bias_px(self) -> float:
        """Largest absolute mean offset of a ring's corners, along or across the radius."""
        return max(float(np.abs(ring.bias_px).max()) for ring in self.rings)

    @property
    def lost(self) -> int:
        """Number of corners that are more than 1 px off in the twin."""
        return sum(ring.lost for ring in self.rings)


def compare_image(
    sensor: OmniCamera,
    board: Chessboard,
    view: BoardView,
    image: NDArray[np.uint8],
    board_m: Floats | None = None,
    mirrored: bool = False,
) -> ImageComparison:
    """Render a board in the pose that it has in an image, and compare both images.

    Args:
        sensor: twin of the camera.
        board: chessboard.
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
    pose = locate_board(camera, view, board_m).poses[0]
    grid_m = board_grid_m(board, board_m)
    twin = _render(sensor, pose, grid_m, _light(sensor, image, pose, grid_m), image)
    try:
        found = find_board(twin, board, view.name, mirrored)
    except MeasurementError as reason:
        raise MeasurementError(f"{view.name}: in the twin's image: {reason}") from None
    offsets = found.pixels_px - view.pixels_px
    turned = found.pixels_px[::-1] - view.pixels_px  # boards that look the same after half a turn
    if np.abs(turned).sum() < np.abs(offsets).sum():
        offsets = turned
    starts, ends = _edges(view, board)
    rises = [
        [edge_rise_px(one, start, end) for one in (image, twin)]
        for start, end in zip(starts, ends, strict=True)
    ]
    inner = view.pixels_px.reshape(board.rows, board.columns, 2)
    levels = [square_levels(one, inner).ravel() for one in (image, twin)]
    return ImageComparison(
        view.name,
        image,
        twin,
        view.pixels_px,
        offsets,
        np.array(rises),
        0.5 * (starts + ends),
        np.stack(levels, axis=1),
    )


def compare_images(sensor: OmniCamera, images: list[ImageComparison]) -> Comparison:
    """Errors of a twin over the field.

    Args:
        sensor: twin of the camera.
        images: images beside their twins, at least one.
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
        inside = in_ring & (np.linalg.norm(offsets, axis=1) <= MAX_OFFSET_PX)
        of_edges = (edge_radii >= low) & (edge_radii < high) & np.isfinite(rises).all(axis=1)
        seen = rises[of_edges]
        median = np.median(seen, axis=0) if len(seen) else np.full(2, np.nan)
        rings.append(
            Ring(
                float(radii[in_ring].max()),
                int(in_ring.sum()),
                int(in_ring.sum() - inside.sum()),
                np.array([along[inside].mean(), across[inside].mean()]),
                float(np.sqrt(np.mean(np.square(offsets[inside]).sum(axis=1)))),
                float(median[0]),
                float(median[1]),
            )
        )
    levels = np.concatenate([one.levels for one in images])
    return Comparison(tuple(images), tuple(rings), levels[:, 1] - levels[:, 0])


def _edges(view: BoardView, board: Chessboard) -> tuple[Floats, Floats]:
    """Start and end points, (edges, 2) each, of the edges between neighboring corners."""
    grid = view.pixels_px.reshape(board.rows, board.columns, 2)
    starts = [grid[:, :-1].reshape(-1, 2), grid[:-1].reshape(-1, 2)]
    ends = [grid[:, 1:].reshape(-1, 2), grid[1:].reshape(-1, 2)]
    return np.concatenate(starts), np.concatenate(ends)


def _light(
    sensor: OmniCamera, image: NDArray[np.uint8], pose: Floats, grid_m: Floats
) -> tuple[Floats, float]:
    """Linear light (rows, columns) of a board's squares, without vignetting, and the background's.

    The light of the squares is smoothed over the board, so that the twin's own lens effects are
    not rendered twice.
    """
    points = grid_m @ pose[:3, :3].T + pose[:3, 3]
    seen = sensor.model.pixel_from_ray(points)
    pixels = np.where(seen.valid[..., None], seen.positions_px, 0.0)
    light = _linear(sensor, square_levels(image, pixels))
    falloff = _falloff(sensor)
    corners = (pixels[:-1, :-1], pixels[:-1, 1:], pixels[1:, :-1], pixels[1:, 1:])
    centers = np.rint(0.25 * sum(corners)).astype(np.int64)
    column = centers[..., 0].clip(0, image.shape[1] - 1)
    row = centers[..., 1].clip(0, image.shape[0] - 1)
    light = light / np.maximum(falloff[row, column], 0.05)
    rows, columns = light.shape
    parity = np.indices(light.shape).sum(axis=0) % 2 == 0
    known = np.zeros(light.shape, dtype=bool)
    known[2 : rows - 2, 2 : columns - 2] = True  # squares between inner corners
    is_black = parity
    if light[known & parity].mean() > light[known & ~parity].mean():
        is_black = ~parity
    inner = (slice(2, rows - 2), slice(2, columns - 2))
    even = even_light(light[inner], is_black[inner])
    white = float(np.median(even[~is_black[inner]]))
    black = float(np.median(even[is_black[inner]]))
    is_border = np.ones(light.shape, dtype=bool)
    is_border[1:-1, 1:-1] = False
    whole = np.where(is_black & ~is_border, black, white)
    whole[inner] = even
    return whole, float(_linear(sensor, np.array(np.median(image), dtype=np.float64)))


def _linear(sensor: OmniCamera, levels: Floats) -> Floats:
    """Linear light (...) of gray levels (...) from 0 to 255; sRGB if the sensor has no encoding."""
    encoding = sensor.degradation.encoding
    if encoding is None or encoding.gamma == "srgb":
        light: Floats = linear_from_srgb(levels / 255.0)
        return light
    return (levels / 255.0) ** float(encoding.gamma)


def _falloff(sensor: OmniCamera) -> NDArray[np.float32]:
    """Share (height, width) of the light that vignetting leaves."""
    geometry = ImageGeometry.of_camera(sensor.model)
    light = np.ones((geometry.height_px, geometry.width_px, 4), dtype=np.float32)
    vignetting = sensor.degradation.vignetting
    return light[..., 1] if vignetting is None else vignetting.apply(light, geometry)[..., 1]


def _render(
    sensor: OmniCamera,
    pose: Floats,
    grid_m: Floats,
    light: tuple[Floats, float],
    image: NDArray[np.uint8],
) -> NDArray[np.uint8]:
    """Gray image (height, width) of the board, rendered with the twin.

    Args:
        sensor: twin of the camera.
        pose: (4, 4) optical_from_board.
        grid_m: (rows + 1, columns + 1, 3) corners of the squares.
        light: linear light (rows, columns) of the squares, and of the background.
        image: image of the camera.
    """
    rig_from_board = np.eye(4)
    rig_from_board[:3] = sensor.model.rig_from_optical @ pose[:3]
    base_from_board = sensor.base_from_rig @ rig_from_board
    with open_sensor(board_scene(grid_m, *light), sensor, unlit=True) as renderer:
        frame = renderer.render(np.linalg.inv(base_from_board))
    gray: NDArray[np.uint8] = np.ascontiguousarray(frame.rgba[..., 1])
    return gray
