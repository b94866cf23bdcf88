"""Reports: sections of measures, tables and figures, as `report.json` and one HTML page."""

from __future__ import annotations

import base64
import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import jinja2

from omnisim.core.files.atomic_file import atomic_write, check_target, make_folder
from omnisim.core.version import __version__
from omnisim.plots.style import Figure, figure_png

TEMPLATE = Path(__file__).with_name("report.html.jinja")
FORMAT_VERSION = 2
HTML, JSON = "report.html", "report.json"
_NUMBER = re.compile(r"\s*([–-]?\s*$|[-+−±]?[.\d])")
_MAX_WORDS = 2  # of a number with its unit
Status = Literal["passed", "failed", "skipped", "measured"]


@dataclass(frozen=True)
class Measure:
    """Measured number with its bound."""

    name: str  # name of the quantity
    value: float  # value; NaN: not measurable
    unit: str = ""  # unit of value and bound; empty: none
    bound: float | None = None  # maximum accepted value; None: no bound
    at_least: bool = False  # the bound is the minimum accepted value
    paper: str = ""  # the paper's value, as text; empty: none
    # reason why the bound is neither held nor missed; empty: it is one of both
    unmeasured: str = ""

    @property
    def passed(self) -> bool | None:
        """True if the bound holds, False for NaN; None without a bound, and if unmeasured."""
        if self.bound is None or self.unmeasured:
            return None
        return self.value >= self.bound if self.at_least else self.value <= self.bound

    @property
    def value_text(self) -> str:
        """Value with its unit: a count, or a number to four digits."""
        if math.isfinite(self.value):
            return self._text(self.value)
        return "–" if self.unmeasured else "not a number"

    @property
    def bound_text(self) -> str:
        """Bound with sign and unit; empty: no bound."""
        if self.bound is None:
            return ""
        return f"{'≥' if self.at_least else '≤'} {self._text(self.bound)}"

    def as_dict(self) -> dict[str, Any]:
        """JSON object."""
        return {
            "name": self.name,
            "value": self.value if math.isfinite(self.value) else None,
            "unit": self.unit,
            "bound": self.bound,
            "sense": "at least" if self.at_least else "at most",
            "passed": self.passed,
            "paper": self.paper,
            **({"unmeasured": self.unmeasured} if self.unmeasured else {}),
        }

    def _text(self, number: float) -> str:
        form = ".0f" if number == round(number) and abs(number) < 1e6 else ".4g"
        return f"{number:z{form}} {self.unit}".rstrip()


@dataclass(frozen=True)
class CaptionedFigure:
    """Figure with its file name without suffix, and a caption that says what must be visible."""

    name: str
    figure: Figure
    caption: str


@dataclass(frozen=True)
class ResultTable:
    """Caption, column headings, and rows of as many cells, as text."""

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    @property
    def are_numbers(self) -> tuple[bool, ...]:
        """True for each column, but the first one, whose cells are numbers with at most a unit."""
        columns = zip(*self.rows, strict=True)
        return tuple(
            index > 0
            and all(len(cell.split()) <= _MAX_WORDS and _NUMBER.match(cell) for cell in cells)
            for index, cells in enumerate(columns)
        )


@dataclass(frozen=True)
class Section:
    """Section of a report."""

    title: str
    text: str = ""  # method and result
    # contents, in this order
    measures: Sequence[Measure] = ()
    tables: Sequence[ResultTable] = ()
    figures: Sequence[CaptionedFigure] = ()
    notices: Sequence[str] = ()  # warnings for the reader
    key: str = ""  # short name in the JSON file; empty: none
    seconds: float | None = None  # duration; None: not measured
    skipped: str = ""  # reason why nothing was measured; empty: not skipped
    failure: str = ""  # error that stopped the measurement; empty: none

    @property
    def missed(self) -> list[Measure]:
        """Measures whose bound does not hold."""
        return [measure for measure in self.measures if measure.passed is False]

    @property
    def status(self) -> Status:
        """Failed after an error or a missed bound; measured if no bound was checked."""
        if self.skipped:
            return "skipped"
        if self.failure or self.missed:
            return "failed"
        is_checked = any(measure.passed is not None for measure in self.measures)
        return "passed" if is_checked else "measured"

    def as_dict(self) -> dict[str, Any]:
        """JSON object without the figures' contents."""
        return {
            "key": self.key,
            "title": self.title,
            "status": self.status,
            "seconds": None if self.seconds is None else round(self.seconds, 1),
            "reason": self.skipped or self.failure,
            "text": self.text,
            "measures": [measure.as_dict() for measure in self.measures],
            "tables": [
                {"caption": table.caption, "columns": table.columns, "rows": table.rows}
                for table in self.tables
            ],
            "figures": [
                {"file": f"{figure.name}.png", "caption": figure.caption} for figure in self.figures
            ],
            "notices": list(self.notices),
        }


@dataclass(frozen=True)
class Report:
    """Report of one validation, benchmark or experiment."""

    title: str  # heading
    text: str  # introduction
    sections: Sequence[Section]  # sections in order
    # parameters of the measurements, of JSON types
    facts: dict[str, Any] = field(default_factory=dict)
    notices: Sequence[str] = ()  # warnings for the reader
    # machine and versions, see `describe_machine`; empty if they do not matter
    machine: dict[str, Any] = field(default_factory=dict)

    @property
    def missed(self) -> list[Measure]:
        """Measures whose bound does not hold."""
        return [measure for section in self.sections for measure in section.missed]

    @property
    def status(self) -> Status:
        """Failed if a section failed; skipped if all sections are."""
        statuses = {section.status for section in self.sections}
        order: tuple[Status, ...] = ("failed", "passed", "measured")
        return next((status for status in order if status in statuses), "skipped")

    @property
    def passed(self) -> bool:
        """True if no section failed; skipped ones do not count."""
        return self.status != "failed"

    @property
    def verdict(self) -> str:
        """One sentence on the bounds; empty if there are none."""
        if not self.passed:
            names = "; ".join(measure.name for measure in self.missed)
            return f"Not every bound holds: {names}." if names else "Not every bound holds."
        if self.status == "skipped":
            return "Nothing was checked."
        bounded = [
            measure
            for section in self.sections
            for measure in section.measures
            if measure.bound is not None
        ]
        if all(measure.passed is None for measure in bounded):
            return ""
        is_partial = self.notices or any(measure.unmeasured for measure in bounded)
        return "Every bound that was checked holds." if is_partial else "Every bound holds."

    def as_dict(self) -> dict[str, Any]:
        """JSON object without the figures' contents."""
        return {
            "format": FORMAT_VERSION,
            "omnisim": __version__,
            "title": self.title,
            "passed": self.passed,
            "machine": self.machine,
            "facts": self.facts,
            "notices": list(self.notices),
            "sections": [section.as_dict() for section in self.sections],
        }

    def write(self, folder: Path) -> None:
        """Write `report.json`, `report.html` and the figures to a folder, created if missing.

        Raises:
            OutputError: a file cannot be written.
        """
        figures = {
            figure.name: figure_png(figure.figure)
            for section in self.sections
            for figure in section.figures
        }
        environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
        template = environment.from_string(TEMPLATE.read_text(encoding="utf-8"))
        encoded = {name: base64.b64encode(png).decode("ascii") for name, png in figures.items()}
        page = template.render(report=self, version=__version__, figures=encoded)
        make_folder(folder)
        for name, png in figures.items():
            _write(folder / f"{name}.png", png)
        _write(folder / HTML, page.encode("utf-8"))
        write_json(folder / JSON, self.as_dict())


def check_report_target(folder: Path) -> None:
    """Refuse a folder that cannot be written to, before the work is done.

    Raises:
        OutputError: it cannot be created or written to.
    """
    check_target(folder / JSON)


def write_json(path: Path, content: object) -> None:
    """Write a JSON file; atomically.

    Raises:
        OutputError: the file cannot be written.
    """
    _write(path, (json.dumps(content, indent=2) + "\n").encode("utf-8"))


def _write(path: Path, data: bytes) -> None:
    with atomic_write(path) as partial:
        partial.write_bytes(data)
