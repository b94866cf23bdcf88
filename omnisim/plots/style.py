"""Style and files of figures, and images side by side."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Figure
from numpy.typing import NDArray

from omnisim.core.arrays import Floats
from omnisim.core.errors import OutputError
from omnisim.core.files.atomic_file import atomic_write, check_target
from omnisim.core.srgb import srgb_from_linear
from omnisim.core.version import __version__

DPI = 110
TITLE_PT = 12.0  # of a single plot
BLUE, ORANGE, GREEN, GRAY, RED = "#2c6fbb", "#e07b39", "#3a8f4d", "#777777", "#c23b3b"
FORMATS = ("png", "pdf", "svg")


def plot(
    title: str, x_label: str, y_label: str, width_in: float = 8.0, height_in: float = 4.5
) -> tuple[Figure, Axes]:
    """Figure with one pair of labeled axes and a light grid."""
    figure = Figure(figsize=(width_in, height_in), dpi=DPI, layout="constrained")
    axes = figure.add_subplot()
    label_axes(axes, title, x_label, y_label)
    axes.title.set_fontsize(TITLE_PT)
    return figure, axes


def label_axes(axes: Axes, title: str, x_label: str, y_label: str) -> None:
    """Add title and labels, with a light grid behind the content and without a box."""
    axes.set_title(title, fontsize=10)
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    axes.grid(True, color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def show_between(axes: Axes, low: Sequence[float] | Floats, high: Sequence[float] | Floats) -> None:
    """Show the part of a plane between two corners (2,), with equal scales."""
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")


def common_legend(figure: Figure, **options: Any) -> None:
    """Legend of all axes of a figure, in which each label is once; with matplotlib's options."""
    handles: dict[str, Artist] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(str(label), handle)
    figure.legend(list(handles.values()), list(handles), **options)


def gallery(images: Mapping[str, NDArray[Any]], columns: int, side_in: float = 3.3) -> Figure:
    """Images (height, width, 3), uint8 or linear floats, side by side with their titles."""
    rows = -(-len(images) // columns)
    ratio = max(image.shape[0] / image.shape[1] for image in images.values())
    size = (columns * side_in, rows * (side_in * ratio + 0.35))
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    for index, (title, image) in enumerate(images.items()):
        axes = figure.add_subplot(rows, columns, index + 1)
        axes.set_title(title, fontsize=10)
        axes.set_axis_off()
        shown = image if image.dtype == np.uint8 else srgb_from_linear(image)
        axes.imshow(shown)  # averaged if reduced, pixels if magnified
    return figure


def check_plot_target(path: Path) -> None:
    """Refuse a file that cannot be written, before the work is done.

    Raises:
        OutputError: an unknown format, or a file that cannot be written.
    """
    _format(path)
    check_target(path)


def write_plot(path: Path, figure: Figure) -> None:
    """Write a figure; atomically.

    Raises:
        OutputError: an unknown format, or the file cannot be written.
    """
    data = io.BytesIO()  # matplotlib's writers do not report a full disk
    figure.savefig(data, format=_format(path))
    with atomic_write(path) as partial:
        partial.write_bytes(data.getvalue())


def figure_png(figure: Figure) -> bytes:
    """Bytes of a PNG file with a figure."""
    data = io.BytesIO()
    figure.savefig(data, format="png", metadata={"Software": f"omnisim {__version__}"})
    return data.getvalue()


def _format(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix.removeprefix(".") not in FORMATS:
        expected = ", ".join(f".{name}" for name in FORMATS)
        raise OutputError(f"{path}: expected {expected}, got {suffix or 'no suffix'}")
    return suffix.removeprefix(".")
