"""Sheets of many images with titles, pixel for pixel."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from omnisim.core.errors import OutputError
from omnisim.core.files.image_files import write_image
from omnisim.plots.style import DPI

Tiles = Sequence[tuple[str, NDArray[np.uint8]]]  # titles and images
TITLE_PX, GAP_PX, POINTS = 26, 8, 9.5
SHEET_JPEG_QUALITY = 82  # good enough to look at, and small enough for a page


def contact_sheet(tiles: Tiles, columns: int) -> NDArray[np.uint8]:
    """Sheet (height, width, 3) of images, row by row, each below its title.

    Images are neither scaled nor smoothed; `magnified` enlarges them. Smaller ones are centered in
    their cell.

    Args:
        tiles: titles with images (height, width, 3) uint8 sRGB or (height, width) gray.
        columns: number of images side by side.

    Raises:
        OutputError: there is no image.
    """
    if not tiles:
        raise OutputError("contact sheet: expected at least one image, got none")
    cell_width = max(image.shape[1] for _, image in tiles) + GAP_PX
    cell_height = max(image.shape[0] for _, image in tiles) + GAP_PX + TITLE_PX
    rows = math.ceil(len(tiles) / columns)
    width, height = columns * cell_width + GAP_PX, rows * cell_height + GAP_PX
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI, facecolor="white")
    for index, (title, _) in enumerate(tiles):
        row, column = divmod(index, columns)
        x = (GAP_PX + (column + 0.5) * cell_width - 0.5 * GAP_PX) / width
        y = 1.0 - (GAP_PX + row * cell_height + 0.5 * TITLE_PX) / height
        figure.text(x, y, title, ha="center", va="center", fontsize=POINTS)
    for text in figure.texts:  # smaller if it would overlap the next
        width_px = text.get_window_extent().width
        text.set_fontsize(POINTS * min(1.0, (cell_width - GAP_PX) / max(width_px, 1.0)))
    data = io.BytesIO()
    figure.savefig(data, format="rgba")
    drawn_width, drawn_height = figure.canvas.get_width_height()
    rgba = np.frombuffer(data.getvalue(), np.uint8).reshape(drawn_height, drawn_width, 4)
    sheet = rgba[:height, :width, :3].copy()
    for index, (_, image) in enumerate(tiles):
        row, column = divmod(index, columns)
        colored = image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=-1)
        top = GAP_PX + row * cell_height + TITLE_PX
        left = GAP_PX + column * cell_width
        left += (cell_width - GAP_PX - colored.shape[1]) // 2
        sheet[top : top + colored.shape[0], left : left + colored.shape[1]] = colored[..., :3]
    return sheet


def magnified(image: NDArray[np.uint8], times: int) -> NDArray[np.uint8]:
    """Image (height, width, …) with each pixel repeated `times` times along both axes."""
    return np.repeat(np.repeat(image, times, axis=0), times, axis=1)


def save_contact_sheet(path: Path, tiles: Tiles, columns: int) -> None:
    """Write a contact sheet: .png or .jpg.

    Raises:
        OutputError: there is no image, or a file cannot be written.
    """
    sheet = np.ascontiguousarray(contact_sheet(tiles, columns))
    write_image(path, sheet, jpeg_quality=SHEET_JPEG_QUALITY)
