"""Figures of the explanation, drawn from the code that they explain.

`python docs/_ext/figures.py` writes all of them; tests compare them with the code.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from architecture_figures import rooms_figure, ways_figure
from camera_figures import frames_figure, optics_figure
from exchange_figure import exchange_figure
from object_figure import object_figure

FOLDER = Path(__file__).resolve().parents[1] / "explanation" / "figures"


def figures() -> Iterator[tuple[Path, str]]:
    """Path and text of each figure."""
    yield FOLDER / "objects.svg", object_figure()
    yield FOLDER / "rooms.svg", rooms_figure()
    yield FOLDER / "ways.svg", ways_figure()
    yield FOLDER / "optics.svg", optics_figure()
    yield FOLDER / "exchange.svg", exchange_figure()
    yield FOLDER / "frames.svg", frames_figure()


if __name__ == "__main__":
    for path, text in figures():
        path.write_text(text, encoding="utf-8")
