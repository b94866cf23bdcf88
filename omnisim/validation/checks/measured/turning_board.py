"""Readout measured from images of a turning chessboard, each row of them drawn at its own time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import KannalaBrandtCamera
from omnisim.core.errors import MeasurementError
from omnisim.core.poses import rotation_from_roll_pitch_yaw
from omnisim.measurement.geometry import BoardView, Chessboard
from omnisim.measurement.geometry.board_detection import find_board
from omnisim.measurement.timing import measure_readout

Floats = NDArray[np.float64]
CAMERA = KannalaBrandtCamera(320, 240, (160.0, 160.4), (161.0, 118.5), (0.012, -8e-3, 2e-3, -5e-4))
BOARD = Chessboard(7, 6, 0.03)
FRAMES, FRAME_RATE_HZ = 10, 30.0
_DISTANCE_M, _TILT_RAD = 0.25, (0.25, -0.15)
_SAMPLES = 3  # of a pixel's side
_BLACK, _WHITE, _BACKGROUND = 30.0, 220.0, 110.0


def turning_readout_error(random: np.random.Generator) -> float:
    """Relative error of the readout time measured from ten frames of an unevenly turning board."""
    readout_s, turn_radps = random.uniform(0.012, 0.03), np.radians(random.uniform(300.0, 500.0))
    views, numbers = list[BoardView](), list[int]()
    for number in range(FRAMES):
        image = _image(number / FRAME_RATE_HZ, readout_s, turn_radps)
        noisy = np.rint(np.clip(image + 2.0 * random.normal(size=image.shape), 0.0, 255.0))
        try:
            views.append(find_board(noisy.astype(np.uint8), BOARD, f"frame {number}"))
            numbers.append(number)
        except MeasurementError:
            continue  # the board is not found in every image
    measured = measure_readout(CAMERA, views, numbers, FRAME_RATE_HZ)
    return abs(measured.readout_s / readout_s - 1.0)


def _image(time_s: float, readout_s: float, turn_radps: float) -> Floats:
    """Gray levels (height, width) of a frame; `time_s` is the time of its middle row."""
    v, u = np.mgrid[: CAMERA.height_px, : CAMERA.width_px].astype(np.float64)
    times_s = time_s + readout_s * (np.arange(CAMERA.height_px) / (CAMERA.height_px - 1.0) - 0.5)
    angles = turn_radps * times_s + 0.1 * np.sin(9.0 * times_s)  # a hand does not turn evenly
    tilt = rotation_from_roll_pitch_yaw(*_TILT_RAD, 0.0)
    turns = np.stack([tilt @ rotation_from_roll_pitch_yaw(0.0, 0.0, angle) for angle in angles])
    middle = 0.5 * BOARD.square_m * np.array([BOARD.columns - 1.0, BOARD.rows - 1.0, 0.0])
    levels = np.zeros(v.shape)
    offsets = (np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5
    for dv in offsets:
        for du in offsets:
            rays = CAMERA.ray_from_pixel(np.stack((u + du, v + dv), axis=-1)).directions
            # the board's plane passes through (0, 0, distance), with the tilted normal
            scale = _DISTANCE_M * tilt[2, 2] / (rays @ tilt[:, 2])
            points = rays * scale[..., None] - (0.0, 0.0, _DISTANCE_M)
            levels += _brightness(np.einsum("vuj,vjk->vuk", points, turns) + middle)
    return levels / _SAMPLES**2


def _brightness(points: Floats) -> Floats:
    """Gray levels (...) of points (..., 3) in the board's frame."""
    columns, rows = (np.floor(points[..., axis] / BOARD.square_m).astype(int) for axis in (0, 1))
    within = (columns >= -1) & (columns < BOARD.columns) & (rows >= -1) & (rows < BOARD.rows)
    on_paper = (columns >= -2) & (columns <= BOARD.columns) & (rows >= -2) & (rows <= BOARD.rows)
    is_black = within & ((columns + rows) % 2 == 0)
    return np.where(is_black, _BLACK, np.where(on_paper, _WHITE, _BACKGROUND))
