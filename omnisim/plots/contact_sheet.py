"""Sheets of many images with titles, pixel for pixel."""

from __future__ import annotations

import io
import math
import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from omnisim.core.arrays import Bytes
from omnisim.core.errors import OutputError
from omnisim.core.files.image_files import write_image
from omnisim.plots.style import DPI

Tiles = Sequence[tuple[str, Bytes]]  # titles and images
TITLE_PX, LINE_PX, GAP_PX, POINTS = 26, 16, 8, 9.5  # title, its second line, gap; font size
PAGE_PX = 800  # a page shows wider sheets smaller: their titles are larger
SHEET_JPEG_QUALITY = 82  # good enough to look at, and small enough for a page


def contact_sheet(tiles: Tiles, columns: int) -> Bytes:
    """Sheet (height, width, 3) of images, row by row, each below its title.

    Images are neither scaled nor smoothed; `magnified` enlarges them. Smaller ones are centered in
    their cell. Titles can be read on a page of 800 px; long ones take two lines.

    Args:
        tiles: titles with images (height, width, 3) uint8 sRGB or (height, width) gray.
        columns: number of images side by side.

    Raises:
        OutputError: there is no image.
    """
    if not tiles:
        raise OutputError("contact sheet: expected at least one image, got none")
    cell_width = max(image.shape[1] for _, image in tiles) + GAP_PX
    width, rows = columns * cell_width + GAP_PX, math.ceil(len(tiles) / columns)
    scale, lines = max(1.0, width / PAGE_PX), 1
    figure = Figure(dpi=DPI, facecolor="white")  # for the titles; images are copied into the sheet
    for title, _ in tiles:
        text = figure.text(0, 0, title, ha="center", va="center", fontsize=POINTS * scale)
        share = (cell_width - GAP_PX) / max(text.get_window_extent().width, 1.0)
        if share < 1.0 and " " in title:
            text.set_text("\n".join(textwrap.wrap(title, math.ceil(0.55 * len(title)))[:2]))
            share = (cell_width - GAP_PX) / text.get_window_extent().width
            lines = 2
        text.set_fontsize(POINTS * scale * min(1.0, share))
    title_px = round(scale * (TITLE_PX + (lines - 1) * LINE_PX))
    cell_height = max(image.shape[0] for _, image in tiles) + GAP_PX + title_px
    height = rows * cell_height + GAP_PX
    figure.set_size_inches(width / DPI, height / DPI)
    for index, text in enumerate(figure.texts):
        row, column = divmod(index, columns)
        text.set_x((GAP_PX + (column + 0.5) * cell_width - 0.5 * GAP_PX) / width)
        text.set_y(1.0 - (GAP_PX + row * cell_height + 0.5 * title_px) / height)
    data = io.BytesIO()
    figure.savefig(data, format="rgba")
    drawn_width, drawn_height = figure.canvas.get_width_height()
    rgba = np.frombuffer(data.getvalue(), np.uint8).reshape(drawn_height, drawn_width, 4)
    sheet = rgba[:height, :width, :3].copy()
    for index, (_, image) in enumerate(tiles):
        row, column = divmod(index, columns)
        colored = image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=-1)
        top = GAP_PX + row * cell_height + title_px
        left = GAP_PX + column * cell_width
        left += (cell_width - GAP_PX - colored.shape[1]) // 2
        sheet[top : top + colored.shape[0], left : left + colored.shape[1]] = colored[..., :3]
    return sheet


def magnified(image: Bytes, times: int) -> Bytes:
    """Image (height, width, …) with each pixel repeated `times` times along both axes."""
    return np.repeat(np.repeat(image, times, axis=0), times, axis=1)


def save_contact_sheet(path: Path, tiles: Tiles, columns: int) -> None:
    """Write a contact sheet: .png or .jpg.

    Raises:
        OutputError: there is no image, or a file cannot be written.
    """
    sheet = np.ascontiguousarray(contact_sheet(tiles, columns))
    write_image(path, sheet, jpeg_quality=SHEET_JPEG_QUALITY)
