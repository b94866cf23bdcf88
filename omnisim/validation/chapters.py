"""The chapters of the proof, in the order of the report, and how they are run."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Literal

from omnisim.errors import OmnisimError
from omnisim.validation.check import Bench, Findings
from omnisim.validation.oracles import why_missing

Status = Literal["passed", "failed", "skipped"]


@dataclass(frozen=True)
class Chapter:
    """One check and its place in the report.

    Attributes:
        key: short name, in `report.json` and on the command line.
        title: heading.
        where: module in `omnisim.validation.checks` and function in it; imported when it runs.
        oracles: what it cannot do without, from the extra `oracles`, as "module" or
            "module.attribute".
        is_quick: it is part of the quick report.
    """

    key: str
    title: str
    where: str
    oracles: tuple[str, ...] = ()
    is_quick: bool = True

    def missing(self) -> str:
        """Which oracle cannot be used, why, and what to do; empty: none is missing."""
        return "; ".join(filter(None, map(why_missing, self.oracles)))

    def run(self, bench: Bench) -> Findings:
        """Do the check."""
        module, _, function = self.where.partition(".")
        check = getattr(import_module(f"omnisim.validation.checks.{module}"), function)
        findings: Findings = check(bench)
        return findings


CHAPTERS = (
    Chapter("rings", "Fig. 7 and Eq. 2: where the picture shows an angle", "rings.check"),
    Chapter("polygons", "Fig. 8 and 9: how many polygons the mirror needs", "polygons.check"),
    Chapter("viewpoint", "Single viewpoint", "viewpoint.check"),
    Chapter(
        "path-tracer",
        "A physical mirror, traced by another renderer",
        "path_tracer.check",
        oracles=("mitsuba",),
        is_quick=False,
    ),
    Chapter(
        "second-rasteriser",
        "A second rasteriser",
        "second_rasteriser.check",
        oracles=("pyrender",),
    ),
    Chapter("quality", "Quality of the picture, and shimmer", "picture_quality.check"),
    Chapter("markers", "Markers through the whole pipeline", "calibration.check_markers"),
    Chapter(
        "omnidir", "A calibration library", "calibration.check_omnidir", oracles=("cv2.omnidir",)
    ),
    Chapter(
        "boards",
        "Calibration files in the hands of others",
        "boards.check",
        oracles=("cv2.omnidir",),
    ),
    Chapter("orientation", "Orientation", "orientation.check"),
    Chapter("unwarping", "Unwarped views", "unwarping.check"),
)


@dataclass(frozen=True)
class Outcome:
    """What came of one chapter.

    Attributes:
        chapter: which.
        status: passed, failed or skipped.
        findings: None where it was skipped, or an oracle broke down.
        reason: why it was skipped, and what to do, or how the oracle broke down; else empty.
        seconds: how long it took.
    """

    chapter: Chapter
    status: Status
    findings: Findings | None
    reason: str
    seconds: float


def run_chapters(bench: Bench, chapters: Sequence[Chapter]) -> Iterator[Outcome]:
    """Run chapters one after the other.

    Raises:
        OmnisimError: OpenGL is not there, or anything else that a user can put right.
    """
    for chapter in chapters:
        missing = chapter.missing()
        if missing:
            yield Outcome(chapter, "skipped", None, missing, 0.0)
            continue
        start = time.perf_counter()
        try:
            findings = chapter.run(bench)
        except OmnisimError:
            raise
        except Exception as broken:
            if not chapter.oracles:
                raise  # a defect of ours
            words = " ".join(f"{type(broken).__name__}: {broken}".split())
            yield Outcome(chapter, "failed", None, words[:300], time.perf_counter() - start)
            continue
        seconds = time.perf_counter() - start
        yield Outcome(chapter, "passed" if findings.passed else "failed", findings, "", seconds)
