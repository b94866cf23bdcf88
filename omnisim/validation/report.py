"""The report: `report.json`, the figures, and one `report.html` that holds everything."""

from __future__ import annotations

import base64
import io
import json
import math
import os
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import jinja2

from omnisim.atomic_file import atomic_write, check_target
from omnisim.errors import OutputError
from omnisim.gpu.context import graphics_info, open_context
from omnisim.validation.chapters import CHAPTERS, Outcome
from omnisim.validation.check import Findings, Picture
from omnisim.version import __version__

TEMPLATE = Path(__file__).with_name("report.html.jinja")
FORMAT_VERSION = 1
_LIBRARIES = ("moderngl", "numpy", "mitsuba", "pyrender", "opencv-contrib-python-headless")


@dataclass(frozen=True)
class Report:
    """All outcomes of one run.

    Attributes:
        outcomes: of the chapters that were asked for.
        is_quick: with the smaller of two sizes.
        machine: what they were measured on, see `machine`.
    """

    outcomes: Sequence[Outcome]
    is_quick: bool
    machine: dict[str, Any]

    @property
    def passed(self) -> bool:
        """Whether no bound was missed; what was skipped does not count."""
        return all(outcome.status != "failed" for outcome in self.outcomes)

    def as_dict(self) -> dict[str, Any]:
        """Everything but the pictures, as JSON can hold it."""
        run = [outcome.chapter for outcome in self.outcomes]
        return {
            "format": FORMAT_VERSION,
            "omnisim": __version__,
            "passed": self.passed,
            "quick": self.is_quick,
            "seconds": round(sum(outcome.seconds for outcome in self.outcomes), 1),
            "machine": self.machine,
            "skipped": {
                outcome.chapter.key: outcome.reason
                for outcome in self.outcomes
                if outcome.status == "skipped"
            },
            "left_out": [chapter.title for chapter in CHAPTERS if chapter not in run],
            "checks": [_as_dict(outcome) for outcome in self.outcomes],
        }

    def write(self, folder: Path) -> None:
        """Write `report.json`, `report.html` and the figures into a folder, made where missing.

        Raises:
            OutputError: they cannot be written.
        """
        pictures = {
            picture.name: png(picture)
            for outcome in self.outcomes
            if outcome.findings
            for picture in outcome.findings.pictures
        }
        told = self.as_dict()
        page = self._html(told, pictures).encode("utf-8")
        try:
            folder.mkdir(exist_ok=True)
        except OSError as reason:
            raise OutputError(f"{folder}: cannot be made: {reason.strerror}") from None
        for name, data in pictures.items():
            _write(folder / f"{name}.png", data)
        _write(folder / "report.html", page)
        _write(folder / "report.json", (json.dumps(told, indent=2) + "\n").encode("utf-8"))

    def _html(self, told: dict[str, Any], pictures: dict[str, bytes]) -> str:
        environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
        encoded = {name: base64.b64encode(data).decode("ascii") for name, data in pictures.items()}
        template = environment.from_string(TEMPLATE.read_text(encoding="utf-8"))
        return template.render(report=told, pictures=encoded)


def check_report_target(folder: Path) -> None:
    """Refuse early what could only fail after the work is done.

    Raises:
        OutputError: the folder cannot be made or written to.
    """
    check_target(folder / "report.json", may_make_folder=True)


def png(picture: Picture) -> bytes:
    """The figure as a PNG file."""
    data = io.BytesIO()
    picture.figure.savefig(data, format="png", metadata={"Software": f"omnisim {__version__}"})
    return data.getvalue()


def machine(device: int | None) -> dict[str, Any]:
    """What the numbers were measured on.

    Raises:
        GraphicsError: no OpenGL.
    """
    context = open_context(device)
    try:
        info = graphics_info(context)
    finally:
        context.release()
    return {
        "renderer": info.renderer,
        "opengl": info.version,
        "system": f"{platform.system()} {platform.machine()}",
        "cores": len(os.sched_getaffinity(0)),
        "python": platform.python_version(),
        "libraries": {name: _version(name) for name in _LIBRARIES},
    }


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _as_dict(outcome: Outcome) -> dict[str, Any]:
    told: dict[str, Any] = {
        "key": outcome.chapter.key,
        "title": outcome.chapter.title,
        "status": outcome.status,
        "seconds": round(outcome.seconds, 1),
    }
    if outcome.findings is None:
        return told | {"reason": outcome.reason}
    return told | _findings(outcome.findings)


def _findings(findings: Findings) -> dict[str, Any]:
    return {
        "sentence": findings.sentence,
        "measures": [
            {
                "name": measure.name,
                "value": measure.value if math.isfinite(measure.value) else None,
                "unit": measure.unit,
                "bound": measure.bound,
                "sense": "at least" if measure.at_least else "at most",
                "passed": measure.passed,
            }
            for measure in findings.measures
        ],
        "facts": findings.facts,
        "tables": [
            {"caption": table.caption, "columns": list(table.columns), "rows": list(table.rows)}
            for table in findings.tables
        ],
        "figures": [
            {"file": f"{picture.name}.png", "caption": picture.caption}
            for picture in findings.pictures
        ],
    }


def _write(path: Path, data: bytes) -> None:
    with atomic_write(path) as partial:
        partial.write_bytes(data)
