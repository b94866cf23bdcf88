"""Geometry of a camera, from images of a calibration board."""

from omnisim.measurement.geometry.board_detection import find_boards, read_gray
from omnisim.measurement.geometry.boards import (
    AprilGrid,
    BoardView,
    CharucoBoard,
    Chessboard,
    RejectedImage,
    read_board,
)
from omnisim.measurement.geometry.measured_geometry import (
    MeasuredGeometry,
    measure_geometry,
    measure_optics,
)
from omnisim.measurement.geometry.model_choice import ModelResult

__all__ = [
    "AprilGrid", "BoardView", "CharucoBoard", "Chessboard", "MeasuredGeometry", "ModelResult",
    "RejectedImage", "find_boards", "measure_geometry", "measure_optics", "read_board",
    "read_gray",
]  # fmt: skip
