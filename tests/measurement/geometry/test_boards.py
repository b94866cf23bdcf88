"""Descriptions of boards: text, Kalibr's files, and one line for what is wrong."""

import warnings

import pytest

from omnisim.core.errors import MeasurementError, NoticeWarning
from omnisim.measurement.geometry import AprilGrid, CharucoBoard, Chessboard, read_board

KALIBR = {
    "checkerboard": (
        "target_type: checkerboard\ntargetCols: 8\ntargetRows: 6\n"
        "rowSpacingMeters: 0.03\ncolSpacingMeters: 0.03\n"
    ),
    "aprilgrid": (
        "target_type: aprilgrid\ntagCols: 6\ntagRows: 5\ntagSize: 0.088\ntagSpacing: 0.3\n"
    ),
}


@pytest.mark.parametrize(
    ("text", "board"),
    [
        ("8x6:30mm", Chessboard(8, 6, 0.03)),
        ("8x6:0.03", Chessboard(8, 6, 0.03)),
        ("chessboard:8x6:3cm", Chessboard(8, 6, 0.03)),
        ("charuco:9x7:30mm:22mm:5X5_100", CharucoBoard(9, 7, 0.03, 0.022, "5X5_100")),
        ("aprilgrid:6x5:88mm:0.3", AprilGrid(6, 5, 0.088, 0.3)),
    ],
)
def test_text(text, board):
    assert read_board(text) == board


def test_kalibr_files(tmp_path):
    boards = {"checkerboard": Chessboard(8, 6, 0.03), "aprilgrid": AprilGrid(6, 5, 0.088, 0.3)}
    for kind, board in boards.items():
        path = tmp_path / f"{kind}.yaml"
        path.write_text(KALIBR[kind])
        assert read_board(str(path)) == board


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("8x6", "board: expected 8x6:30mm, charuco"),
        ("8x6:30px", "board: expected a length such as 30mm, got '30px'"),
        ("8x2:30mm", "board: expected 3 to 100 columns and rows, got 8 x 2"),
        ("8x6:0", "board: square: expected more than 0, got 0"),
        ("charuco:9x7:30mm:30mm:5X5_100", "board: marker: expected less than the square's 0.03 m"),
        ("charuco:9x7:30mm:22mm:5X5", "board: dictionary: expected one such as 5X5_100, got '5X5'"),
        ("aprilgrid:6x5:88mm:x", "board: spacing: expected a number such as 0.3, got 'x'"),
        ("tags:6x5", "board: expected 8x6:30mm, charuco"),
    ],
)
def test_faults_are_named(text, message):
    with pytest.raises(MeasurementError, match=message):
        read_board(text)


def test_faults_of_files_are_named(tmp_path):
    path = tmp_path / "target.yaml"
    path.write_text(KALIBR["checkerboard"].replace("8", "8.5"))
    with pytest.raises(MeasurementError, match=r"target.yaml: targetCols: expected a whole number"):
        read_board(str(path))
    path.write_text("target_type: circlegrid\n")
    with pytest.raises(MeasurementError, match="target_type: expected checkerboard or aprilgrid"):
        read_board(str(path))


@pytest.mark.parametrize("text", ["8x6:80", "charuco:9x7:30:22:5X5_100", "aprilgrid:6x6:88:0.3"])
def test_a_board_in_millimeters_is_named(text):
    """Lengths without a unit are in meters."""
    with pytest.warns(NoticeWarning, match=r"^board .*: \d+ m wide; \d+mm would be millimeters$"):
        read_board(text)
    with warnings.catch_warnings():
        warnings.simplefilter("error", NoticeWarning)
        read_board(text.replace("80", "80mm").replace(":30:22", ":30mm:22mm").replace("88", "88mm"))
        read_board("8x6:80m")  # stated: a wall
