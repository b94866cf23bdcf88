"""The checks of `omnisim validate`, in the order of the report."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator, Sequence
from typing import Any

from omnisim.core.errors import OmnisimError
from omnisim.report.report import Report, Section
from omnisim.validation.check_registry import CHECKS, Check
from omnisim.validation.fixture import Fixture


def run_checks(fixture: Fixture, checks: Sequence[Check]) -> Iterator[Section]:
    """Run checks in sequence; a broken oracle fails only its own check.

    Raises:
        OmnisimError: no OpenGL, or another error that a user can fix.
        Exception: a defect in a check without oracles.
    """
    for check in checks:
        section = Section(check.title, key=check.key, skipped=check.skip_reason())
        if section.skipped:
            yield section
            continue
        start = time.perf_counter()
        try:
            section = check.run(fixture)
        except OmnisimError:
            raise
        except Exception as broken:
            if not check.oracles:
                raise  # a defect of omnisim
            message = " ".join(f"{type(broken).__name__}: {broken}".split())
            section = dataclasses.replace(section, failure=message[:300])
        yield dataclasses.replace(section, seconds=time.perf_counter() - start)


def make_report(sections: Sequence[Section], is_quick: bool, machine: dict[str, Any]) -> Report:
    """Report of the finished checks, with notices about checks that were left out or skipped."""
    run = {section.key for section in sections}
    left_out = [check.title for check in CHECKS if check.key not in run]
    notices = ["Quick report: smaller images and fewer samples."] if is_quick else []
    notices += [f"Left out: {'; '.join(left_out)}."] if left_out else []
    notices += [f"Not checked: {part.title}: {part.skipped}" for part in sections if part.skipped]
    seconds = round(sum(section.seconds or 0.0 for section in sections), 1)
    facts = {"quick": is_quick, "left_out": left_out, "seconds": seconds}
    text = "Images against the paper's equations and independent oracles."
    return Report("Validation", text, sections, facts, notices, machine)
