"""Board of an image as a scene, with its pose and the brightness of its squares."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from omnisim.cameras.calibration.parameter_vector import ParameterVector
from omnisim.cameras.camera import CentralCamera
from omnisim.cameras.optics.boards.board_pose import pose_from_directions
from omnisim.core.errors import MeasurementError, OpticsError
from omnisim.measurement.geometry.board_view import BoardView
from omnisim.measurement.geometry.boards import Chessboard
from omnisim.measurement.geometry.bundle_adjustment import Adjustment, Corners, adjust
from omnisim.scene.model import Instance, Lighting, Material, Mesh, Scene, StartPose

if TYPE_CHECKING:
    from omnisim.cameras.parametric_camera import ParametricCamera

Floats = NDArray[np.float64]
_SAMPLES = np.linspace(0.3, 0.7, 5)  # of a square's sides, where its level is taken
_BORDER = 1  # squares of white paper around the board


def locate_board(
    camera: CentralCamera, view: BoardView, board_m: Floats | None = None
) -> Adjustment:
    """Fit the pose of a board in an image; the result has the errors of the corners, too.

    Args:
        camera: camera of the image.
        view: the board in the image.
        board_m: (corners, 3) measured positions of the board's corners, in the order of
            `MeasuredGeometry.board_m`; None, or another number of corners: a flat board.

    Raises:
        MeasurementError: the camera does not show the corners.
    """
    corners = Corners.of([view])
    rays = camera.ray_from_pixel(view.pixels_px)
    if not rays.valid.all():
        message = f"{view.name}: the camera shows {rays.valid.sum()} of {len(rays.valid)} corners"
        raise MeasurementError(message)
    pose = pose_from_directions(rays.directions, view.points_m)
    shape = None
    if board_m is not None and board_m.shape == corners.nominal_m.shape:
        shape = board_m - corners.nominal_m
    try:
        fixed = ParameterVector(cast("ParametricCamera", camera), {})  # nothing of it is free
        return adjust(fixed, corners, pose[None], shape)
    except OpticsError as reason:
        raise MeasurementError(f"{view.name}: {reason}") from None


def board_grid_m(board: Chessboard, board_m: Floats | None) -> Floats:
    """Corners (rows + 4, columns + 4, 3) of a chessboard's squares and of a border of paper.

    `rows` and `columns` count inner corners. The corners beyond them are extrapolated.

    Args:
        board: chessboard.
        board_m: (corners, 3) measured inner corners, sorted by x, then by y; None: flat.
    """
    y, x = np.mgrid[: board.rows, : board.columns] * board.square_m
    grid = np.stack((x, y, np.zeros_like(x)), axis=-1)
    if board_m is not None and len(board_m) == board.rows * board.columns:
        grid = board_m.reshape(board.columns, board.rows, 3).swapaxes(0, 1)
    for _ in range(1 + _BORDER):
        for axis in (0, 1):
            first = 2.0 * np.take(grid, [0], axis) - np.take(grid, [1], axis)
            last = 2.0 * np.take(grid, [-1], axis) - np.take(grid, [-2], axis)
            grid = np.concatenate((first, grid, last), axis)
    return grid


def square_levels(image: NDArray[np.uint8], corners_px: Floats) -> NDArray[np.float64]:
    """Median gray levels (rows - 1, columns - 1) of squares between corners (rows, columns, 2)."""
    shares = np.stack(np.meshgrid(_SAMPLES, _SAMPLES), axis=-1).reshape(-1, 2)
    across, down = shares[:, 0], shares[:, 1]
    quads = (corners_px[:-1, :-1], corners_px[:-1, 1:], corners_px[1:, :-1], corners_px[1:, 1:])
    weights = ((1 - across) * (1 - down), across * (1 - down), (1 - across) * down, across * down)
    positions = np.einsum("ks,kijc->sijc", np.stack(weights), np.stack(quads))
    levels = map_coordinates(
        image.astype(np.float64), np.moveaxis(positions[..., ::-1], -1, 0), order=1, mode="nearest"
    )
    middle: Floats = np.median(levels, axis=0)
    return middle


def even_light(light: Floats, is_black: NDArray[np.bool_]) -> Floats:
    """Fit smooth light to a board, and return the fitted light (rows, columns) of its squares.

    The light of white squares is a quadratic polynomial of the position on the board; the light of
    black squares is a constant share of the polynomial.

    Args:
        light: (rows, columns) linear light of the squares.
        is_black: (rows, columns) True for black squares.
    """
    rows, columns = light.shape
    y, x = np.mgrid[-1.0 : 1.0 : rows * 1j, -1.0 : 1.0 : columns * 1j]
    terms = np.stack((np.ones_like(x), x, y, x * x, x * y, y * y), axis=-1)
    share = float(np.median(light[is_black]) / max(np.median(light[~is_black]), 1e-9))
    for _ in range(8):
        factors = np.where(is_black, share, 1.0)
        design = (terms * factors[..., None]).reshape(-1, 6)
        smooth = terms @ np.linalg.lstsq(design, light.ravel(), rcond=None)[0]
        share = float((light * smooth)[is_black].sum() / np.square(smooth[is_black]).sum())
    even: Floats = np.maximum(smooth * np.where(is_black, share, 1.0), 0.0)
    return even


def board_scene(grid_m: Floats, light: Floats, background: float) -> Scene:
    """Scene of a board in its own frame.

    Args:
        grid_m: (rows + 1, columns + 1, 3) corners of the squares.
        light: (rows, columns) linear light of the squares.
        background: linear light of the background.
    """
    corners = (grid_m[:-1, :-1], grid_m[:-1, 1:], grid_m[1:, 1:], grid_m[1:, :-1])
    quads = np.stack(corners, axis=2).reshape(-1, 4, 3)
    first = 4 * np.arange(len(quads))[:, None]
    triangles = np.concatenate((first + [0, 1, 2], first + [0, 2, 3])).astype("u4")
    colors = np.ones((4 * light.size, 4), dtype=np.float32)
    colors[:, :3] = np.repeat(light.reshape(-1), 4)[:, None]
    mesh = Mesh("board", quads.reshape(-1, 3).astype("f4"), triangles, 0, colors=colors)
    return Scene(
        name="board",
        meshes=(mesh,),
        materials=(Material(base_color=(1.0,) * 4, double_sided=True, unlit=True),),
        instances=(Instance("board", 0, np.eye(4)),),
        lighting=Lighting((1.0, 1.0, 1.0), ()),
        background=(background,) * 3,
        start=StartPose((0.0, 0.0, 0.0)),
    )
