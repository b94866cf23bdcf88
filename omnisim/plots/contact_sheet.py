"""Many pictures with their titles on one sheet, pixel for pixel."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from omnisim.errors import OutputError
from omnisim.image_files import write_image
from omnisim.plots.style import DPI

TITLE_PX, GAP_PX, POINTS = 26, 8, 9.5
SHEET_JPEG_QUALITY = 82  # to look at, and light enough for a page


def contact_sheet(
    tiles: Sequence[tuple[str, NDArray[np.uint8]]], columns: int
) -> NDArray[np.uint8]:
    """The sheet (height, width, 3) of pictures, row by row, each below its title.

    Pictures are neither scaled nor smoothed: `magnified` enlarges them. Smaller
    ones stand in the middle of their cell.

    Args:
        tiles: titles, and pictures (height, width, 3) uint8 sRGB or (height, width) grey.
        columns: pictures side by side.

    Raises:
        OutputError: no picture.
    """
    if not tiles:
        raise OutputError("a contact sheet without pictures: want at least one")
    cell_width = max(picture.shape[1] for _, picture in tiles) + GAP_PX
    cell_height = max(picture.shape[0] for _, picture in tiles) + GAP_PX + TITLE_PX
    rows = math.ceil(len(tiles) / columns)
    width, height = columns * cell_width + GAP_PX, rows * cell_height + GAP_PX
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI, facecolor="white")
    for index, (title, _) in enumerate(tiles):
        row, column = divmod(index, columns)
        x = (GAP_PX + (column + 0.5) * cell_width - 0.5 * GAP_PX) / width
        y = 1.0 - (GAP_PX + row * cell_height + 0.5 * TITLE_PX) / height
        figure.text(x, y, title, ha="center", va="center", fontsize=POINTS)
    canvas = FigureCanvasAgg(figure)
    for text in figure.texts:  # smaller where it would run into the next
        taken_px = text.get_window_extent(canvas.get_renderer()).width
        text.set_fontsize(POINTS * min(1.0, (cell_width - GAP_PX) / max(taken_px, 1.0)))
    canvas.draw()
    sheet = np.array(canvas.buffer_rgba())[:height, :width, :3]
    for index, (_, picture) in enumerate(tiles):
        row, column = divmod(index, columns)
        colored = picture if picture.ndim == 3 else np.repeat(picture[..., None], 3, axis=-1)
        top = GAP_PX + row * cell_height + TITLE_PX
        left = GAP_PX + column * cell_width
        left += (cell_width - GAP_PX - colored.shape[1]) // 2
        sheet[top : top + colored.shape[0], left : left + colored.shape[1]] = colored[..., :3]
    return sheet


def magnified(picture: NDArray[np.uint8], times: int) -> NDArray[np.uint8]:
    """A picture whose pixels are squares of that many pixels a side."""
    return np.repeat(np.repeat(picture, times, axis=0), times, axis=1)


def save_contact_sheet(
    path: Path, tiles: Sequence[tuple[str, NDArray[np.uint8]]], columns: int
) -> None:
    """Write a contact sheet: .png or .jpg.

    Raises:
        OutputError: no picture, or a file that cannot be written.
    """
    sheet = np.ascontiguousarray(contact_sheet(tiles, columns))
    write_image(path, sheet, jpeg_quality=SHEET_JPEG_QUALITY)
