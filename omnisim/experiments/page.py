"""One HTML page with numbers, the paper's beside them, and figures; and the numbers as JSON."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jinja2

from omnisim.atomic_file import atomic_write, check_target
from omnisim.errors import OutputError
from omnisim.plots.plot_file import Figure, figure_png
from omnisim.version import __version__

TEMPLATE = Path(__file__).with_name("page.html.jinja")
FORMAT_VERSION = 1


@dataclass(frozen=True)
class Number:
    """Something that was measured.

    Attributes:
        name: what.
        value: NaN for what could not be.
        unit: empty for none.
        bound: what it is held to, or None.
        at_least: the bound is a lower one.
        paper: what the paper has, in words; empty for nothing.
    """

    name: str
    value: float
    unit: str = ""
    bound: float | None = None
    at_least: bool = False
    paper: str = ""

    @property
    def passed(self) -> bool | None:
        """Whether the bound holds, never for NaN; None without a bound."""
        if self.bound is None:
            return None
        return self.value >= self.bound if self.at_least else self.value <= self.bound

    def as_dict(self) -> dict[str, Any]:
        """As JSON can hold it."""
        return {
            "name": self.name,
            "value": self.value if math.isfinite(self.value) else None,
            "unit": self.unit,
            "bound": self.bound,
            "sense": "at least" if self.at_least else "at most",
            "passed": self.passed,
            "paper": self.paper,
        }


@dataclass(frozen=True)
class Picture:
    """A figure: stem of its file, what it shows, and one sentence of what must be seen."""

    name: str
    figure: Figure
    caption: str


@dataclass(frozen=True)
class Table:
    """Numbers side by side: a caption, headings, and rows of as many cells, as text."""

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Attributes:
        title: of it.
        sentences: what was done and what it shows.
        numbers, tables, pictures: in this order.
        notices: what somebody should know.
    """

    title: str
    sentences: str
    numbers: Sequence[Number] = ()
    tables: Sequence[Table] = ()
    pictures: Sequence[Picture] = ()
    notices: Sequence[str] = ()


@dataclass(frozen=True)
class Page:
    """All of it.

    Attributes:
        title: of the page.
        introduction: below it.
        sections: its parts.
        facts: how it came about, as JSON can hold it.
    """

    title: str
    introduction: str
    sections: Sequence[Section]
    facts: dict[str, Any] = field(default_factory=dict)

    @property
    def missed(self) -> list[Number]:
        """The numbers whose bound does not hold."""
        return [
            number
            for section in self.sections
            for number in section.numbers
            if number.passed is False
        ]

    def as_dict(self) -> dict[str, Any]:
        """Everything but the pictures, as JSON can hold it."""
        return {
            "format": FORMAT_VERSION,
            "omnisim": __version__,
            "title": self.title,
            "facts": self.facts,
            "sections": [
                {
                    "title": section.title,
                    "numbers": [number.as_dict() for number in section.numbers],
                    "tables": [
                        {"caption": table.caption, "columns": table.columns, "rows": table.rows}
                        for table in section.tables
                    ],
                    "figures": [f"{picture.name}.png" for picture in section.pictures],
                    "notices": list(section.notices),
                }
                for section in self.sections
            ],
        }

    def write(self, folder: Path, name: str = "report") -> Path:
        """Write the page, its numbers and its figures into a folder, made where missing.

        Returns the page's path.

        Raises:
            OutputError: they cannot be written.
        """
        pictures = {
            picture.name: figure_png(picture.figure)
            for section in self.sections
            for picture in section.pictures
        }
        environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
        template = environment.from_string(TEMPLATE.read_text(encoding="utf-8"))
        encoded = {key: base64.b64encode(data).decode("ascii") for key, data in pictures.items()}
        html = template.render(page=self, version=__version__, pictures=encoded)
        make_folder(folder)
        for key, data in pictures.items():
            _write(folder / f"{key}.png", data)
        _write(folder / f"{name}.html", html.encode("utf-8"))
        told = json.dumps(self.as_dict(), indent=2) + "\n"
        _write(folder / f"{name}.json", told.encode("utf-8"))
        return folder / f"{name}.html"


def check_folder(folder: Path) -> None:
    """Refuse early what could only fail after the work is done.

    Raises:
        OutputError: the folder cannot be made or written to.
    """
    check_target(folder / "report.html", may_make_folder=True)


def make_folder(folder: Path) -> None:
    """Make a folder where it is missing.

    Raises:
        OutputError: it cannot be made.
    """
    try:
        folder.mkdir(exist_ok=True)
    except OSError as reason:
        raise OutputError(f"{folder}: cannot be made: {reason.strerror}") from None


def _write(path: Path, data: bytes) -> None:
    with atomic_write(path) as partial:
        partial.write_bytes(data)
