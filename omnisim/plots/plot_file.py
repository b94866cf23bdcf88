"""Files of figures."""

from __future__ import annotations

import io
from pathlib import Path

from matplotlib.figure import Figure

from omnisim.core.errors import OutputError
from omnisim.core.files.atomic_file import atomic_write, check_target
from omnisim.core.version import __version__

__all__ = ["FORMATS", "Figure", "check_plot_target", "figure_png", "write_plot"]
FORMATS = ("png", "pdf", "svg")


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
