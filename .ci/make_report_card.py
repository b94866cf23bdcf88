"""Evaluate the built-in plans in one report, and renew the documentation's report card.

python .ci/make_report_card.py out/report-card [PLAN …] [--processes N]

The default is all built-in plans. The documentation's plots of plans with variations, and table
rows of those without, are renewed. An interrupted evaluation resumes.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from pages import EXPLANATION, ROOT, renew_block, renew_plots

sys.path.insert(0, str(ROOT))

from omnisim.core.errors import OmnisimError
from omnisim.core.package_files import sweep_names
from omnisim.evaluation.drive_sweep import PointResult, run_sweep
from omnisim.evaluation.sweep_plan import SweepPlan, find_plan, read_plan
from omnisim.report.estimator_report import SWEEP_COLUMNS, lesson_figure, sweep_sections
from omnisim.report.report import Report, Section

# Plans whose errors over the varied values are plots of the documentation's page.
LESSONS = ("field-of-view", "shutter", "calibration", "conditions", "lidar", "imu")
TEXT = (
    "Third-party and our own estimators on simulated drives with known truth: the benchmark set, "
    "and the effects of lens, shutter, calibration, lidar and IMU."
)


def main() -> None:
    """Evaluate the plans, and write the report and the documentation's page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("plans", nargs="*", default=sweep_names())
    parser.add_argument("--processes", type=int, default=2)
    arguments = parser.parse_args()
    sections: list[Section] = []
    rows: dict[str, list[str]] = {}
    try:
        for name in arguments.plans:
            plan, results = _results(name, arguments.folder / "drives", arguments.processes)
            plan_sections = sweep_sections(plan, results, f"{name}-", plan.title)
            sections += plan_sections
            if not plan.vary:
                rows[name] = _rows(name, plan_sections[0])
            if name in LESSONS:
                lesson_figure(plan, results, name).figure.savefig(arguments.folder / f"{name}.png")
            print(f"{name}: {len(results)} drives", flush=True)
        Report("Report card", TEXT, sections).write(arguments.folder)
    except OmnisimError as reason:
        sys.exit(f"error: {reason}")
    lessons = [name for name in LESSONS if name in arguments.plans]
    renew_plots(arguments.folder, EXPLANATION / "figures" / "report-card", lessons)
    _renew_table(rows)


def _results(name: str, folder: Path, processes: int) -> tuple[SweepPlan, list[PointResult]]:
    """Plan of a name or path, and the results of its points in the plan's order.

    Plans with equal drives share recordings and estimates in the folder.
    """
    plan, points = read_plan(find_plan(Path(name)))
    results = list(run_sweep(plan, points, folder, processes))
    order = {(one.variation, one.label, one.seed): index for index, one in enumerate(points)}
    results.sort(key=lambda one: order[one.point.variation, one.point.label, one.point.seed])
    return plan, results


def _renew_table(rows: dict[str, list[str]]) -> None:
    """Replace the rows of the evaluated built-in plans in the documentation's table."""
    page = EXPLANATION / "report-card.md"
    written = page.read_text(encoding="utf-8").splitlines()
    table = ["| plan | estimator | ATE, % of the path | drift, % | lost, % | |"]
    table.append("| --- | --- | ---: | ---: | ---: | --- |")
    for name in sweep_names():
        table += rows.get(name) or [line for line in written if line.startswith(f"| `{name}` | `")]
    renew_block("report card", "\n".join(table) + "\n", [page])


def _rows(name: str, section: Section) -> list[str]:
    """Rows of the documentation's table, from a plan's section on the unchanged drive."""
    rows = []
    for row in section.tables[0].rows:
        cells = dict(zip(SWEEP_COLUMNS, row, strict=True))
        shown = (cells[key] for key in ("% of path", "drift %", "lost %", "without"))
        rows.append(f"| `{name}` | `{cells['estimator']}` | {' | '.join(shown)} |")
    return rows


if __name__ == "__main__":
    main()
