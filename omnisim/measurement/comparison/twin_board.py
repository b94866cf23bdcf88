"""Image of a board by the twin of a camera: the board as a scene, and its light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.ndimage import map_coordinates

from omnisim.core.arrays import Bools, Bytes, Floats, Floats32
from omnisim.core.errors import MeasurementError
from omnisim.measurement.geometry.board_detection import (
    LUMA,
    TAG_BORDER_BITS,
    charuco_markers,
    tag_cells,
)
from omnisim.measurement.geometry.boards import (
    AprilGrid,
    Board,
    BoardView,
    CharucoBoard,
    Chessboard,
)
from omnisim.measurement.geometry.placed_board import PlacedBoard
from omnisim.rendering.camera.degradations import Encoding
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.scene.model import Instance, Lighting, Material, Mesh, Scene, StartPose

_CLIPPED = 254.0
_MIN_FALLOFF = 0.05  # share of the light; less of it is not divided out


def render_twin(
    sensor: OmniCamera,
    board: PlacedBoard,
    pattern: PrintedPattern,
    patches: BoardPatches,
    image: Bytes,
) -> Bytes:
    """Gray image (height, width) of a printed board by the twin, in light fitted to patches."""
    encoding = sensor.degradation.encoding or Encoding()  # sRGB if it has none
    # the twin's own vignetting is divided out, since it is rendered again
    geometry = ImageGeometry.of_camera(sensor.model)
    falloff = np.ones((geometry.height_px, geometry.width_px, 4), dtype=np.float32)
    if sensor.degradation.vignetting is not None:
        falloff = sensor.degradation.vignetting.apply(falloff, geometry)
    pixels = patch_samples_px(patches, board)
    levels = patch_levels(image, pixels)
    light = encoding.linearized(levels / 255.0)
    light /= np.maximum(patch_levels(falloff[..., 1], pixels), _MIN_FALLOFF)
    is_used = levels < _CLIPPED  # the light of clipped paper is unknown
    if (is_used & ~patches.is_black).sum() < MIN_PATCHES:
        is_used[:] = True
    background = float(encoding.linearized(np.array(np.median(image) / 255.0)))
    scene = board_scene(board, pattern, fit_light(patches, light, is_used), background)
    rig_from_board = np.eye(4)
    rig_from_board[:3] = sensor.model.rig_from_optical @ board.pose[:3]
    base_from_board = sensor.base_from_rig @ rig_from_board
    with open_sensor(scene, sensor, unlit=True) as renderer:
        frame = renderer.render(np.linalg.inv(base_from_board))
    return np.rint(frame.rgba[..., :3] @ LUMA).astype(np.uint8)


def board_scene(
    board: PlacedBoard, pattern: PrintedPattern, light: BoardLight, background: float
) -> Scene:
    """Scene of a board in its own frame, under linear light, before a background of such light."""
    lines = np.stack(np.meshgrid(pattern.x_m, pattern.y_m), axis=-1)
    corners = (np.s_[:-1, :-1], np.s_[:-1, 1:], np.s_[1:, 1:], np.s_[1:, :-1])
    points = board.surface.points(lines)
    quads = np.stack([points[corner] for corner in corners], axis=2).reshape(-1, 3)
    levels = np.stack([light.at(lines[corner], pattern.is_black) for corner in corners], axis=2)
    first = np.arange(0, len(quads), 4)[:, None]
    triangles = np.concatenate((first + [0, 1, 2], first + [0, 2, 3])).astype("u4")
    colors = np.ones((len(quads), 4), dtype=np.float32)
    colors[:, :3] = levels.reshape(-1, 1)
    return Scene(
        name="board",
        meshes=(Mesh("board", quads.astype("f4"), triangles, 0, colors=colors),),
        materials=(Material(base_color=(1.0,) * 4, double_sided=True, unlit=True),),
        instances=(Instance("board", 0, np.eye(4)),),
        lighting=Lighting((1.0, 1.0, 1.0), ()),
        background=(background,) * 3,
        start=StartPose((0.0, 0.0, 0.0)),
    )


# Light on a board: gray levels of even patches, and smooth light fitted to them.


_SHARES = np.linspace(0.3, 0.7, 5)  # of a patch's sides, where its level is taken
_TERMS = 6
_FEW = 3  # terms of a plane, of boards of which little is visible
_ROUNDS = 8
MIN_PATCHES = 9  # of ink and of paper, for a polynomial of each


class BoardLight(NamedTuple):
    """Smooth light on a board: quadratic polynomials of the position, of paper and of ink.

    Ink has its own polynomial: it shines, and the lens's stray light, which is the same for both,
    is much to it. Beyond the fitted patches, the light is that of their edge. The coefficients (6,)
    are of 1, x, y, x², x y, y²; x and y are −1 to 1 in the rectangle of all patches.
    """

    low_m: Floats  # (2,) lower corner of the rectangle
    high_m: Floats  # (2,) upper corner
    paper: Floats
    ink: Floats

    def at(self, positions_m: Floats, is_black: Bools) -> Floats:
        """Light (...) at positions (..., 2) of ink or paper (...)."""
        terms = _terms(positions_m, self.low_m, self.high_m)
        return np.maximum(np.where(is_black, terms @ self.ink, terms @ self.paper), 0.0)


def fit_light(patches: BoardPatches, light: Floats, is_used: Bools) -> BoardLight:
    """Fit smooth light to the linear light (patches,) of those patches of a board that are used.

    Of boards with few patches, the light of ink is taken as a constant share of that of paper.
    """
    low: Floats = patches.rectangles_m[:, :2].min(axis=0)
    high: Floats = patches.rectangles_m[:, 2:].max(axis=0)
    terms = _terms(patches.centers_m, low, high)[is_used]
    light, is_black = light[is_used], patches.is_black[is_used]
    if min(is_black.sum(), (~is_black).sum()) >= MIN_PATCHES:
        paper: Floats = np.zeros(_TERMS)
        ink: Floats = np.zeros(_TERMS)
        for color, of_color in ((paper, ~is_black), (ink, is_black)):
            color[:] = np.linalg.lstsq(terms[of_color], light[of_color], rcond=None)[0]
        return BoardLight(low, high, paper, ink)
    coefficients: Floats = np.zeros(_TERMS)
    count = _TERMS if len(light) >= 2 * _TERMS else _FEW
    share = float(np.median(light[is_black]) / max(np.median(light[~is_black]), 1e-9))
    for _ in range(_ROUNDS):
        design = terms[:, :count] * np.where(is_black, share, 1.0)[:, None]
        coefficients[:count] = np.linalg.lstsq(design, light, rcond=None)[0]
        lit = (terms @ coefficients)[is_black]
        share = float(light[is_black] @ lit / (lit @ lit))
    return BoardLight(low, high, coefficients, share * coefficients)


def visible_patches(pattern: PrintedPattern, view: BoardView) -> BoardPatches:
    """Patches between corners that were detected in an image.

    Raises:
        MeasurementError: fewer than 3 patches of ink or of paper.
    """
    known = {tuple(point) for point in np.round(view.points_m, 9).tolist()}
    is_seen = np.array(
        [
            {(left, top), (right, top), (right, bottom), (left, bottom)} <= known
            for left, top, right, bottom in np.round(pattern.patches.between_m, 9).tolist()
        ]
    )
    patches = pattern.patches.select(is_seen)
    if min(patches.is_black.sum(), (~patches.is_black).sum()) < _FEW:
        raise MeasurementError(f"{view.name}: too little of the board is visible")
    return patches


def patch_levels(image: Bytes | Floats32, pixels_px: Floats) -> Floats:
    """Median levels (patches,) of an image at samples (patches, samples, 2) of patches."""
    levels = map_coordinates(
        image.astype(np.float64), np.moveaxis(pixels_px[..., ::-1], -1, 0), order=1, mode="nearest"
    )
    return np.median(levels, axis=-1)


def patch_samples_px(patches: BoardPatches, board: PlacedBoard) -> Floats:
    """Pixels (patches, samples, 2) in the middle of patches; NaN where the camera shows nothing."""
    across, down = (shares.ravel() for shares in np.meshgrid(_SHARES, _SHARES))
    left, top, right, bottom = patches.rectangles_m.T[..., None]
    positions = np.stack((left + across * (right - left), top + down * (bottom - top)), axis=-1)
    seen = board.pixels(positions)
    return np.where(seen.valid[..., None], seen.positions_px, np.nan)


def matching_pattern(
    image: Bytes, patterns: list[PrintedPattern], board: PlacedBoard, view: BoardView
) -> PrintedPattern:
    """Pattern of the same cells whose ink is darkest in an image (height, width), beside its paper.

    Only cells among the detected corners of the view are compared.
    """
    if len(patterns) == 1:
        return patterns[0]
    centers = patterns[0].cell_centers_m
    low, high = view.points_m.min(axis=0), view.points_m.max(axis=0)
    is_used = ((centers > low) & (centers < high)).all(axis=-1)
    seen = board.pixels(centers[is_used])
    positions = np.where(seen.valid[:, None], seen.positions_px, 0.0)
    levels = patch_levels(image, positions[:, None])

    def contrast(pattern: PrintedPattern) -> float:
        is_black = pattern.is_black[is_used] & seen.valid
        is_white = ~pattern.is_black[is_used] & seen.valid
        return float(levels[is_white].mean() - levels[is_black].mean())

    return max(patterns, key=contrast)


def _terms(positions_m: Floats, low_m: Floats, high_m: Floats) -> Floats:
    """Powers (..., 6) of positions (..., 2), clipped to a rectangle."""
    scaled = np.clip((positions_m - low_m) / np.maximum(high_m - low_m, 1e-9), 0.0, 1.0)
    x, y = np.moveaxis(2.0 * scaled - 1.0, -1, 0)
    return np.stack((np.ones_like(x), x, y, x * x, x * y, y * y), axis=-1)


# Printed patterns of calibration boards: cells of ink and paper, even patches, and edges.
#
# Sources: OpenCV's module `aruco`, for the bits of markers; Kalibr's wiki, "Calibration targets".


_PAPER = 1  # squares of white paper around the squares of a board


@dataclass(frozen=True, eq=False)
class BoardPatches:
    """Rectangles of one color, large enough for a comparison of their gray levels."""

    rectangles_m: Floats  # (patches, 4) left, top, right and bottom on the board
    # (patches, 4) rectangle of four corners of the board that contains each patch
    between_m: Floats
    is_black: Bools  # (patches,) True for ink

    @property
    def centers_m(self) -> Floats:
        """Centers (patches, 2) on the board."""
        return 0.5 * (self.rectangles_m[:, :2] + self.rectangles_m[:, 2:])

    def select(self, chosen: Bools) -> BoardPatches:
        """Patches selected by a mask (patches,)."""
        return BoardPatches(
            self.rectangles_m[chosen], self.between_m[chosen], self.is_black[chosen]
        )


@dataclass(frozen=True, eq=False)
class PrintedPattern:
    """Print of a board in its own plane, x along the rows and y along the columns."""

    # x_m, y_m: (columns + 1,) and (rows + 1,) lines between cells, ascending
    x_m: Floats
    y_m: Floats
    is_black: Bools  # (rows, columns) True for cells of ink
    patches: BoardPatches  # patches whose gray levels are compared
    # (edges, 2, 2) both ends of edges between ink and paper, at corners of the board
    edges_m: Floats
    clear: float  # share of an edge's length up to which each side is of one color

    @property
    def cell_centers_m(self) -> Floats:
        """Centers (rows, columns, 2) of the cells."""
        x, y = (0.5 * (lines[1:] + lines[:-1]) for lines in (self.x_m, self.y_m))
        return np.stack(np.meshgrid(x, y), axis=-1)


def possible_patterns(board: Board) -> list[PrintedPattern]:
    """Patterns that a board's description permits; an image tells which one was printed.

    The first square of a chessboard is black or white; an AprilGrid's tags have any of four
    rotations.
    """
    if isinstance(board, Chessboard):
        return [_chessboard(board, first) for first in (0, 1)]
    if isinstance(board, CharucoBoard):
        return [_charuco(board)]
    return [_april_grid(board, turns) for turns in range(4)]


def _chessboard(board: Chessboard, first: int) -> PrintedPattern:
    """Chessboard whose squares with an even sum of indices are black if `first` is 0."""
    columns, rows, side = board.columns, board.rows, board.square_m
    x, y = (side * np.arange(-1.0 - _PAPER, count + 1.0 + _PAPER) for count in (columns, rows))
    is_black = _checkers(rows + 1, columns + 1, first)
    inner = _rectangles(x[2:-2], y[2:-2])
    patches = BoardPatches(inner, inner, is_black[1:-1, 1:-1].ravel())
    return PrintedPattern(
        x, y, np.pad(is_black, _PAPER), patches, _grid_edges(x[2:-2], y[2:-2]), 0.4
    )


def _charuco(board: CharucoBoard) -> PrintedPattern:
    """ChArUco board: markers in the white squares of a chessboard."""
    side, margin = board.square_m, 0.5 * (board.square_m - board.marker_m)
    markers = charuco_markers(board)
    bits = len(next(iter(markers.values())))
    lines = np.concatenate(([0.0], np.linspace(margin, side - margin, bits + 1)))
    x, y = (
        np.concatenate(([-side], *(side * index + lines for index in range(count)),
                        side * (count + np.arange(2.0))))
        for count in (board.columns, board.rows)
    )  # fmt: skip
    squares = _checkers(board.rows, board.columns, 0)
    cells = np.kron(squares, np.ones((bits + 2, bits + 2), dtype=bool))
    for (row, column), marker in markers.items():
        top, left = row * (bits + 2) + 1, column * (bits + 2) + 1
        cells[top : top + bits, left : left + bits] = marker
    inner_x, inner_y = (side * np.arange(1.0, count) for count in (board.columns, board.rows))
    between, is_ink = _rectangles(inner_x, inner_y), squares[1:-1, 1:-1].ravel()
    paper = between[~is_ink]
    patches = _patches(
        (between[is_ink], between[is_ink], True),
        (_strips(paper, margin), np.repeat(paper, 4, axis=0), False),
    )
    return PrintedPattern(
        x, y, np.pad(cells, 1), patches, _grid_edges(inner_x, inner_y), margin / side
    )


def _april_grid(board: AprilGrid, quarter_turns: int) -> PrintedPattern:
    """AprilGrid: tags, and squares of ink between the corners of neighboring tags."""
    tag, gap = board.tag_m, board.tag_m * board.spacing
    pitch = tag + gap
    codes = [
        np.rot90(tag_cells(number), quarter_turns) for number in range(board.columns * board.rows)
    ]
    bits = len(codes[0])
    lines = np.linspace(0.0, tag, bits + 1)
    starts_x = pitch * np.arange(board.columns)
    starts_y = -tag - pitch * np.arange(board.rows)[::-1]  # y is down, rows count upward
    x, y = (
        np.concatenate((
            starts[0] - gap * np.array([2.0, 1.0]), *(start + lines for start in starts),
            starts[-1] + tag + gap * np.array([1.0, 2.0]),
        ))
        for starts in (starts_x, starts_y)
    )  # fmt: skip
    cells = np.zeros((len(y) - 1, len(x) - 1), dtype=bool)
    cells[1 :: bits + 1, 1 :: bits + 1] = True
    for number, code in enumerate(codes):
        row, column = board.rows - 1 - number // board.columns, number % board.columns
        top, left = row * (bits + 1) + 2, column * (bits + 1) + 2
        cells[top : top + bits, left : left + bits] = code
    edges_x, edges_y = (
        np.stack((starts, starts + tag), axis=1).ravel() for starts in (starts_x, starts_y)
    )
    rectangles = _rectangles(edges_x, edges_y).reshape(len(edges_y) - 1, len(edges_x) - 1, 4)
    tags = rectangles[::2, ::2].reshape(-1, 4)
    crossings = rectangles[1::2, 1::2].reshape(-1, 4)
    gaps = np.concatenate(
        (rectangles[::2, 1::2].reshape(-1, 4), rectangles[1::2, ::2].reshape(-1, 4))
    )
    border = tag * TAG_BORDER_BITS / bits
    patches = _patches(
        (_strips(tags, border), np.repeat(tags, 4, axis=0), True),
        (crossings, crossings, True),
        (gaps, gaps, False),
    )
    x0, y0, x1, y1 = tags.T
    corners = ((x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0))
    points = np.stack([np.stack(corner, axis=-1) for corner in corners], axis=1)
    sides = np.stack((points[:, :-1], points[:, 1:]), axis=2).reshape(-1, 2, 2)
    return PrintedPattern(x, y, cells, patches, sides, min(border / tag, board.spacing))


def _checkers(rows: int, columns: int, first: int) -> Bools:
    """Squares (rows, columns) of a chessboard; the one at the origin is black if `first` is 0."""
    return np.indices((rows, columns)).sum(axis=0) % 2 == first


def _rectangles(x: Floats, y: Floats) -> Floats:
    """Rectangles (n, 4) between neighboring lines, row by row: left, top, right, bottom."""
    left, top = np.meshgrid(x[:-1], y[:-1])
    right, bottom = np.meshgrid(x[1:], y[1:])
    return np.stack((left, top, right, bottom), axis=-1).reshape(-1, 4)


def _strips(rectangles: Floats, width: float) -> Floats:
    """Strips (4 n, 4) along the inner sides of rectangles (n, 4)."""
    strips = np.repeat(rectangles[:, None], 4, axis=1)
    for side, sign in enumerate((1.0, 1.0, -1.0, -1.0)):
        strips[:, side, (side + 2) % 4] = rectangles[:, side] + sign * width
    return strips.reshape(-1, 4)


def _grid_edges(x: Floats, y: Floats) -> Floats:
    """Edges (n, 2, 2) between neighboring points of a grid, by their ends."""
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    along_rows = np.stack((grid[:, :-1], grid[:, 1:]), axis=2).reshape(-1, 2, 2)
    along_columns = np.stack((grid[:-1], grid[1:]), axis=2).reshape(-1, 2, 2)
    return np.concatenate((along_rows, along_columns))


def _patches(*parts: tuple[Floats, Floats, bool]) -> BoardPatches:
    """Patches from parts of rectangles (n, 4), their surrounding corners (n, 4), and a color."""
    rectangles, between, colors = zip(*parts, strict=True)
    return BoardPatches(
        np.concatenate(rectangles),
        np.concatenate(between),
        np.repeat(colors, [len(part) for part in rectangles]),
    )
